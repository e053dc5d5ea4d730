//! How likely a sample is, if something happened to a hypothesis.

// Matrices are flat and addressed by row and column, as in the equations.
#![allow(clippy::needless_range_loop)]

use super::competition::Action;
use super::hypothesis::{Hypothesis, Innovation, Kinds, Reading, Sensors, has};
use super::linear::{combine, padded, sparse_dot};
use super::model::{Layout, ModeModel};
use super::{Bank, BankState};
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// What a hypothesis expects of outputs and sensor faults: all that a sample can tell apart.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Expectation {
    /// Outputs (p).
    output: Vec<f64>,
    /// Entries of the faults (p).
    fault: Vec<f64>,
    /// Covariance of the outputs, `C P C'` (p x p).
    outputs: Vec<f64>,
    /// Covariance of outputs and faults (p x p).
    crossed: Vec<f64>,
    /// Covariance of the faults (p x p).
    faults: Vec<f64>,
    /// Whether it has yet to be taken from the hypothesis at hand.
    pub stale: bool,
}

crate::state!(Expectation {
    parts: [output, fault, outputs, crossed, faults],
    constants: [],
    counters: [stale]
});

impl Expectation {
    /// Room for `p` sensors.
    pub fn new(p: usize) -> Self {
        Self {
            output: vec![0.0; p],
            fault: vec![0.0; p],
            outputs: vec![0.0; p * p],
            crossed: vec![0.0; p * p],
            faults: vec![0.0; p * p],
            stale: true,
        }
    }

    /// What `h` expects. `rows` holds p padded rows.
    fn take(&mut self, layout: Layout, model: &ModeModel, h: &Hypothesis, rows: &mut [f64]) {
        self.stale = false;
        let (p, stride, fault) = (layout.p, layout.stride(), layout.fault());
        let width = padded(layout.size());
        self.fault.copy_from_slice(&h.z[fault..fault + p]);
        for (q, row) in rows.chunks_exact_mut(stride).enumerate().take(p) {
            self.output[q] = model.output(q, &h.z, &h.z);
            let terms = model.outputs.row(q).iter().copied();
            combine(&mut row[..width], &h.cov, stride, terms);
            let at = q * p..(q + 1) * p;
            for (j, sum) in self.outputs[at.clone()].iter_mut().enumerate() {
                *sum = sparse_dot(model.outputs.row(j), row);
            }
            self.crossed[at.clone()].copy_from_slice(&row[fault..fault + p]);
            let own = (fault + q) * stride + fault;
            self.faults[at].copy_from_slice(&h.cov[own..own + p]);
        }
    }

    /// Covariance of the readings `q` and `j`, each the sum of its output and its fault with these weights.
    fn covariance(&self, (q, left): (usize, [f64; 2]), (j, right): (usize, [f64; 2])) -> f64 {
        let p = self.output.len();
        let (at, mirrored) = (q * p + j, j * p + q);
        left[0] * (right[0] * self.outputs[at] + right[1] * self.crossed[at])
            + left[1] * (right[0] * self.crossed[mirrored] + right[1] * self.faults[at])
    }

    /// Weights of output and fault in the reading of sensor `q`, and what is expected of it.
    fn weigh(&self, q: usize, kinds: Kinds, bias: bool) -> ([f64; 2], f64) {
        let (output, fault) = (self.output[q], self.fault[q]);
        let (scale, slot) = kinds.weights(q, output, fault, bias);
        let added = if has(kinds.scaled, q) {
            0.0
        } else {
            slot * fault
        };
        ([scale, slot], scale * output + added)
    }
}

/// The symmetric `s` (p x p), in its lower half, gets `term` added for each pair of sensors in `which`.
fn add_pairs(s: &mut [f64], p: usize, which: Sensors, term: impl Fn(usize, usize) -> f64) {
    for q in (0..p).filter(|&q| has(which, q)) {
        for j in (0..=q).filter(|&j| has(which, j)) {
            s[q * p + j] += term(q, j);
        }
    }
}

/// Whether what happened puts the state back to the model in open loop.
const fn starts_anew(action: Action) -> bool {
    matches!(
        action,
        Action::Unloaded | Action::UsualLoad | Action::Drift(_)
    )
}

impl Bank {
    /// Log likelihood of the sample if `action` happened to the hypothesis in `slot`.
    pub(super) fn trial(
        &self,
        state: &mut BankState,
        slot: usize,
        model: &ModeModel,
        reading: Reading<'_>,
        action: Action,
    ) -> f64 {
        let p = self.layout.p;
        if !starts_anew(action) && state.expectation.stale {
            let (h, rows) = (&state.slots[slot], &mut state.trial.rows);
            state.expectation.take(self.layout, model, h, rows);
        }
        self.expect(state, slot, reading, action);
        self.open(state, slot, model, reading, action);
        state.trial.whiten(p);
        state.trial.likelihood(p)
    }

