//! Whether the loop has the delay that it was designed for.
//!
//! A master may let a command act one sample later than designed, or one sooner. The readings then
//! follow the model under the command of another sample. So the observer is run beside itself, once
//! for each delay that is thought of, on the same readings; if the innovations `e` of a run are
//! independent and Gaussian with unknown variances, the logarithm of its likelihood over `N` samples
//! is `-N/2 sum_i ln(sum_k e_i(k)^2)` and a constant. The first samples in which the command moves
//! decide, once: after that, nothing is computed any more. A sensor fault is the same to all runs.

use super::kernel;
use super::observer::{ObservedMode, ObserverState};
use super::parameters::Observer;
use crate::matrix::Matrix;
use crate::tuning::DelayTuning;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A delay that the readings fit, other than the one designed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_enums, reason = "more or less")]
pub enum Delay {
    /// One sample more.
    Longer,
    /// One sample less.
    Shorter,
}

/// Runs of the observer under other delays.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct DelayWatch {
    /// As designed, one sample more, and one less where there is one to take away.
    runs: Vec<Run>,
    /// The command that acted over the last sample (m).
    acted: Vec<f64>,
    /// Sums of the squares of the readings (p).
    readings: Vec<f64>,
    /// The readings, bounded (p).
    y: Vec<f64>,
    /// Scratch (p).
    output: Vec<f64>,
    /// Samples that counted.
    samples: u32,
    /// Whether nothing is looked at any more.
    over: bool,
    found: Option<Delay>,
}

crate::state!(DelayWatch {
    parts: [runs, acted, readings, y, output],
    constants: [],
    counters: [samples, over, found]
});

/// The observer under one delay.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Run {
    observer: ObserverState,
    /// Sums of the squares of its innovations (p).
    squares: Vec<f64>,
}

crate::state!(Run {
    parts: [observer, squares],
    constants: [],
    counters: []
});

/// The commands that may act over the coming sample (m each).
#[derive(Clone, Copy, Debug)]
#[expect(
    clippy::exhaustive_structs,
    reason = "the two that latency tells apart"
)]
pub struct Commands<'a> {
    /// As designed.
    pub designed: &'a [f64],
    /// The newest.
    pub newest: &'a [f64],
}

impl DelayWatch {
    /// Starts at state `x0` (n) with `outputs` sensors under the command `u0` (m), for a design with
    /// this `latency`.
    pub fn new(x0: &[f64], u0: &[f64], outputs: usize, latency: usize) -> Self {
        let run = |_| Run {
            observer: ObserverState::new(x0, outputs),
            squares: vec![0.0; outputs],
        };
        Self {
            runs: (0..2 + latency.min(1)).map(run).collect(),
            acted: u0.to_vec(),
            readings: vec![0.0; outputs],
            y: vec![0.0; outputs],
            output: vec![0.0; outputs],
            samples: 0,
            over: false,
            found: None,
        }
    }

    /// The delay that the readings fit, if it is another than designed.
    pub fn found(&self) -> Option<Delay> {
        self.found
    }

    /// Takes the readings `y` (p) of a sample in mode `to`, come to from mode `from`, and the
    /// commands that may act next. A sample with a reading that is no number ends the watch: its
    /// runs would part for another reason.
    pub fn watch(
        &mut self,
        (observer, gain): (&Observer, &Matrix),
        mode: &ObservedMode,
        (from, to): (usize, usize),
        y: &[f64],
        commands: Commands<'_>,
        tuning: &DelayTuning,
    ) {
        if self.over {
            return;
        }
        if !y.iter().all(|value| value.is_finite()) {
            self.over = true;
            return;
        }
        kernel::copy(&mut self.y, y);
        kernel::bound(&mut self.y);
        let moved =
            commands.designed != self.acted.as_slice() || commands.newest != commands.designed;
        for (sum, value) in self.readings.iter_mut().zip(&self.y) {
            *sum += value * value;
        }
        let acts = [commands.designed, &self.acted, commands.newest];
        for (run, u) in self.runs.iter_mut().zip(acts) {
            mode.output(&mut self.output, run.observer.predicted());
            let innovations = self.y.iter().zip(&self.output);
            for (sum, (value, predicted)) in run.squares.iter_mut().zip(innovations) {
                let innovation = value - predicted;
                *sum += innovation * innovation;
            }
            run.observer.correct(observer, mode, from, to, &self.y);
            run.observer.predict(gain, mode, u, &self.y);
        }
        kernel::copy(&mut self.acted, commands.designed);
        self.samples += u32::from(moved);
        if f64::from(self.samples) >= tuning.least_samples {
            self.decide(tuning);
        }
    }

    fn decide(&mut self, tuning: &DelayTuning) {
        let Some((designed, others)) = self.runs.split_first() else {
            return;
        };
        let smaller = libm::log(tuning.squares_ratio);
        let (mut found, mut lead, mut all_worse) = (None, 0.0, true);
        for (at, delay) in [Delay::Longer, Delay::Shorter].into_iter().enumerate() {
            let Some(other) = others.get(at) else { break };
            let fit = self.compare(designed, other, tuning.zero);
            all_worse &= -fit.ratio > tuning.log_ratio && -fit.least > smaller;
            if fit.ratio > lead {
                lead = fit.ratio;
                // It must beat the rest as clearly.
                let mut rest = others.iter().enumerate().filter(|(index, _)| *index != at);
                let beaten = rest.all(|(_, rest)| {
                    self.compare(rest, other, tuning.zero).ratio > tuning.log_ratio
                });
                let clear = fit.ratio > tuning.log_ratio && fit.most > smaller && beaten;
                found = clear.then_some(delay);
            }
        }
        self.found = found;
        self.over =
            self.found.is_some() || all_worse || f64::from(self.samples) >= tuning.most_samples;
    }

    /// How much better than `reference` a run fits the readings; less than `zero` of them is no innovation.
    fn compare(&self, reference: &Run, run: &Run, zero: f64) -> Fit {
        let half = f64::from(self.samples) / 2.0;
        let pairs = reference.squares.iter().zip(&run.squares);
        let mut fit = Fit {
            ratio: 0.0,
            most: 0.0,
            least: 0.0,
        };
        for ((reference, run), reading) in pairs.zip(&self.readings) {
            let nothing = zero * reading + f64::MIN_POSITIVE;
            let of_output = libm::log((reference + nothing) / (run + nothing));
            fit.ratio += half * of_output;
            fit.most = fit.most.max(of_output);
            fit.least = fit.least.min(of_output);
        }
        fit
    }
}

/// The logarithm of a likelihood ratio, and the outputs that speak most for it and against it.
#[derive(Clone, Copy, Debug)]
struct Fit {
    ratio: f64,
    most: f64,
    least: f64,
}
