//! What happens in one run: a pure function of the design, the options and the number of the run.

use crate::Options;
use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use ftc_design::Design;
use ftc_plant::scenario::{FaultEvent, FaultKind, FaultName, ModeInterval, Scenario, Waveform};
use ftc_plant::{SwitchedPlant, TruePlant};
use nalgebra::DMatrix;

/// Share of a run after which the first and before which the last fault begins.
const ONSET: [f64; 2] = [0.1, 0.8];
/// Shortest and longest fault, as a share of the run.
const DURATION: [f64; 2] = [0.05, 0.5];
/// Noise, relative to the scenario's.
const NOISE: [f64; 2] = [0.5, 2.0];
/// Share of a reading that is lost.
const LOSS: [f64; 2] = [0.05, 0.9];
/// Period of an intermittent fault in samples.
const PERIOD: [f64; 2] = [4.0, 80.0];
/// The most levels of a reference, and the most switches between modes.
const MOST_LEVELS: u64 = 5;
const MOST_SWITCHES: u64 = 4;
/// How long a mode lasts at least, as a share of the run, where the scenario does not switch.
const SHORTEST_MODE: f64 = 0.1;

/// What happens in one run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Drawn {
    /// The experiment.
    pub scenario: Scenario,
    /// The true plant.
    pub true_plant: TruePlant,
    /// Largest relative error of an entry of `A`, `B` or `E`.
    pub model_error: f64,
    /// Noise, relative to the design's scenario.
    pub noise: f64,
}

/// Uniform numbers from the stream of one run.
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64, run: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(run);
        Self(generator)
    }

    /// In `[0, 1)`.
    fn share(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.share()
    }

    /// Equally likely in each ratio.
    fn ratio(&mut self, [low, high]: [f64; 2]) -> f64 {
        low * libm::exp(self.share() * libm::log(high / low))
    }

    /// A whole number below `count`.
    fn below(&mut self, count: u64) -> u64 {
        (self.share() * count as f64) as u64
    }

    fn sign(&mut self) -> f64 {
        if self.share() < 0.5 { -1.0 } else { 1.0 }
    }
}

/// What happens in run number `run`.
pub fn draw(design: &Design, options: &Options, run: u64) -> Drawn {
    let options = &options.for_design(design);
    let mut draws = Draws::new(options.seed, run);
    let base = &design.scenario;
    let schedule = schedule(design, &mut draws);
    let reference = (0..base.reference.len())
        .map(|index| reference(design, index, &mut draws))
        .collect();
    let disturbance = base
        .disturbance
        .iter()
        .map(|signal| disturbance(signal, &mut draws))
        .collect();
    let noise = draws.ratio(NOISE);
    let model_error = draws.share() * options.model_error;
    let true_plant = true_plant(design, model_error, &mut draws);
    let faults = draws.below(u64::from(options.most_faults) + 1);
    let events = (0..faults)
        .map(|_| fault(design, options, &mut draws))
        .collect();
    let mut scenario = base.clone();
    for deviation in &mut scenario.noise {
        *deviation *= noise;
    }
    scenario.seed = draws.0.next_u64();
    scenario.schedule = schedule;
    scenario.reference = reference;
    scenario.fault.fill(Waveform::ZERO);
    scenario.events = events;
    scenario.disturbance = disturbance;
    Drawn {
        scenario,
        true_plant,
        model_error,
        noise,
    }
}

/// Length of a run in seconds.
fn length(design: &Design) -> f64 {
    design.scenario.steps as f64 * design.plant.sample_time
}

