//! What a user should know of a run that went through: values; the program that shows them adds the words.

use crate::closed_loop::Record;
use crate::{Trajectory, Variant};
use ftc_control::estimator::InputHistory;
use ftc_control::parameters::{Estimator, EstimatorMethod};
use ftc_design::Design;
use ftc_plant::TruePlant;
use ftc_plant::deviation::Destabilised;

/// Share of the samples of a run that may lie outside the database without a warning.
const SHARE_OUTSIDE: f64 = 0.05;
/// Share of the samples of a run that may be spent waiting after mode switches without a warning.
const SHARE_UNJUDGED: f64 = 0.25;

/// Share of the samples of a run in which an input may be at a limit without a warning.
const SHARE_SATURATED: f64 = 0.05;
/// Share of the samples of a run in which a fault estimate may stand at its largest size without a warning.
const SHARE_CAPPED: f64 = 0.01;
/// Standard deviation of a command's noise, relative to its range, without a warning.
const COMMAND_NOISE: f64 = 0.1;

/// What limits the conclusions from one run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RunWarning {
    /// In this share of the samples no sensor was judged, since a mode had just been entered.
    Unjudged {
        /// Share of the samples, 0 to 1.
        share: f64,
        /// Response length `j` in samples.
        response_length: usize,
    },
    /// In this share of the samples the inputs lay outside what the healthy database spans.
    OutsideTheDatabase {
        /// Share of the samples, 0 to 1.
        share: f64,
        /// How many times thresholds were widened at most.
        widening: f64,
    },
    /// An input was at a limit for many samples, while what is proved holds only inside the limits.
    Saturated {
        /// The input, from 0.
        input: usize,
        /// Share of the samples, 0 to 1.
        share: f64,
    },
    /// The estimate of a sensor's fault stood at its largest size: the fault may be larger, and is then only
    /// partly taken out.
    Capped {
        /// The sensor, from 0.
        sensor: usize,
        /// Share of the samples, 0 to 1.
        share: f64,
        /// That size in physical units.
        size: f64,
    },
    /// The noise of the sensors alone moves a command by a large part of its range.
    NoisyCommand {
        /// The input, from 0.
        input: usize,
        /// Standard deviation in physical units.
        deviation: f64,
    },
    /// A mode of the true plant is unstable where the model's is not.
    UnstablePlant(Destabilised),
    /// The plant's equations could not be integrated further.
    Stopped {
        /// The run.
        variant: Variant,
        /// When, in seconds.
        time: f64,
    },
    /// The DC link of a rectifier fell to the voltage at which its diodes conduct.
    DiodesConduct {
        /// The run.
        variant: Variant,
        /// That voltage in V.
        voltage: f64,
        /// When first, in seconds.
        time: f64,
        /// In which share of the samples, 0 to 1.
        share: f64,
    },
}

/// All warnings of the runs of a design.
pub fn of_runs(design: &Design, runs: &[Trajectory]) -> Vec<RunWarning> {
    let ftc = runs.iter().find(|run| run.variant == Variant::Ftc);
    let unjudged = ftc.into_iter().flat_map(|run| unjudged(design, run));
    let stopped = runs.iter().filter_map(|run| stopped(design, run));
    let diodes = runs.iter().filter_map(|run| diodes_conduct(design, run));
    let saturated = ftc.into_iter().flat_map(|run| saturated(design, run));
    unstable(design)
        .chain(unjudged)
        .chain(saturated)
        .chain(ftc.into_iter().flat_map(|run| capped(design, run)))
        .chain(noisy_commands(design))
        .chain(stopped)
        .chain(diodes)
        .collect()
}

/// Modes that the true plant's own matrices make unstable.
fn unstable(design: &Design) -> impl Iterator<Item = RunWarning> {
    let lost = design.true_plant.linear(&design.plant);
    let lost = lost.destabilised(&design.plant);
    lost.into_iter().map(RunWarning::UnstablePlant)
}

/// Inputs that spend many samples of a run at a limit.
fn saturated(design: &Design, run: &Trajectory) -> Vec<RunWarning> {
    let samples = run.records.len().max(1) as f64;
    let limits = design.signals.inputs.iter().enumerate();
    let shares = limits.map(|(input, limit)| {
        let at_limit = |record: &&Record| {
            let u = Some(record.u[input]);
            u == limit.min || u == limit.max
        };
        (
            input,
            run.records.iter().filter(at_limit).count() as f64 / samples,
        )
    });
    shares
        .filter(|(_, share)| *share > SHARE_SATURATED)
        .map(|(input, share)| RunWarning::Saturated { input, share })
        .collect()
}

