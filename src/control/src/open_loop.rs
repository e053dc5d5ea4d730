//! The model run in open loop while residuals cannot be used, and the sensors it contradicts.
//!
//! While the regressor mixes modes, or lies beyond what the database spans, no residual can be
//! used, and a flagged sensor is corrected by the last estimate of its fault. That is right for
//! a bias. A sensor that is stuck, or whose fault comes or goes just then, would leave the loop
//! without feedback: where the corrected reading and the model's run since then drift far apart, the
//! model's output replaces the reading.

use super::kernel;
use super::observer::ObservedMode;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The model's run, and the sensors it contradicts.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct OpenLoop {
    /// State predicted without any measurement since then (n).
    state: Vec<f64>,
    /// The next state, while it is computed (n).
    next: Vec<f64>,
    /// Which sensors are contradicted now (p).
    contradicted: Vec<bool>,
}

crate::state!(OpenLoop {
    parts: [state, next, contradicted],
    constants: [],
    counters: []
});

impl OpenLoop {
    /// At state `x0` (n) with `outputs` sensors.
    pub fn new(x0: &[f64], outputs: usize) -> Self {
        Self {
            state: x0.to_vec(),
            next: x0.to_vec(),
            contradicted: vec![false; outputs],
        }
    }

    /// While it is not in use: starts anew from the observer's prediction of the next state (n).
    pub fn restart(&mut self, predicted: &[f64]) {
        kernel::copy(&mut self.state, predicted);
        self.contradicted.fill(false);
    }

    /// Predicts one sample on under the acting input `u` (m).
    pub fn advance(&mut self, mode: &ObservedMode, u: &[f64]) {
        mode.step(&mut self.next, &self.state, u);
        kernel::copy(&mut self.state, &self.next);
    }

    /// What the model says the outputs are now (p).
    ///
    /// It feeds on no estimate, so it can replace a missing reading: the observer's own prediction
    /// in that place would make another observer, of which nothing was proved.
    pub fn output(&self, mode: &ObservedMode, out: &mut [f64]) {
        mode.output(out, &self.state);
    }

    /// Replaces the `corrected` readings (p) of sensors whose estimate is `held` (p) and that differ
    /// from what is `expected` of them (p) by more than `most` times their `thresholds` (p).
    pub fn overrule(
        &mut self,
        expected: &[f64],
        held: impl Iterator<Item = bool>,
        (most, thresholds): (f64, &[f64]),
        corrected: &mut [f64],
    ) {
        let sensors = held.zip(thresholds).zip(expected);
        let readings = corrected.iter_mut().zip(&mut self.contradicted);
        for ((reading, contradicted), ((held, &threshold), &modelled)) in readings.zip(sensors) {
            *contradicted = held && (*reading - modelled).abs() > most * threshold;
            if *contradicted {
                *reading = modelled;
            }
        }
    }

    /// Which sensors were contradicted at this tick (p).
    pub fn contradicted(&self) -> &[bool] {
        &self.contradicted
    }
}
