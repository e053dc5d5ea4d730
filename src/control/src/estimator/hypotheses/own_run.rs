//! The model's own run: what the plant would do under the commands alone, and how far that is right.

use super::linear::dot;
use super::model::{Layout, ModeModel};
use crate::kernel::bounded;
use crate::parameters::Hypotheses as Settings;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// Samples over which the error of the run is estimated.
const MEMORY: f64 = 300.0;
/// Least and largest variance of that error, relative to what the model's error allows.
const SHARE: [f64; 2] = [0.02, 1.0];
/// The state at the start may be off by so many of its standard deviations.
const START: f64 = 3.0;

/// The model's own run.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct OwnRun {
    /// State (n).
    pub x: Vec<f64>,
    /// Outputs (p).
    pub y: Vec<f64>,
    /// Running mean of the squared error of each output (p).
    error: Vec<f64>,
    /// Running mean of what the model's error allows, as a variance (p).
    allowed: Vec<f64>,
}

crate::state!(OwnRun {
    parts: [x, y, error, allowed],
    constants: [],
    counters: []
});

impl OwnRun {
    /// At rest at the operating point.
    pub fn new(model: &ModeModel, settings: &Settings) -> Self {
        let error = settings.model_error * settings.model_error;
        let allowed: Vec<f64> = model.bias.iter().map(|square| error * square).collect();
        Self {
            x: model.x0.clone(),
            y: vec![0.0; model.bias.len()],
            error: allowed.clone(),
            allowed,
        }
    }

    /// Outputs of the sample, with the disturbance as `z` (N) knows it.
    pub fn read(&mut self, layout: Layout, model: &ModeModel, z: &[f64]) {
        let Layout { n, d, .. } = layout;
        for (q, y) in self.y.iter_mut().enumerate() {
            *y = model.output_offset[q]
                + dot(&model.c[q * n..(q + 1) * n], &self.x)
                + dot(&model.f[q * d..(q + 1) * d], &z[n..n + d]);
        }
    }

    /// One sample on under the input `u` (m), with the disturbance as `z` (N) knows it. `next` holds n.
    pub fn advance(
        &mut self,
        layout: Layout,
        model: &ModeModel,
        z: &[f64],
        u: &[f64],
        next: &mut [f64],
    ) {
        let Layout { n, m, d, .. } = layout;
        for (i, next) in next.iter_mut().enumerate() {
            let mut sum = model.state_offset[i]
                + dot(&model.a[i * n..(i + 1) * n], &self.x)
                + dot(&model.e[i * d..(i + 1) * d], &z[n..n + d]);
            sum += dot(&model.b[i * m..(i + 1) * m], u);
            *next = bounded(sum);
        }
        self.x.copy_from_slice(next);
    }

    /// How far a hypothesis with the state `z` (N) moves output `q` away from the run.
    pub fn offset(&self, layout: Layout, model: &ModeModel, z: &[f64], q: usize) -> f64 {
        let Layout { n, d, .. } = layout;
        let output = model.output_offset[q]
            + dot(&model.c[q * n..(q + 1) * n], &z[..n])
            + dot(&model.f[q * d..(q + 1) * d], &z[n..n + d]);
        output - self.y[q]
    }

    /// Variance of state `k` that the model's error allows.
    pub fn variance(&self, model: &ModeModel, settings: &Settings, k: usize) -> f64 {
        let off = settings.model_error * (self.x[k] - model.x0[k]);
        let start = START * settings.start[k];
        off * off + start * start
    }

    /// Covariance of the outputs `q` and `j`, by what the error has been so far.
    pub fn covariance(&self, model: &ModeModel, settings: &Settings, q: usize, j: usize) -> f64 {
        libm::sqrt(self.share(q) * self.share(j)) * self.allowed(model, settings, q, j)
    }

    /// Learns the error, given the leading hypothesis's state `z` (N).
    pub fn learn(&mut self, layout: Layout, model: &ModeModel, settings: &Settings, z: &[f64]) {
        for q in 0..layout.p {
            let off = self.offset(layout, model, z, q);
            let allowed = self.allowed(model, settings, q, q);
            self.error[q] += (bounded(off * off) - self.error[q]) / MEMORY;
            self.allowed[q] += (bounded(allowed) - self.allowed[q]) / MEMORY;
        }
    }

    fn allowed(&self, model: &ModeModel, settings: &Settings, q: usize, j: usize) -> f64 {
        let n = self.x.len();
        let row = |q: usize| &model.c[q * n..(q + 1) * n];
        let pairs = row(q).iter().zip(row(j)).enumerate();
        pairs
            .map(|(k, (a, b))| a * b * self.variance(model, settings, k))
            .sum()
    }

    /// Variance of output `q` relative to what the model's error allows.
    fn share(&self, q: usize) -> f64 {
        let [least, most] = SHARE;
        let share = self.error[q] / self.allowed[q].max(f64::MIN_POSITIVE);
        if share.is_finite() {
            share.clamp(least, most)
        } else {
            most
        }
    }
}
