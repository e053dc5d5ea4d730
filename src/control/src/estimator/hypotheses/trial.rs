//! How likely a sample is, if something happened to a hypothesis.

// Matrices are flat and addressed by row and column, as in the equations.
#![allow(clippy::needless_range_loop)]

use super::candidates::Action;
use super::hypothesis::{Innovation, Reading, Sensors, has};
use super::model::{Layout, ModeModel};
use super::{Bank, BankState};

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
            Action::PlantChanged => {
                for (i, variance) in self.change_variance(model, h, u).enumerate() {
                    add_pairs(s, p, reading.valid, |q, j| {
                        scale(q, j) * (variance * model.c[q * n + i] * model.c[j * n + i])
                    });
                }
            }
            Action::Stay | Action::PlantRestored => {}
        }
    }
}