    /// Innovation and covariance of the readings: from the model in open loop where the hypothesis starts anew
    /// from it, else from its expectation.
    fn expect(&self, state: &mut BankState, slot: usize, reading: Reading<'_>, action: Action) {
        let p = self.layout.p;
        let kinds = self.sets(&state.slots[slot], action);
        let bias = self.output_error();
        let run = action.run(&state.unloaded, &state.usual);
        let (expectation, mean) = (&state.expectation, &state.mean);
        let Innovation { r, s, weights, .. } = &mut state.trial;
        for q in 0..p {
            s[q * p..=q * p + q].fill(0.0);
            if !has(reading.valid, q) {
                r[q] = 0.0;
                s[q * p + q] = 1.0;
                continue;
            }
            let expected;
            (weights[q], expected) = match action {
                _ if starts_anew(action) => ([1.0, 0.0], run.y[q]),
                Action::Freeze(frozen) if frozen == q => ([0.0; 2], mean[q]),
                // The gain opens around its mean; nothing of the old entry counts.
                Action::Scale(scaled) if scaled == q => {
                    let factor = 1.0 + self.tuning.gain_fault_mean;
                    ([factor, 0.0], factor * expectation.output[q])
                }
                _ if self.opens_anew(&state.slots[slot], action, q) => {
                    ([1.0, 0.0], expectation.output[q])
                }
                _ => expectation.weigh(q, kinds, bias),
            };
            r[q] = reading.y[q] - expected;
            for j in (0..=q).filter(|&j| has(reading.valid, j)) {
                s[q * p + j] = match starts_anew(action) {
                    true => run.covariance(&self.tuning, q, j),
                    false => expectation.covariance((q, weights[q]), (j, weights[j])),
                };
            }
            s[q * p + q] += reading.noise[q] * reading.noise[q];
        }
    }

    /// What `action` adds to the covariance of the readings.
    fn open(
        &self,
        state: &mut BankState,
        slot: usize,
        model: &ModeModel,
        reading: Reading<'_>,
        action: Action,
    ) {
        let Layout { n, m, p, .. } = self.layout;
        let (settings, h, u) = (&self.settings, &state.slots[slot], &state.u);
        let Innovation { s, weights, .. } = &mut state.trial;
        let scale = |q: usize, j: usize| weights[q][0] * weights[j][0];
        match action {
            Action::Load(jump) => {
                let jump = &model.jumps[jump];
                let variance = settings.gain_error * settings.gain_error;
                add_pairs(s, p, reading.valid, |q, j| {
                    let gains = jump.gains.clone().map(|k| {
                        let left = model.cb[q * m + k] * u[k];
                        variance * left * (model.cb[j * m + k] * u[k])
                    });
                    scale(q, j) * (jump.seen[q * p + j] + gains.sum::<f64>())
                });
            }
            Action::Bias(set) | Action::Change(set) => {
                for q in (0..p).filter(|&q| has(set & reading.valid, q)) {
                    s[q * p + q] += self.fault_variance(q);
                }
            }
            Action::Release(set) => {
                for q in (0..p).filter(|&q| has(set & reading.valid, q)) {
                    s[q * p + q] += self.healthy_variance(model, q);
                }
            }
            Action::Unloaded | Action::UsualLoad | Action::Drift(_) => {
                let drifted = self.sets(h, action).additive;
                for q in (0..p).filter(|&q| has(reading.valid, q)) {
                    s[q * p + q] += match has(drifted, q) {
                        true => self.fault_variance(q),
                        false => self.healthy_variance(model, q),
                    };
                }
            }
            Action::Scale(q) => {
                let output = state.expectation.output[q];
                s[q * p + q] += output * output * self.tuning.gain_fault_variance;
            }
            Action::Freeze(q) => {
                let noise = reading.noise[q];
                s[q * p + q] += noise * noise / state.count[q].max(1.0);
            }
            Action::Start => add_pairs(s, p, reading.valid, |q, j| {
                let states = settings.start_elsewhere.iter().enumerate();
                states
                    .map(|(k, size)| model.c[q * n + k] * model.c[j * n + k] * size * size)
                    .sum()
            }),
            Action::Loosen => {
                for (i, variance) in self.looseness(model, h, u).enumerate() {
                    add_pairs(s, p, reading.valid, |q, j| {
                        scale(q, j) * (variance * model.c[q * n + i] * model.c[j * n + i])
                    });
                }
            }
            Action::Stay | Action::Tighten => {}
        }
    }
}
