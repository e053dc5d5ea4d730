//! Random runs of the state-based estimator on random plants: what changes in the plant, what fails of the sensors,
//! and what it costs over being told the faults and over no fault tolerance.
#![allow(dead_code, missing_docs)]

use crate::random_plants::{self, NOISE, RandomNumbers};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::TruePlant;
use ftc_plant::deviation::{Deviation, Load, Port, Told};
use ftc_plant::scenario::{FaultEvent, FaultKind, ModeInterval, NEVER, first_tick};
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run};

const PLANTS: usize = 40;
/// Runs of each kind on each plant.
const RUNS: usize = 4;
const STEPS: u64 = 900;
/// When the plant changes.
const CHANGE: u64 = 300;
/// Mean squared error without fault tolerance, of outputs with the nominal value 1, beyond which a changed plant is no
/// longer governed.
const LOST: f64 = 100.0;

/// What may happen to the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    InputGain,
    InputLoad,
    DisturbanceStep,
    StateLoad,
    Matrices,
    WrongMode,
    Late,
}

impl Change {
    pub const ALL: [Self; 7] = [
        Self::InputGain,
        Self::InputLoad,
        Self::DisturbanceStep,
        Self::StateLoad,
        Self::Matrices,
        Self::WrongMode,
        Self::Late,
    ];
    /// Those that leave mode and timing of the readings right.
    pub const LOADS: [Self; 5] = [
        Self::InputGain,
        Self::InputLoad,
        Self::DisturbanceStep,
        Self::StateLoad,
        Self::Matrices,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::InputGain => "gain of an input 0.7 to 1.15",
            Self::InputLoad => "load on an input",
            Self::DisturbanceStep => "step of the disturbance",
            Self::StateLoad => "load on all states",
            Self::Matrices => "matrices off by 5 to 10 %",
            Self::WrongMode => "wrong mode told for 50 samples",
            Self::Late => "readings one sample late",
        }
    }
}

/// What may happen to a sensor, or two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    Bias,
    AtSwitch,
    Several,
    Dropout,
    GainLoss,
    Intermittent,
    Stuck,
    Drift,
}

impl Fault {
    /// Seen in the first samples.
    pub const ABRUPT: [Self; 6] = [
        Self::Bias,
        Self::AtSwitch,
        Self::Several,
        Self::Dropout,
        Self::GainLoss,
        Self::Intermittent,
    ];
    /// The others.
    pub const SLOW: [Self; 2] = [Self::Stuck, Self::Drift];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::AtSwitch => "bias that begins with a switch",
            Self::Several => "bias of two sensors at once",
            Self::Dropout => "dropout",
            Self::GainLoss => "gain loss",
            Self::Intermittent => "intermittent bias",
            Self::Stuck => "stuck",
            Self::Drift => "drift",
        }
    }
}

/// The true plant, what happens to it and to the sensors.
struct Case {
    truth: TruePlant,
    deviation: Deviation,
    events: Vec<FaultEvent>,
    schedule: Vec<ModeInterval>,
}

/// Mean squared error of the true outputs with fault tolerance, over told and over none.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    pub told: f64,
    pub none: f64,
}

/// The plants, and the numbers that the runs are drawn from.
pub struct Bench {
    plants: Vec<(Design, Controller)>,
    random: RandomNumbers,
}

impl Bench {
    pub fn seeded(seed: u64) -> Self {
        let mut random = RandomNumbers::seeded(seed);
        let draw = |_| {
            let design = random_plants::with_several_sensors(&mut random);
            let controller = Controller::new(design.parameters()).unwrap();
            (design, controller)
        };
        Self {
            plants: (0..PLANTS).map(draw).collect(),
            random,
        }
    }

    /// Runs in which `change` and `fault` happen, where any. Those of a plant that is lost without any fault are left out.
    pub fn runs(&mut self, change: Option<Change>, fault: Option<Fault>) -> Vec<Cost> {
        let mut costs = Vec::new();
        for (design, controller) in &self.plants {
            for _ in 0..RUNS {
                let mut case = nominal(design, &mut self.random);
                if let Some(change) = change {
                    case.change(design, &mut self.random, change);
                }
                let lost = |none: f64| !none.is_finite() || none > LOST;
                if change.is_some() && lost(case.error(design, controller, Variant::NoFtc)) {
                    continue;
                }
                if let Some(fault) = fault {
                    case.fail(design, &mut self.random, fault);
                }
                costs.push(cost(design, controller, &case));
            }
        }
        costs
    }
}

/// The plant as designed, with modes of 20 to 60 or of 200 samples.
fn nominal(design: &Design, random: &mut RandomNumbers) -> Case {
    let [shortest, longest] = match random.unit() < 0.5 {
        true => [20, 60],
        false => [200, 200],
    };
    let te = design.plant.sample_time;
    let (mut now, mut mode, mut schedule) = (0, random.count(0, 1), Vec::new());
    while now < STEPS {
        let from = now as f64 * te;
        schedule.push(ModeInterval { from, mode });
        now += random.count(shortest, longest) as u64;
        mode = 1 - mode;
    }
    Case {
        truth: TruePlant::AsDesigned,
        deviation: Deviation::default(),
        events: Vec::new(),
        schedule,
    }
}

