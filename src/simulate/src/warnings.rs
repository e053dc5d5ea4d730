//! What a user should know of a run that went through: values; the program that shows them adds the words.

use crate::Variant;
use crate::closed_loop::Record;
use ftc_control::estimator::InputHistory;
use ftc_control::parameters::{Estimator, EstimatorMethod};
use ftc_plant::TruePlant;
use ftc_plant::deviation::Destabilised;
use ftc_record::DesignRecord;

/// Share of the samples of a run that may lie outside the database without a warning.
const SHARE_OUTSIDE: f64 = 0.05;
/// Share of the samples of a run that may be spent waiting after mode switches without a warning.
const SHARE_UNJUDGED: f64 = 0.25;

/// Share of the samples of a run in which an input may be at a limit without a warning.
const SHARE_SATURATED: f64 = 0.05;
/// Share of the samples of a run in which a fault estimate may stand at its largest size without a warning.
const SHARE_CAPPED: f64 = 0.01;
/// A fault is large where it exceeds so many thresholds of its sensor.
const LARGE_FAULT: f64 = 3.0;
/// Share of the samples that may have a large fault before it is looked at.
const SHARE_FAULTY: f64 = 0.01;
/// Share of the samples with a large fault in which it may go unnoticed without a warning.
const SHARE_UNNOTICED: f64 = 0.5;
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
    /// A sensor was used as it was in most samples of a large fault.
    Unnoticed {
        /// The sensor, from 0.
        sensor: usize,
        /// Share of the samples with a large fault in which it was missed, 0 to 1.
        share: f64,
        /// The largest fault that was missed, in physical units.
        largest: f64,
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

/// What a run's warnings rest on, gathered sample by sample.
#[derive(Debug)]
pub struct RunWatch<'a> {
    design: &'a DesignRecord,
    variant: Variant,
    samples: usize,
    /// Samples in which each input is at a limit.
    saturated: Vec<usize>,
    /// Samples in which the estimate of each sensor's fault stands at its largest size.
    capped: Vec<usize>,
    /// What came of each sensor's large faults.
    large: Vec<LargeFault>,
    held: Held,
    /// What lay outside the healthy database.
    outside: OutsideDatabase<'a>,
    diodes: Option<DiodesConduct>,
}

impl<'a> RunWatch<'a> {
    /// Nothing seen yet.
    pub fn new(design: &'a DesignRecord, variant: Variant) -> Self {
        let diodes = match design.true_plant.clone().into_parts() {
            (TruePlant::Rectifier(rectifier), _) => Some(rectifier.diode_voltage()),
            _ => None,
        };
        Self {
            design,
            variant,
            samples: 0,
            saturated: vec![0; design.signals.inputs.len()],
            capped: vec![0; design.controller.estimator.authority().len()],
            large: vec![LargeFault::default(); design.signals.outputs.len()],
            held: Held::default(),
            outside: OutsideDatabase::new(design),
            diodes: diodes.map(DiodesConduct::new),
        }
    }

    /// Looks at a sample.
    pub fn see(&mut self, record: &Record) {
        self.samples += 1;
        if let Some(diodes) = &mut self.diodes {
            diodes.see(record);
        }
        if self.variant != Variant::Ftc {
            return;
        }
        let limits = self.design.signals.inputs.iter().zip(&record.u);
        for (count, (limit, &u)) in self.saturated.iter_mut().zip(limits) {
            *count += usize::from(Some(u) == limit.min || Some(u) == limit.max);
        }
        let sizes = self.design.controller.estimator.authority().iter();
        for (count, (&size, fault)) in self.capped.iter_mut().zip(sizes.zip(&record.f_hat)) {
            *count += usize::from(fault.abs() >= size);
        }
        let thresholds = &self.design.controller.estimator.thresholds;
        for (sensor, (large, &threshold)) in self.large.iter_mut().zip(thresholds).enumerate() {
            large.see(record, sensor, threshold);
        }
        self.held
            .see(&self.design.controller.estimator, record.mode);
        self.outside.see(record);
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.samples.max(1) as f64
    }
}

