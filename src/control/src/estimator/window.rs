//! The sliding window as printed (41)-(46), (54): the residual is the part of the newest output
//! that the window's own inputs cannot explain.
//!
//! With `Pi = I - U' (U U')^-1 U` the residual is the last column of `Y Pi`. `U U'` is singular
//! under constant input, so an orthonormal basis of the row space of `U` is built by pivoted
//! Gram-Schmidt, which stops at the numerical rank; then `Pi e_L = e_L - sum q q_L`.
//!
//! It is kept for comparison: a fault that stays is slowly taken for normal, and gone from the
//! residual once it fills the window.

use crate::kernel;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The last `L` regressors and outputs.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct SlidingWindow {
    /// `U` (q x L), row after row; column 0 is the oldest sample.
    inputs: Vec<f64>,
    /// `Y` (p x L), row after row.
    outputs: Vec<f64>,
    /// Gram-Schmidt scratch (q x L).
    basis: Vec<f64>,
    /// `Pi e_L` (L).
    projection: Vec<f64>,
    length: usize,
    /// Length of a direction over the longest row below which it counts as none.
    rank: f64,
    /// Samples taken so far, at most `L`.
    filled: usize,
}

crate::state!(SlidingWindow {
    parts: [inputs, outputs, basis, projection],
    constants: [length, rank],
    counters: [filled]
});

impl SlidingWindow {
    /// An empty window of `length` samples of a regressor of size `regressor` and `outputs` sensors; a direction shorter than
    /// `rank` times the longest row counts as none.
    pub fn new(regressor: usize, outputs: usize, length: usize, rank: f64) -> Self {
        let length = length.max(1);
        Self {
            inputs: vec![0.0; regressor * length],
            outputs: vec![0.0; outputs * length],
            basis: vec![0.0; regressor * length],
            projection: vec![0.0; length],
            length,
            rank,
            filled: 0,
        }
    }

    /// Empties the window: its samples belong to another mode.
    pub fn clear(&mut self) {
        self.filled = 0;
        self.inputs.fill(0.0);
        self.outputs.fill(0.0);
    }

    /// Whether the window is full.
    pub fn full(&self) -> bool {
        self.filled == self.length
    }

    /// Takes one sample and writes the residual (p); a lost measurement repeats the last one.
    pub fn residual(&mut self, regressor: &[f64], y: &[f64], out: &mut [f64]) {
        append(&mut self.inputs, self.length, regressor);
        append(&mut self.outputs, self.length, y);
        self.filled = (self.filled + 1).min(self.length);
        self.project();
        for (value, row) in out.iter_mut().zip(self.outputs.chunks_exact(self.length)) {
            *value = kernel::bounded(kernel::dot(row, &self.projection));
        }
    }

    /// What the newest output weighs in the residual; nothing before the first sample.
    pub fn newest_weight(&self) -> f64 {
        let newest = self.projection.last().copied().unwrap_or(0.0);
        if self.filled == 0 { 0.0 } else { newest }
    }

    /// Computes `Pi e_L` by pivoted Gram-Schmidt over the rows of `U`.
    fn project(&mut self) {
        let length = self.length;
        kernel::copy(&mut self.basis, &self.inputs);
        self.projection.fill(0.0);
        if let Some(newest) = self.projection.last_mut() {
            *newest = 1.0;
        }
        let rows = self.basis.len() / length;
        let mut floor = 0.0;
        for done in 0..rows {
            let Some((index, square)) = longest(&self.basis, length, done) else {
                break;
            };
            if done == 0 {
                floor = self.rank * self.rank * square;
            }
            if square <= floor {
                break;
            }
            swap_rows(&mut self.basis, length, done, index);
            let (head, rest) = self
                .basis
                .split_at_mut(((done + 1) * length).min(rows * length));
            let Some(pivot) = head.chunks_exact_mut(length).last() else {
                break;
            };
            let scale = 1.0 / libm::sqrt(square);
            pivot.iter_mut().for_each(|v| *v *= scale);
            for row in rest.chunks_exact_mut(length) {
                kernel::add_scaled(row, -kernel::dot(row, pivot), pivot);
            }
            let along = kernel::dot(&self.projection, pivot);
            kernel::add_scaled(&mut self.projection, -along, pivot);
        }
    }
}

/// Shifts every row of a row-major matrix by one sample and appends `sample`; not-a-number repeats the last value.
fn append(matrix: &mut [f64], length: usize, sample: &[f64]) {
    for (row, &value) in matrix.chunks_exact_mut(length).zip(sample) {
        row.rotate_left(1);
        let previous = row
            .len()
            .checked_sub(2)
            .and_then(|i| row.get(i))
            .copied()
            .unwrap_or(0.0);
        if let Some(newest) = row.last_mut() {
            *newest = if value.is_finite() {
                kernel::bounded(value)
            } else {
                previous
            };
        }
    }
}

/// Index and squared length of the longest row from `first` on.
fn longest(matrix: &[f64], length: usize, first: usize) -> Option<(usize, f64)> {
    matrix
        .chunks_exact(length)
        .enumerate()
        .skip(first)
        .map(|(index, row)| (index, kernel::dot(row, row)))
        .fold(None, |best: Option<(usize, f64)>, row| match best {
            Some(b) if b.1 >= row.1 => Some(b),
            _ => Some(row),
        })
}

fn swap_rows(matrix: &mut [f64], length: usize, first: usize, second: usize) {
    if first >= second {
        return;
    }
    let (head, tail) = matrix.split_at_mut((second * length).min(matrix.len()));
    if let Some(a) = head.chunks_exact_mut(length).nth(first)
        && let Some(b) = tail.chunks_exact_mut(length).next()
    {
        a.swap_with_slice(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    /// A step of 0.5 under constant input, `L = 46`: seen at first, absorbed as the window fills.
    #[test]
    fn a_fault_that_stays_is_absorbed() {
        let mut window = SlidingWindow::new(24, 1, 46, 1e-9);
        let mut seen = Vec::new();
        for k in 0..150 {
            let mut out = [0.0];
            let fault = if k >= 80 { 0.5 } else { 0.0 };
            window.residual(&[0.3; 24], &[1.2 + fault], &mut out);
            seen.push(out[0]);
        }
        assert!((seen[80] - 0.489).abs() < 5e-4, "{}", seen[80]);
        assert!((seen[99] - 0.283).abs() < 5e-4, "{}", seen[99]);
        assert!(seen[126].abs() < 1e-9, "{}", seen[126]);
    }

    proptest! {
        /// On a regular window the residual is the last column of `Y (I - U'(UU')^-1 U)`.
        #[test]
        fn equals_the_printed_projection(
            entries in prop::collection::vec(-1.0..1.0f64, 4 * 12), y in prop::collection::vec(-1.0..1.0f64, 12),
        ) {
            let u = DMatrix::from_fn(4, 12, |r, c| entries[12 * r + c]);
            let gram = &u * u.transpose();
            prop_assume!(gram.clone().symmetric_eigen().eigenvalues.min() > 1e-2);
            let projector = DMatrix::identity(12, 12) - u.transpose() * gram.try_inverse().unwrap() * &u;
            let expected = (DMatrix::from_row_slice(1, 12, &y) * projector)[(0, 11)];
            let mut window = SlidingWindow::new(4, 1, 12, 1e-9);
            let mut out = [0.0];
            for (column, y) in u.column_iter().zip(y) {
                let column: Vec<f64> = column.iter().copied().collect();
                window.residual(&column, &[y], &mut out);
            }
            prop_assert!((out[0] - expected).abs() < 1e-9);
        }
    }
}
