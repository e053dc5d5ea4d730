//! How quickly faults are found, how often healthy sensors are accused, and whether the right one is:
//! 200 random faults on 20 random plants, seeded, printed as tables.
#![allow(missing_docs)]

use ftc::control::Controller;
use ftc::control::parameters::{Compensation, EstimatorMethod};
use ftc::design::assembly::{
    DatabaseSource, EstimatorSpec, KnownDisturbance, Request, Threshold, assemble,
};
use ftc::design::{ControlSpec, Design, Lyapunov, ObserverChoice, ObserverSpec, Signal, Signals};
use ftc::plant::{Mode, OperatingPoint, SwitchedPlant, spectral_radius};
use ftc::simulate::scenario::{FaultEvent, FaultKind, ModeInterval, Waveform};
use ftc::simulate::{PlantSimulator, Scenario, Variant, run};
use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const PLANTS: usize = 20;
const FAULTS_PER_PLANT: usize = 10;
const HEALTHY_STEPS: u64 = 50_000;
const NOISE: f64 = 0.003;

struct Dice(ChaCha8Rng);

impl Dice {
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    fn count(&mut self, low: usize, high: usize) -> usize {
        low + (self.unit() * (high - low + 1) as f64) as usize
    }
    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.between(-1.0, 1.0))
    }
}

fn mode(dice: &mut Dice, n: usize, m: usize, p: usize, output: &DMatrix<f64>) -> Mode {
    let a = dice.matrix(n, n);
    let radius = spectral_radius(&a).max(1e-3);
    Mode {
        name: "random".into(),
        a: a * (dice.between(0.3, 0.85) / radius),
        b: dice.matrix(n, m),
        c: output.clone(),
        e: dice.matrix(n, 1) * 0.3,
        f: DMatrix::zeros(p, 1),
        operating_point: OperatingPoint::zero(n, m, p),
    }
}

fn signals(name: &str, count: usize) -> Vec<Signal> {
    let signal = |i| Signal {
        name: format!("{name}[{i}]"),
        unit: None,
        nominal: 1.0,
        min: None,
        max: None,
    };
    (1..=count).map(signal).collect()
}

/// A random plant with a certified design; draws until one exists.
fn design(dice: &mut Dice) -> Design {
    loop {
        let (n, m, p) = (dice.count(1, 5), dice.count(1, 3), dice.count(1, 3));
        let output = dice.matrix(p, n);
        let plant = SwitchedPlant {
            sample_time: dice.between(0.01, 1.0),
            modes: (0..2).map(|_| mode(dice, n, m, p, &output)).collect(),
        };
        let dims = plant.dimensions();
        let r = p.min(m).min(n);
        let control = ControlSpec {
            tracked: (0..r).collect(),
            lyapunov: Lyapunov::Dwell,
            decay: 0.95,
            output_weight: vec![1.0; r],
            integral_weight: vec![0.3 / plant.sample_time; r],
            input_weight: vec![0.3; m],
            ..ControlSpec::new(dims)
        };
        let period = dice.between(40.0, 300.0) * plant.sample_time;
        let scenario = Scenario {
            steps: HEALTHY_STEPS,
            noise: vec![NOISE; p],
            seed: dice.0.next_u64(),
            schedule: vec![ModeInterval { from: 0.0, mode: 0 }],
            reference: (0..r)
                .map(|_| Waveform::Square {
                    amplitude: dice.between(0.2, 0.8),
                    period: 400.0 * plant.sample_time,
                    offset: 0.0,
                })
                .collect(),
            fault: vec![Waveform::ZERO; p],
            events: vec![],
            disturbance: vec![Waveform::Sine {
                amplitude: 0.05,
                period,
                phase: 0.0,
                offset: 0.0,
            }],
        };
        let request = Request {
            name: "random".into(),
            signals: Signals {
                inputs: signals("u", m),
                outputs: signals("y", p),
                states: signals("x", n),
            },
            plant,
            control,
            bumpless: false,
            observer: ObserverSpec {
                kind: ObserverChoice::Auto,
                decay: 0.9,
                lyapunov: Lyapunov::Dwell,
            },
            estimator: EstimatorSpec {
                method: EstimatorMethod::Reference,
                response_length: None,
                database: DatabaseSource::Commission,
                threshold: Threshold::Sigmas(6.0),
                debounce: 1,
                adapt: false,
                disturbance: Some(KnownDisturbance {
                    period,
                    harmonics: 1,
                    amplitude: Some(vec![0.05]),
                }),
            },
            compensation: Compensation::VirtualSensor,
            scenario,
        };
        if let Ok(design) = assemble(request) {
            return design;
        }
    }
}

/// Alternating modes, so that switches happen with and without a fault.
fn schedule(te: f64, steps: u64, every: u64) -> Vec<ModeInterval> {
    (0..steps / every)
        .map(|k| ModeInterval {
            from: (k * every) as f64 * te,
            mode: (k % 2) as usize,
        })
        .collect()
}

