//! The state observer (11)-(17), in predictor-corrector form.
//!
//! The printed observer `z(k+1) = F z + T B u + L y`, `x_hat = z + H y` is, with `T = I - H C`,
//! `F = T A - K C` and `L = K + F H`, the same as
//!
//! ```text
//! prior(k+1) = x0 + A (x_hat(k) - x0) + B (u(k) - u0)
//! x_hat(k+1) = prior(k+1) + H (y(k+1) - C prior(k+1)) + K (y(k) - C x_hat(k))
//! ```
//!
//! In this form `H` is chosen when `y(k+1)` arrives, so it belongs to the mode just left and the
//! mode just entered, and the estimate does not jump at a switch.

use super::kernel;
use super::parameters::{ModeModel, Observer};
use crate::matrix::Matrix;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// What the observer carries from one tick to the next.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct ObserverState {
    /// Prediction of the state before the measurement (n).
    prior: Vec<f64>,
    /// `K (y - C x_hat)` of the last sample (n).
    injection: Vec<f64>,
    /// State estimate `x_hat` (n).
    pub estimate: Vec<f64>,
    /// Output-sized scratch (p).
    innovation: Vec<f64>,
}

crate::state!(ObserverState {
    parts: [prior, injection, estimate, innovation],
    constants: [],
    counters: []
});

/// One mode of the plant as the observer uses it: affine in physical units.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ObservedMode {
    /// `A` (n x n)
    pub a: Matrix,
    /// `B` (n x m)
    pub b: Matrix,
    /// `C` (p x n)
    pub c: Matrix,
    /// `x0 - A x0 - B u0` (n)
    pub state_offset: Vec<f64>,
    /// `y0 - C x0` (p)
    pub output_offset: Vec<f64>,
}

impl ObservedMode {
    /// The mode with its affine terms, in sums of fixed order.
    pub fn new(mode: &ModeModel) -> Self {
        let product = |matrix: &Matrix, vector: &[f64]| {
            let mut out = vec![0.0; matrix.nrows()];
            kernel::add_product(&mut out, matrix, vector);
            out
        };
        let ax = product(&mode.a, &mode.x0);
        let bu = product(&mode.b, &mode.u0);
        let cx = product(&mode.c, &mode.x0);
        let states = mode.x0.iter().zip(ax).zip(bu);
        let outputs = mode.y0.iter().zip(cx);
        Self {
            a: mode.a.clone(),
            b: mode.b.clone(),
            c: mode.c.clone(),
            state_offset: states.map(|((x0, ax), bu)| x0 - ax - bu).collect(),
            output_offset: outputs.map(|(y0, cx)| y0 - cx).collect(),
        }
    }

    /// The state one sample on (n), from `state` (n) under the acting input `u` (m), bounded.
    pub fn step(&self, next: &mut [f64], state: &[f64], u: &[f64]) {
        kernel::affine(next, &self.state_offset, &self.a, state);
        kernel::add_product(next, &self.b, u);
        kernel::bound(next);
    }

    /// The output (p) at `state` (n).
    pub fn output(&self, out: &mut [f64], state: &[f64]) {
        kernel::affine(out, &self.output_offset, &self.c, state);
    }
}

impl ObserverState {
    /// Starts at state `x0` (n) with `outputs` sensors.
    pub fn new(x0: &[f64], outputs: usize) -> Self {
        Self {
            prior: x0.to_vec(),
            injection: vec![0.0; x0.len()],
            estimate: x0.to_vec(),
            innovation: vec![0.0; outputs],
        }
    }

    /// Predicts rest at `x0` (n).
    pub fn rest_at(&mut self, x0: &[f64]) {
        kernel::copy(&mut self.prior, x0);
        self.injection.fill(0.0);
    }

    /// The state predicted for the next measurement (n).
    pub fn predicted(&self) -> &[f64] {
        &self.prior
    }

    /// Corrects the prior with measurement `y`, having come from mode `from` into mode `to`.
    pub fn correct(
        &mut self,
        observer: &Observer,
        mode: &ObservedMode,
        from: usize,
        to: usize,
        y: &[f64],
    ) {
        mode.output(&mut self.innovation, &self.prior);
        subtract_from(&mut self.innovation, y);
        kernel::copy(&mut self.estimate, &self.prior);
        kernel::add_scaled(&mut self.estimate, 1.0, &self.injection);
        if let Some(gain) = observer.decoupling.get(from).and_then(|row| row.get(to)) {
            kernel::add_product(&mut self.estimate, gain, &self.innovation);
        }
        kernel::bound(&mut self.estimate);
    }

    /// Right after [`correct`](Self::correct): the estimate becomes its change for a small change
    /// `dy` (p) of the measurement, `H dy`. Spoils the injection.
    pub fn differentiate(&mut self, observer: &Observer, from: usize, to: usize, dy: &[f64]) {
        self.injection.fill(0.0);
        if let Some(gain) = observer.decoupling.get(from).and_then(|row| row.get(to)) {
            kernel::add_product(&mut self.injection, gain, dy);
        }
        for (estimate, &change) in self.estimate.iter_mut().zip(&self.injection) {
            *estimate = kernel::bounded_change(*estimate, change);
        }
    }

    /// Predicts the next state under the acting input `u`, and keeps the injection of measurement `y`.
    pub fn predict(&mut self, gain: &Matrix, mode: &ObservedMode, u: &[f64], y: &[f64]) {
        mode.output(&mut self.innovation, &self.estimate);
        subtract_from(&mut self.innovation, y);
        self.injection.fill(0.0);
        kernel::add_product(&mut self.injection, gain, &self.innovation);
        kernel::bound(&mut self.injection);
        mode.step(&mut self.prior, &self.estimate, u);
    }
}

/// `values = from - values`.
fn subtract_from(values: &mut [f64], from: &[f64]) {
    for (value, &minuend) in values.iter_mut().zip(from) {
        *value = minuend - *value;
    }
}
