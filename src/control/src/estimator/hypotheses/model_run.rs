//! The model in open loop: what the plant would do under the commands alone, and how far that is right.

use super::hypothesis::Sensors;
use super::linear::sparse_dot;
use super::model::{Layout, ModeModel};
use crate::kernel::bounded;
use crate::parameters::Hypotheses as Settings;
use crate::tuning::BankTuning;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The model in open loop.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ModelRun {
    /// State (n).
    pub x: Vec<f64>,
    /// What moved it to this sample: state and disturbance before, loads and gain errors (N, faults unused).
    before: Vec<f64>,
    /// Outputs (p).
    pub y: Vec<f64>,
    /// Variance of each state that the model's error allows (n).
    variances: Vec<f64>,
    /// Their covariance that the model's error allows (p x p).
    bound: Vec<f64>,
    /// Variance of a reading around them (p).
    spread: Vec<f64>,
    /// Running mean of the squared error of each output (p).
    error: Vec<f64>,
    /// Running mean of what the model's error allows, as a variance (p).
    allowed: Vec<f64>,
}

crate::state!(ModelRun {
    parts: [x, before, y, variances, bound, spread, error, allowed],
    constants: [],
    counters: []
});

impl ModelRun {
    /// At rest at the operating point without loads, for a joint state of `size`.
    pub fn new(model: &ModeModel, settings: &Settings, size: usize) -> Self {
        let error = settings.model_error * settings.model_error;
        let allowed: Vec<f64> = model.bias.iter().map(|square| error * square).collect();
        Self {
            x: model.x0.clone(),
            before: vec![0.0; size],
            y: vec![0.0; model.bias.len()],
            variances: vec![0.0; model.x0.len()],
            bound: vec![0.0; model.bias.len() * model.bias.len()],
            spread: vec![0.0; model.bias.len()],
            error: allowed.clone(),
            allowed,
        }
    }

    /// Outputs of the sample, with the disturbance as `z` (N) knows it, and how far readings with this
    /// `noise` (p) may be from them.
    pub fn read(
        &mut self,
        model: &ModeModel,
        (settings, tuning): (&Settings, &BankTuning),
        z: &[f64],
        noise: &[f64],
    ) {
        let p = self.y.len();
        for k in 0..self.x.len() {
            self.variances[k] = self.variance(model, settings, tuning, k);
        }
        for (q, noise) in noise.iter().enumerate().take(p) {
            self.y[q] = model.output(q, &self.x, z);
            for j in 0..=q {
                let allowed = self.allowed(model, q, j);
                self.bound[q * p + j] = allowed;
                self.bound[j * p + q] = allowed;
            }
            self.spread[q] = noise * noise + self.share(tuning, q) * self.bound[q * p + q];
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
        let waves = layout.n..layout.load();
        self.before[..layout.n].copy_from_slice(&self.x);
        self.before[waves.clone()].copy_from_slice(&z[waves]);
        self.repeat(layout, model, u, next);
    }

    /// The last sample once more, in another mode.
    pub fn repeat(&mut self, layout: Layout, model: &ModeModel, u: &[f64], next: &mut [f64]) {
        let before = &self.before;
        for (i, next) in next.iter_mut().enumerate() {
            let [own, waves, loads] = model.motion.parts(i);
            let mut sum =
                model.state_offset[i] + sparse_dot(own, before) + sparse_dot(waves, before);
            sum += sparse_dot(loads, before);
            for &(at, b) in model.by_gain.row(i) {
                sum += b * u[at - layout.gain()] * (1.0 + before[at]);
            }
            *next = bounded(sum);
        }
        self.x.copy_from_slice(next);
    }

    /// Sensors that a hypothesis with these `outputs` (p) moves away from the run, by more than the root of
    /// `limit` deviations.
    pub fn displaced(&self, outputs: &[f64], limit: f64) -> Sensors {
        let own = self.y.iter().zip(&self.spread);
        let mut set = 0;
        for (q, (output, (alone, spread))) in outputs.iter().zip(own).enumerate().take(64) {
            let off = output - alone;
            set |= Sensors::from(off * off > limit * spread) << q;
        }
        set
    }

    /// Variance of state `k` that the model's error allows.
    pub fn variance(
        &self,
        model: &ModeModel,
        settings: &Settings,
        tuning: &BankTuning,
        k: usize,
    ) -> f64 {
        let off = settings.model_error * (self.x[k] - model.x0[k]);
        let start = tuning.start_deviations * settings.start[k];
        off * off + start * start
    }

    /// Covariance of the outputs `q` and `j`, by what the error has been so far.
    pub fn covariance(&self, tuning: &BankTuning, q: usize, j: usize) -> f64 {
        libm::sqrt(self.share(tuning, q) * self.share(tuning, j)) * self.bound[q * self.y.len() + j]
    }

    /// Learns which loads and gain errors are usual, from those of the leading hypothesis `z` (N).
    pub fn learn_loads(&mut self, tuning: &BankTuning, layout: Layout, z: &[f64]) {
        let loads = layout.load()..layout.fault();
        for (usual, now) in self.before[loads.clone()].iter_mut().zip(&z[loads]) {
            *usual += (now - *usual) / tuning.usual_load;
        }
    }

    /// The load or gain error under which it runs, by its entry of the joint state.
    pub fn load(&self, k: usize) -> f64 {
        self.before[k]
    }

    /// Learns the error, given the `outputs` (p) that the leading hypothesis expects.
    pub fn learn(&mut self, tuning: &BankTuning, outputs: &[f64]) {
        for (q, output) in outputs.iter().enumerate() {
            let off = output - self.y[q];
            self.error[q] += (bounded(off * off) - self.error[q]) / tuning.run_memory;
            let bound = self.bound[q * outputs.len() + q];
            self.allowed[q] += (bounded(bound) - self.allowed[q]) / tuning.run_memory;
        }
    }

    fn allowed(&self, model: &ModeModel, q: usize, j: usize) -> f64 {
        let n = self.x.len();
        let row = |q: usize| &model.c[q * n..(q + 1) * n];
        let pairs = row(q).iter().zip(row(j)).zip(&self.variances);
        pairs.map(|((a, b), variance)| a * b * variance).sum()
    }

    /// Variance of output `q` relative to what the model's error allows.
    fn share(&self, tuning: &BankTuning, q: usize) -> f64 {
        let (least, most) = (tuning.run_share_least, tuning.run_share_most);
        let share = self.error[q] / self.allowed[q].max(f64::MIN_POSITIVE);
        if share.is_finite() {
            share.clamp(least, most)
        } else {
            most
        }
    }
}