fn signed(random: &mut RandomNumbers, size: f64) -> f64 {
    if random.unit() < 0.5 { -size } else { size }
}

impl Case {
    fn change(&mut self, design: &Design, random: &mut RandomNumbers, change: Change) {
        let (te, dims) = (design.plant.sample_time, design.plant.dimensions());
        let seconds = |tick: u64| tick as f64 * te;
        let load = |at, size| Load {
            at,
            from: seconds(CHANGE),
            until: NEVER,
            size,
        };
        match change {
            Change::InputGain => {
                let mut plant = design.plant.clone();
                let input = random.count(0, dims.inputs - 1);
                let factor = [0.9, 0.8, 0.7, 1.15][random.count(0, 3)];
                for mode in &mut plant.modes {
                    mode.b.column_mut(input).scale_mut(factor);
                }
                self.truth = TruePlant::Linear { plant };
            }
            Change::InputLoad => {
                let at = Port::Input(random.count(0, dims.inputs - 1));
                let size = random.between(0.05, 0.3);
                self.deviation.loads.push(load(at, signed(random, size)));
            }
            Change::DisturbanceStep => {
                let size = random.between(0.05, 0.3);
                let step = load(Port::Disturbance(0), signed(random, size));
                self.deviation.loads.push(step);
            }
            Change::StateLoad => {
                let on = |state| load(Port::State(state), random.between(-0.1, 0.1));
                self.deviation.loads.extend((0..dims.states).map(on));
            }
            Change::Matrices => {
                let error = random.between(0.05, 0.1);
                let seed = random.count(0, 1 << 30) as u64;
                let plant = design.plant.perturbed(error, seed);
                self.truth = TruePlant::Linear { plant };
            }
            Change::WrongMode => {
                self.schedule = vec![ModeInterval { from: 0.0, mode: 0 }];
                self.deviation.told = vec![Told {
                    from: seconds(CHANGE),
                    until: seconds(CHANGE + 50),
                    mode: 1,
                }];
            }
            Change::Late => self.deviation.sensor_delay = 1,
        }
    }

    /// From 12 to 100 deviations of the noise, for 50 to 300 samples; of ten faults one is there from the start.
    fn fail(&mut self, design: &Design, random: &mut RandomNumbers, fault: Fault) {
        let (te, p) = (design.plant.sample_time, design.plant.dimensions().outputs);
        let mut from = match random.unit() < 0.1 {
            true => 0,
            false => random.count(0, 500) as u64,
        };
        if fault == Fault::AtSwitch {
            let switch = random.count(1, 3).min(self.schedule.len() - 1);
            from = first_tick(self.schedule[switch].from, te);
        }
        let until = from + random.count(50, 300) as u64;
        let first = random.count(0, p - 1);
        let count = if fault == Fault::Several { 2 } else { 1 };
        for sensor in (first..first + count).map(|sensor| sensor % p) {
            let size = NOISE * 12.0 * (100.0f64 / 12.0).powf(random.unit());
            let size = signed(random, size);
            let kind = match fault {
                Fault::Bias | Fault::AtSwitch | Fault::Several => FaultKind::Bias { size },
                Fault::Dropout => FaultKind::Dropout,
                Fault::GainLoss => FaultKind::GainLoss {
                    loss: random.between(0.2, 0.9),
                },
                Fault::Intermittent => FaultKind::Intermittent {
                    size,
                    period: random.between(8.0, 80.0) * te,
                },
                Fault::Stuck => FaultKind::Stuck,
                Fault::Drift => FaultKind::Drift {
                    slope: size / (100.0 * te),
                },
            };
            self.events.push(FaultEvent {
                sensor,
                from: from as f64 * te,
                until: until as f64 * te,
                kind,
            });
        }
    }

    fn simulate(&self, design: &Design, controller: &Controller, variant: Variant) -> Trajectory {
        let mut scenario = design.scenario.clone();
        scenario.steps = STEPS;
        scenario.schedule.clone_from(&self.schedule);
        scenario.events.clone_from(&self.events);
        let truth = self.truth.clone().with_deviation(self.deviation.clone());
        let plant = PlantSimulator::with_true_plant(design.plant.clone(), truth, scenario);
        run(&plant, controller, variant)
    }

    fn error(&self, design: &Design, controller: &Controller, variant: Variant) -> f64 {
        let run = self.simulate(design, controller, variant);
        let merits = run.merits(&design.controller.feedback.tracked);
        merits.iter().map(|merit| merit.true_output.mse).sum()
    }
}

fn cost(design: &Design, controller: &Controller, case: &Case) -> Cost {
    let variants = [Variant::Ftc, Variant::ToldTheFault, Variant::NoFtc];
    let [ftc, told, none] = variants.map(|variant| case.error(design, controller, variant));
    // Beyond all numbers is the worst, whatever the others do.
    let over = |other: f64| match ftc.is_finite() {
        true => ftc / other,
        false => f64::INFINITY,
    };
    Cost {
        told: over(told),
        none: over(none),
    }
}

/// The value that so large a `share` of the `values` does not exceed.
pub fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[((values.len() as f64 * share) as usize).min(values.len() - 1)]
}
