//! The regressor of past inputs and how far it lies from the healthy database.

use crate::kernel;
use crate::matrix::Matrix;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The last `j` acting inputs, oldest first: the paper's `u_bar(k)` of (42) without `u(k)`,
/// which cannot act on `y(k)` since the plant has no feed-through.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct InputHistory {
    /// Inputs in physical units (m j).
    inputs: Vec<f64>,
    /// Inputs relative to the operating point (m j).
    regressor: Vec<f64>,
    /// Scratch of the leverage (m j).
    whitened: Vec<f64>,
    width: usize,
}

crate::state!(InputHistory {
    parts: [inputs, regressor, whitened],
    constants: [width],
    counters: []
});

impl InputHistory {
    /// `inputs` (m) has acted for the last `length` samples.
    pub fn new(inputs: &[f64], length: usize) -> Self {
        let size = inputs.len() * length;
        Self {
            inputs: inputs.iter().copied().cycle().take(size).collect(),
            regressor: vec![0.0; size],
            whitened: vec![0.0; size],
            width: inputs.len().max(1),
        }
    }

    /// Appends the input that acts over the coming sample (m) and drops the oldest.
    pub fn push(&mut self, acting: &[f64]) {
        if self.inputs.len() < self.width {
            return;
        }
        self.inputs.copy_within(self.width.., 0);
        let newest = self.inputs.len() - self.width;
        if let Some(sample) = self.inputs.get_mut(newest..) {
            kernel::copy(sample, acting);
        }
    }

    /// Makes the regressor relative to the operating point's input `u0` (m).
    pub fn regress(&mut self, u0: &[f64]) {
        let samples = self.inputs.chunks_exact(self.width);
        for (out, sample) in self.regressor.chunks_exact_mut(self.width).zip(samples) {
            kernel::difference(out, sample, u0);
        }
    }

    /// `phi` (m j), as of the last [`regress`](Self::regress).
    pub fn regressor(&self) -> &[f64] {
        &self.regressor
    }

    /// The leverage of the present regressor.
    pub fn leverage(&mut self, factor: &Matrix) -> f64 {
        leverage(factor, &self.regressor, &mut self.whitened)
    }
}

/// `|R^-T phi|^2`: the variance of the prediction in units of the noise variance.
///
/// `factor` is `R` (q x q, upper triangular), `whitened` scratch (q). Forward substitution reads
/// the columns of `R`, which lie contiguous, four of them at a time.
pub fn leverage(factor: &Matrix, regressor: &[f64], whitened: &mut [f64]) -> f64 {
    let mut sum = 0.0;
    let mut columns = factor.columns();
    let mut solved_count = 0;
    while let Some(first) = columns.next() {
        let mut next = || columns.next().unwrap_or(first);
        let four = [first, next(), next(), next()];
        let above = four.map(|column| column.get(..solved_count).unwrap_or_default());
        let (solved, rest) = whitened.split_at_mut(solved_count.min(whitened.len()));
        let products = kernel::four_dots(above, solved);
        let below = four.map(|column| column.get(solved_count..).unwrap_or_default());
        let entries = regressor.get(solved_count..).unwrap_or_default();
        let new = rest.len().min(entries.len()).min(4);
        for (index, ((column, &entry), product)) in
            below.iter().zip(entries).zip(products).enumerate()
        {
            if index >= new {
                break;
            }
            let (known, unknown) = rest.split_at_mut(index);
            let (left, diagonal) = column.split_at(index.min(column.len()));
            let (Some(value), Some(&pivot)) = (unknown.first_mut(), diagonal.first()) else {
                return kernel::bounded(sum);
            };
            let product = product + kernel::dot(left, known);
            *value = kernel::bounded((entry - product) / pivot);
            sum += *value * *value;
        }
        solved_count += new;
        if new < 4 {
            break;
        }
    }
    kernel::bounded(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn leverage_is_the_quadratic_form_of_the_inverse_gram_matrix(
            size in 1usize..6, entries in prop::collection::vec(-1.0..1.0f64, 60), phi in prop::collection::vec(-2.0..2.0f64, 5),
        ) {
            let data = DMatrix::from_fn(10, size, |r, c| entries[6 * r + c]);
            let factor = data.clone().qr().r();
            prop_assume!(factor.diagonal().iter().all(|d| d.abs() > 0.05));
            let phi = &phi[..size];
            let plain = Matrix::from_fn(size, size, |r, c| factor[(r, c)]);
            let got = leverage(&plain, phi, &mut vec![0.0; size]);
            let v = nalgebra::DVector::from_column_slice(phi);
            let want = (v.transpose() * (data.transpose() * &data).try_inverse().unwrap() * &v)[0];
            prop_assert!((got - want).abs() <= 1e-7 * (1.0 + want));
        }
    }

    #[test]
    fn the_history_drops_the_oldest_input() {
        let mut history = InputHistory::new(&[0.5, 1.5], 2);
        history.push(&[2.0, 3.0]);
        history.regress(&[1.0, 1.0]);
        assert_eq!(history.regressor(), [-0.5, 0.5, 1.0, 2.0]);
    }
}
