//! What a hypothesis expects of the readings.

use super::hypothesis::{Hypothesis, Kinds, has};
use super::linear::{combine, padded, sparse_dot};
use super::model::{Layout, ModeModel};
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// What a hypothesis expects of outputs and sensor faults: all that a sample can tell apart.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Expectation {
    /// Outputs (p).
    pub(super) output: Vec<f64>,
    /// Entries of the faults (p).
    fault: Vec<f64>,
    /// Covariance of the outputs, `C P C'` (p x p).
    outputs: Vec<f64>,
    /// Covariance of outputs and faults (p x p).
    crossed: Vec<f64>,
    /// Covariance of the faults (p x p).
    faults: Vec<f64>,
    /// Whether it has yet to be taken from the hypothesis at hand.
    pub(super) stale: bool,
}

crate::state!(Expectation {
    parts: [output, fault, outputs, crossed, faults],
    constants: [],
    counters: [stale]
});

impl Expectation {
    /// Room for `p` sensors.
    pub(super) fn new(p: usize) -> Self {
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
    pub(super) fn take(
        &mut self,
        layout: Layout,
        model: &ModeModel,
        h: &Hypothesis,
        rows: &mut [f64],
    ) {
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
    pub(super) fn covariance(
        &self,
        (q, left): (usize, [f64; 2]),
        (j, right): (usize, [f64; 2]),
    ) -> f64 {
        let p = self.output.len();
        let (at, mirrored) = (q * p + j, j * p + q);
        left[0] * (right[0] * self.outputs[at] + right[1] * self.crossed[at])
            + left[1] * (right[0] * self.crossed[mirrored] + right[1] * self.faults[at])
    }

    /// Weights of output and fault in the reading of sensor `q`, and what is expected of it.
    pub(super) fn weigh(&self, q: usize, kinds: Kinds, bias: bool) -> ([f64; 2], f64) {
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