/// Random modes, each for at least as long as the shortest in the design's own schedule.
fn schedule(design: &Design, draws: &mut Draws) -> Vec<ModeInterval> {
    let modes = design.plant.modes.len() as u64;
    let whole = length(design);
    let own = design.scenario.schedule.windows(2);
    let shortest = own
        .map(|pair| pair[1].from - pair[0].from)
        .fold(f64::INFINITY, f64::min);
    let shortest = match shortest.is_finite() {
        true => shortest.min(whole / 2.0),
        false => SHORTEST_MODE * whole,
    };
    let mut schedule = vec![ModeInterval {
        from: 0.0,
        mode: draws.below(modes) as usize,
    }];
    let switches = if modes > 1 {
        draws.below(MOST_SWITCHES + 1)
    } else {
        0
    };
    let mut now = 0.0;
    for _ in 0..switches {
        now += shortest * (1.0 + draws.share());
        let step = 1 + draws.below(modes - 1);
        if now < whole {
            let last = schedule.last().map_or(0, |interval| interval.mode) as u64;
            schedule.push(ModeInterval {
                from: now,
                mode: ((last + step) % modes) as usize,
            });
        }
    }
    schedule
}

/// Random levels within what the scenario asks of this output, at random times.
fn reference(design: &Design, index: usize, draws: &mut Draws) -> Waveform {
    let te = design.plant.sample_time;
    let signal = &design.scenario.reference[index];
    let [low, high] = signal.range(design.scenario.steps, te);
    let whole = length(design);
    let count = 1 + draws.below(MOST_LEVELS);
    let points = (0..count)
        .map(|level| {
            let share =
                (level as f64 + if level == 0 { 0.0 } else { draws.share() }) / count as f64;
            [share * whole, draws.between([low, high])]
        })
        .collect();
    Waveform::Steps { points }
}

/// A sine of the scenario with another phase and amplitude; any other signal as it is.
fn disturbance(signal: &Waveform, draws: &mut Draws) -> Waveform {
    match signal {
        Waveform::Sine {
            amplitude,
            period,
            offset,
            ..
        } => Waveform::Sine {
            amplitude: amplitude * draws.share(),
            period: *period,
            phase: core::f64::consts::TAU * draws.share(),
            offset: *offset,
        },
        other => other.clone(),
    }
}

/// Every entry of `A`, `B` and `E` off by a random part of `error`; a nonlinear plant stays what it is, and
/// so does whatever else the true plant departs by.
fn true_plant(design: &Design, error: f64, draws: &mut Draws) -> TruePlant {
    let (motion, deviation) = design.true_plant.clone().into_parts();
    let nominal = match motion {
        TruePlant::AsDesigned => design.plant.clone(),
        TruePlant::Linear { plant } => plant,
        other => return other.with_deviation(deviation),
    };
    let mut off = |matrix: &DMatrix<f64>| {
        matrix.map(|entry| entry * (1.0 + error * draws.between([-1.0, 1.0])))
    };
    let modes = nominal
        .modes
        .iter()
        .map(|mode| {
            let mut mode = mode.clone();
            mode.a = off(&mode.a);
            mode.b = off(&mode.b);
            mode.e = off(&mode.e);
            mode
        })
        .collect();
    TruePlant::Linear {
        plant: SwitchedPlant::new(nominal.sample_time, modes),
    }
    .with_deviation(deviation)
}

fn fault(design: &Design, options: &Options, draws: &mut Draws) -> FaultEvent {
    let (whole, te) = (length(design), design.plant.sample_time);
    let sensors = design.signals.outputs.len() as u64;
    let sensor = draws.below(sensors) as usize;
    let from = whole * draws.between(ONSET);
    let duration = whole * draws.ratio(DURATION);
    let threshold = design.controller.estimator.thresholds.get(sensor);
    let size = draws.sign() * draws.ratio([1.0, options.largest_fault.max(1.0 + 1e-9)]);
    let size = size * threshold.copied().unwrap_or(1.0);
    let kinds = FaultName::ALL;
    let kind = match kinds[draws.below(kinds.len() as u64) as usize] {
        FaultName::Bias => FaultKind::Bias { size },
        FaultName::Drift => FaultKind::Drift {
            slope: size / duration,
        },
        FaultName::GainLoss => FaultKind::GainLoss {
            loss: draws.between(LOSS),
        },
        FaultName::Stuck => FaultKind::Stuck,
        FaultName::Intermittent => FaultKind::Intermittent {
            size,
            period: te * draws.ratio(PERIOD),
        },
        FaultName::Dropout => FaultKind::Dropout,
    };
    FaultEvent {
        sensor,
        from,
        until: from + duration,
        kind,
    }
}