#[derive(Default)]
struct Tally {
    healthy_samples: u64,
    false_alarms: u64,
    /// Per kind: name, faults, found, sum and worst of delays, others accused.
    kinds: Vec<(String, u64, u64, u64, u64, u64)>,
    /// `isolation[faulty][accused]`: samples.
    isolation: [[u64; 3]; 3],
    faulty_samples: [u64; 3],
}

fn healthy(design: &Design, tally: &mut Tally) {
    let te = design.controller.plant.sample_time;
    let mut scenario = design.scenario.clone();
    scenario.schedule = schedule(te, scenario.steps, 5_000);
    let plant = PlantSimulator::new(design.controller.plant.clone(), scenario);
    let trajectory = run(
        &plant,
        &Controller::new(design.controller.clone()),
        Variant::Ftc,
    );
    tally.healthy_samples += trajectory.records.len() as u64;
    tally.false_alarms += trajectory
        .records
        .iter()
        .filter(|r| r.flagged.contains(&true))
        .count() as u64;
}

fn kind(dice: &mut Dice, index: usize, te: f64, threshold: f64) -> (&'static str, FaultKind) {
    let size = threshold * dice.between(3.0, 20.0);
    match index % 5 {
        0 => ("bias", FaultKind::Bias { size }),
        1 => (
            "drift",
            FaultKind::Drift {
                slope: size / (50.0 * te),
            },
        ),
        2 => (
            "intermittent",
            FaultKind::Intermittent {
                size,
                period: 40.0 * te,
            },
        ),
        3 => ("stuck", FaultKind::Stuck),
        _ => ("dropout", FaultKind::Dropout),
    }
}

fn faulty(design: &Design, dice: &mut Dice, index: usize, tally: &mut Tally) {
    let te = design.controller.plant.sample_time;
    let sensors = design.controller.estimator.thresholds.len();
    let sensor = dice.count(0, sensors - 1);
    let hold = design.controller.estimator.response_length as u64;
    let from = 2 * hold + 1000 + dice.count(0, 400) as u64;
    let until = from + 600;
    let mut scenario = design.scenario.clone();
    scenario.steps = until + 200;
    let (name, kind) = kind(
        dice,
        index,
        te,
        design.controller.estimator.thresholds[sensor],
    );
    scenario.events = vec![FaultEvent {
        sensor,
        from: from as f64 * te,
        until: until as f64 * te,
        kind,
    }];
    let plant = PlantSimulator::new(design.controller.plant.clone(), scenario);
    let trajectory = run(
        &plant,
        &Controller::new(design.controller.clone()),
        Variant::Ftc,
    );
    let window = &trajectory.records[from as usize..until as usize];
    let delay = window.iter().position(|r| r.flagged[sensor]);
    let accused = window
        .iter()
        .filter(|r| r.flagged.iter().enumerate().any(|(s, &f)| f && s != sensor))
        .count() as u64;
    for record in window {
        tally.faulty_samples[sensor] += 1;
        for (s, &flag) in record.flagged.iter().enumerate() {
            tally.isolation[sensor][s] += u64::from(flag);
        }
    }
    let entry = match tally.kinds.iter_mut().find(|k| k.0 == name) {
        Some(entry) => entry,
        None => {
            tally.kinds.push((name.into(), 0, 0, 0, 0, 0));
            tally.kinds.last_mut().expect("just pushed")
        }
    };
    entry.1 += 1;
    entry.5 += accused;
    if let Some(delay) = delay {
        entry.2 += 1;
        entry.3 += delay as u64;
        entry.4 = entry.4.max(delay as u64);
    }
}

fn main() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(2026));
    let mut tally = Tally::default();
    for plant in 0..PLANTS {
        let design = design(&mut dice);
        healthy(&design, &mut tally);
        for fault in 0..FAULTS_PER_PLANT {
            faulty(&design, &mut dice, plant + fault, &mut tally);
        }
    }
    println!(
        "## Detection: {PLANTS} random plants, {} random faults, 6 sigma\n",
        PLANTS * FAULTS_PER_PLANT
    );
    println!(
        "False alarms: {} in {} healthy samples.\n",
        tally.false_alarms, tally.healthy_samples
    );
    println!(
        "| fault | drawn | found | mean delay (samples) | worst delay | samples in which another sensor was accused |"
    );
    println!("|---|---|---|---|---|---|");
    for (name, drawn, found, sum, worst, accused) in &tally.kinds {
        println!(
            "| {name} | {drawn} | {found} | {:.1} | {worst} | {accused} |",
            *sum as f64 / (*found).max(1) as f64
        );
    }
    println!(
        "\nIsolation: share of the faulty samples in which each sensor was declared faulty.\n"
    );
    println!("| faulty sensor | 1 | 2 | 3 |\n|---|---|---|---|");
    for (sensor, row) in tally.isolation.iter().enumerate() {
        let share = |s: usize| 100.0 * row[s] as f64 / tally.faulty_samples[sensor].max(1) as f64;
        println!(
            "| {} | {:.1} % | {:.1} % | {:.1} % |",
            sensor + 1,
            share(0),
            share(1),
            share(2)
        );
    }
}