/// All warnings of the runs of a design; each with the first tick it could not be integrated through.
/// `command_noise` is the standard deviation of each command (m) in each mode, where it is known.
pub fn of_runs(
    design: &DesignRecord,
    command_noise: &[Vec<f64>],
    runs: &[(RunWatch<'_>, Option<u64>)],
) -> Vec<RunWarning> {
    let ftc = || {
        runs.iter()
            .map(|(run, _)| run)
            .filter(|run| run.variant == Variant::Ftc)
    };
    let stopped = runs.iter().filter_map(|(run, stalled)| {
        Some(RunWarning::Stopped {
            variant: run.variant,
            time: (*stalled)? as f64 * design.plant.sample_time,
        })
    });
    let diodes = runs.iter().filter_map(|(run, _)| diodes_conduct(run));
    unstable(design)
        .chain(ftc().flat_map(unjudged))
        .chain(ftc().flat_map(saturated))
        .chain(ftc().flat_map(capped))
        .chain(ftc().flat_map(unnoticed))
        .chain(noisy_commands(design, command_noise))
        .chain(stopped)
        .chain(diodes)
        .collect()
}

/// Modes that the true plant's own matrices make unstable.
fn unstable(design: &DesignRecord) -> impl Iterator<Item = RunWarning> {
    let lost = design.true_plant.linear(&design.plant);
    let lost = lost.destabilised(&design.plant);
    lost.into_iter().map(RunWarning::UnstablePlant)
}

/// Inputs that spend many samples of a run at a limit.
fn saturated(run: &RunWatch<'_>) -> Vec<RunWarning> {
    let shares = run.saturated.iter().map(|&count| run.share(count));
    shares
        .enumerate()
        .filter(|(_, share)| *share > SHARE_SATURATED)
        .map(|(input, share)| RunWarning::Saturated { input, share })
        .collect()
}

/// Sensors whose fault estimate stands at its largest size in many samples of a run.
fn capped(run: &RunWatch<'_>) -> Vec<RunWarning> {
    let sizes = run.design.controller.estimator.authority().iter();
    let sensors = run.capped.iter().zip(sizes).enumerate();
    sensors
        .map(|(sensor, (&count, &size))| (sensor, run.share(count), size))
        .filter(|(_, share, _)| *share > SHARE_CAPPED)
        .map(|(sensor, share, size)| RunWarning::Capped {
            sensor,
            share,
            size,
        })
        .collect()
}

/// Sensors whose large faults were missed in most samples.
fn unnoticed(run: &RunWatch<'_>) -> Vec<RunWarning> {
    let without = run.design.controller.estimator.method == EstimatorMethod::None;
    // What could not be judged is told already.
    if without || !unjudged(run).is_empty() {
        return Vec::new();
    }
    let sensors = run.large.iter().enumerate();
    sensors
        .filter(|(_, large)| run.share(large.samples) > SHARE_FAULTY)
        .map(|(sensor, large)| (sensor, large, large.missed as f64 / large.samples as f64))
        .filter(|&(_, _, share)| share > SHARE_UNNOTICED)
        .map(|(sensor, large, share)| RunWarning::Unnoticed {
            sensor,
            share,
            largest: large.largest,
        })
        .collect()
}

/// What came of a sensor's large faults.
#[derive(Clone, Copy, Debug, Default)]
struct LargeFault {
    /// Samples with one.
    samples: usize,
    /// Those in which it was missed.
    missed: usize,
    /// The largest that was missed.
    largest: f64,
}

impl LargeFault {
    fn see(&mut self, record: &Record, sensor: usize, threshold: f64) {
        let fault = record.fault[sensor].abs();
        if !(fault.is_finite() && fault > LARGE_FAULT * threshold) {
            return;
        }
        self.samples += 1;
        if !record.flagged[sensor] {
            self.missed += 1;
            self.largest = self.largest.max(fault);
        }
    }
}

/// Commands that the noise of the sensors moves by a large part of their range (or nominal value).
fn noisy_commands(design: &DesignRecord, noise: &[Vec<f64>]) -> Vec<RunWarning> {
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
fn unjudged(run: &RunWatch<'_>) -> Vec<RunWarning> {
    let estimator = &run.design.controller.estimator;
    let (held, outside) = (run.share(run.held.samples), run.share(run.outside.samples));
    let mut warnings = Vec::new();
    if estimator.method != EstimatorMethod::None && held > SHARE_UNJUDGED {
        warnings.push(RunWarning::Unjudged {
            share: held,
            response_length: estimator.response_length,
        });
    }
    if outside > SHARE_OUTSIDE {
        warnings.push(RunWarning::OutsideTheDatabase {
            share: outside,
            widening: run.outside.widening,
        });
    }
    warnings
}

/// Samples after the start or a switch in which the regressor does not hold one mode only.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    samples: usize,
    mode: Option<usize>,
    /// Samples of the present visit.
    visit: usize,
}

impl Held {
    fn see(&mut self, estimator: &Estimator, mode: usize) {
        if self.mode != Some(mode) {
            (self.mode, self.visit) = (Some(mode), 0);
        }
        self.visit += 1;
        self.samples += usize::from(self.visit <= estimator.response_length);
    }
}

/// What of a run lay outside the healthy database: the regressor of its inputs is formed once more.
#[derive(Debug)]
struct OutsideDatabase<'a> {
    design: &'a DesignRecord,
    /// The inputs so far and the last command; none before the first sample.
    inputs: Option<(InputHistory, Vec<f64>)>,
    /// How many samples.
    samples: usize,
    /// The most by which it opened thresholds.
    widening: f64,
}

impl<'a> OutsideDatabase<'a> {
    fn new(design: &'a DesignRecord) -> Self {
        Self {
            design,
            inputs: None,
            samples: 0,
            widening: 1.0,
        }
    }

    fn see(&mut self, record: &Record) {
        let controller = &self.design.controller;
        let (estimator, modes) = (&controller.estimator, &self.design.plant.modes);
        if estimator.predictors.is_empty() {
            return;
        }
        let (history, before) = self.inputs.get_or_insert_with(|| {
            let start = &modes[record.mode].operating_point.u;
            let history = InputHistory::new(start, estimator.response_length);
            (history, start.clone())
        });
        if let Some(predictor) = estimator.predictors.get(record.mode) {
            history.regress(&modes[record.mode].operating_point.u);
            let leverage = history.leverage(&predictor.factor);
            self.samples += usize::from(leverage > estimator.leverage_limit);
            self.widening = self.widening.max((1.0 + leverage).sqrt());
        }
        let delayed = controller.feedback.latency > 0;
        history.push(if delayed { before } else { &record.u });
        before.clone_from(&record.u);
    }
}

/// When a rectifier left the region in which it is the plant of the design.
#[derive(Clone, Copy, Debug)]
struct DiodesConduct {
    voltage: f64,
    first: Option<u64>,
    samples: usize,
}

impl DiodesConduct {
    fn new(voltage: f64) -> Self {
        Self {
            voltage,
            first: None,
            samples: 0,
        }
    }

    fn see(&mut self, record: &Record) {
        if record.x[2] < self.voltage {
            self.first = self.first.or(Some(record.tick));
            self.samples += 1;
        }
    }
}

fn diodes_conduct(run: &RunWatch<'_>) -> Option<RunWarning> {
    let diodes = run.diodes?;
    Some(RunWarning::DiodesConduct {
        variant: run.variant,
        voltage: diodes.voltage,
        time: diodes.first? as f64 * run.design.plant.sample_time,
        share: run.share(diodes.samples),
    })
}