/// Sensors whose fault estimate stands at its largest size in many samples of a run.
fn capped<'a>(design: &'a Design, run: &'a Trajectory) -> impl Iterator<Item = RunWarning> + 'a {
    let samples = run.records.len().max(1) as f64;
    let limits = design.controller.estimator.authority().iter().enumerate();
    limits.filter_map(move |(sensor, &size)| {
        let at_limit = |record: &&Record| record.f_hat[sensor].abs() >= size;
        let share = run.records.iter().filter(at_limit).count() as f64 / samples;
        (share > SHARE_CAPPED).then_some(RunWarning::Capped {
            sensor,
            share,
            size,
        })
    })
}

/// Commands that the noise of the sensors moves by a large part of their range (or nominal value).
fn noisy_commands(design: &Design) -> Vec<RunWarning> {
    let Some(proof) = &design.proof else {
        return Vec::new();
    };
    let noise = &proof.running_loop.command_noise;
    let inputs = design.signals.inputs.iter().enumerate();
    let deviations = inputs.map(|(index, input)| {
        let range = input.min.zip(input.max);
        let range = range.map_or(input.nominal, |(min, max)| (max - min) / 2.0);
        let largest = noise.iter().map(|mode| mode[index]).fold(0.0, f64::max);
        (index, largest, range)
    });
    deviations
        .filter(|(_, deviation, range)| *deviation > COMMAND_NOISE * range)
        .map(|(input, deviation, _)| RunWarning::NoisyCommand { input, deviation })
        .collect()
}

/// How much of a run the estimator could not judge, and why.
fn unjudged(design: &Design, run: &Trajectory) -> Vec<RunWarning> {
    let estimator = &design.controller.estimator;
    let samples = run.records.len();
    let share = |count: usize| count as f64 / samples.max(1) as f64;
    let held = share(held(estimator, &run.records));
    let outside = OutsideDatabase::of(design, run);
    let mut warnings = Vec::new();
    if estimator.method != EstimatorMethod::None && held > SHARE_UNJUDGED {
        warnings.push(RunWarning::Unjudged {
            share: held,
            response_length: estimator.response_length,
        });
    }
    if share(outside.samples) > SHARE_OUTSIDE {
        warnings.push(RunWarning::OutsideTheDatabase {
            share: share(outside.samples),
            widening: outside.widening,
        });
    }
    warnings
}

/// Samples after the start or a switch in which the regressor does not hold one mode only.
fn held(estimator: &Estimator, records: &[Record]) -> usize {
    let visits = records.chunk_by(|one, next| one.mode == next.mode);
    visits
        .map(|visit| visit.len().min(estimator.response_length))
        .sum()
}

/// What of a run lay outside the healthy database.
struct OutsideDatabase {
    /// How many samples.
    samples: usize,
    /// The most by which it opened thresholds.
    widening: f64,
}

impl OutsideDatabase {
    /// Plays the inputs of a run once more.
    fn of(design: &Design, run: &Trajectory) -> Self {
        let controller = &design.controller;
        let (estimator, modes) = (&controller.estimator, &design.plant.modes);
        let mut outside = Self {
            samples: 0,
            widening: 1.0,
        };
        let Some(first) = run.records.first() else {
            return outside;
        };
        let start = &modes[first.mode].operating_point.u;
        let mut history = InputHistory::new(start, estimator.response_length);
        let mut before = start;
        for record in &run.records {
            if let Some(predictor) = estimator.predictors.get(record.mode) {
                history.regress(&modes[record.mode].operating_point.u);
                let leverage = history.leverage(&predictor.factor);
                outside.samples += usize::from(leverage > estimator.leverage_limit);
                outside.widening = outside.widening.max((1.0 + leverage).sqrt());
            }
            let delayed = controller.feedback.latency > 0;
            history.push(if delayed { before } else { &record.u });
            before = &record.u;
        }
        outside
    }
}

/// A run that ended in equations without a solution.
fn stopped(design: &Design, run: &Trajectory) -> Option<RunWarning> {
    Some(RunWarning::Stopped {
        variant: run.variant,
        time: run.stalled? as f64 * design.plant.sample_time,
    })
}

/// A rectifier that left the region in which it is the plant of the design.
fn diodes_conduct(design: &Design, run: &Trajectory) -> Option<RunWarning> {
    let (TruePlant::Rectifier(rectifier), _) = design.true_plant.clone().into_parts() else {
        return None;
    };
    let voltage = rectifier.diode_voltage();
    let below = |record: &&Record| record.x[2] < voltage;
    let first = run.records.iter().find(below)?;
    let count = run.records.iter().filter(below).count();
    Some(RunWarning::DiodesConduct {
        variant: run.variant,
        voltage,
        time: first.tick as f64 * design.plant.sample_time,
        share: count as f64 / run.records.len() as f64,
    })
}
