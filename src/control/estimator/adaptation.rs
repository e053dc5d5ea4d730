//! Gated adaptation of the response: the database goes on growing while all is well.
//!
//! Recursive least squares without forgetting continues the fit of the database with healthy
//! samples, so it starts from everything the database knows and moves the less the more it has
//! seen. It must be unable to do harm, hence three gates:
//!
//! * it learns only from samples in which every sensor was judged healthy;
//! * it is used, sensor by sensor, only while its predictions have been better than those of the
//!   database alone, both judged before learning from the sample;
//! * a response that strays too far from the database's is thrown away, and learning starts again.

use crate::control::kernel;
use crate::control::parameters::Predictor;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Share of the past in the running mean of squared errors.
const MEMORY: f64 = 0.99;

/// The adapted error must be this much smaller than the database's before it is preferred.
const ADVANTAGE: f64 = 0.98;

/// Largest change of the response, relative to the database's, that is believed.
const BELIEVABLE: f64 = 0.5;

/// The adapted response of one mode, with `q = m j` regressors.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Adaptation {
    /// Adapted less database response (p x q, row after row).
    change: Vec<f64>,
    /// Covariance in units of the noise variance (q x q, symmetric).
    covariance: Vec<f64>,
    /// Covariance times regressor (q).
    direction: Vec<f64>,
    /// What the change adds to the prediction (p).
    addition: Vec<f64>,
    /// Running means of the squared errors of the database's prediction (p).
    fixed_error: Vec<f64>,
    /// And of the adapted one (p).
    adapted_error: Vec<f64>,
}

crate::state::state!(Adaptation {
    parts: [
        change,
        covariance,
        direction,
        addition,
        fixed_error,
        adapted_error
    ],
    constants: [],
    counters: []
});

impl Adaptation {
    /// Nothing learned beyond the database.
    pub fn new(predictor: &Predictor) -> Self {
        let (outputs, size) = predictor.response.shape();
        Self {
            change: vec![0.0; outputs * size],
            covariance: covariance(&predictor.factor),
            direction: vec![0.0; size],
            addition: vec![0.0; outputs],
            fixed_error: vec![0.0; outputs],
            adapted_error: vec![0.0; outputs],
        }
    }

    /// Adds the change to `prediction` (p) for every sensor whose adapted response has proved better.
    pub fn improve(&mut self, regressor: &[f64], prediction: &mut [f64]) {
        let size = regressor.len().max(1);
        for (sum, row) in self.addition.iter_mut().zip(self.change.chunks_exact(size)) {
            *sum = kernel::bounded(kernel::dot(row, regressor));
        }
        let scores = self.fixed_error.iter().zip(&self.adapted_error);
        for ((value, &change), (&fixed, &adapted)) in
            prediction.iter_mut().zip(&self.addition).zip(scores)
        {
            if adapted < ADVANTAGE * fixed {
                *value += change;
            }
        }
    }

    /// Learns from a healthy sample. `residual` (p) is that of the prediction as [`improve`](Self::improve) left it.
    pub fn learn(&mut self, predictor: &Predictor, regressor: &[f64], residual: &[f64]) {
        let size = regressor.len().max(1);
        for (value, row) in self
            .direction
            .iter_mut()
            .zip(self.covariance.chunks_exact(size))
        {
            *value = kernel::dot(row, regressor);
        }
        let scale = 1.0 / (1.0 + kernel::dot(&self.direction, regressor).max(0.0));
        let scores = self.fixed_error.iter_mut().zip(&mut self.adapted_error);
        let rows = self
            .change
            .chunks_exact_mut(size)
            .zip(&self.addition)
            .zip(residual);
        for (((row, &addition), &residual), (fixed, adapted)) in rows.zip(scores) {
            let used = *adapted < ADVANTAGE * *fixed;
            let database_error = if used { residual + addition } else { residual };
            let adapted_error = database_error - addition;
            *fixed =
                kernel::bounded(MEMORY * *fixed + (1.0 - MEMORY) * database_error * database_error);
            *adapted =
                kernel::bounded(MEMORY * *adapted + (1.0 - MEMORY) * adapted_error * adapted_error);
            kernel::add_scaled(row, scale * adapted_error, &self.direction);
            kernel::bound(row);
        }
        kernel::subtract_square(&mut self.covariance, scale, &self.direction);
        kernel::bound(&mut self.covariance);
        if self.strayed(predictor) {
            self.change.fill(0.0);
            self.adapted_error.fill(0.0);
            self.fixed_error.fill(0.0);
        }
    }

    fn strayed(&self, predictor: &Predictor) -> bool {
        let known = predictor.response.as_slice();
        kernel::dot(&self.change, &self.change)
            > BELIEVABLE * BELIEVABLE * kernel::dot(known, known)
    }
}

/// `(R'R)^-1`, row after row: what the database leaves open.
fn covariance(factor: &DMatrix<f64>) -> Vec<f64> {
    let size = factor.nrows();
    let inverse = factor
        .solve_upper_triangular(&DMatrix::identity(size, size))
        .unwrap_or_else(|| DMatrix::zeros(size, size));
    let product = &inverse * inverse.transpose();
    let covariance = 0.5 * (&product + product.transpose());
    covariance.iter().map(|&v| kernel::bounded(v)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn predictor(response: &[f64], information: f64) -> Predictor {
        Predictor {
            response: DMatrix::from_row_slice(1, response.len(), response),
            factor: DMatrix::identity(response.len(), response.len()) * information.sqrt(),
            deviation: vec![0.01],
            samples: 100,
        }
    }

    /// Feeds a plant with another response than the database's; returns the last prediction errors.
    fn adapt(truth: &[f64], known: &Predictor, ticks: u32) -> (f64, f64) {
        let mut adaptation = Adaptation::new(known);
        let mut last = (0.0, 0.0);
        for k in 0..ticks {
            let phi = [f64::from(k).sin(), f64::from(2 * k).cos()];
            let fixed = kernel::dot(known.response.as_slice(), &phi);
            let mut prediction = [fixed];
            adaptation.improve(&phi, &mut prediction);
            let y = kernel::dot(truth, &phi);
            last = (y - fixed, y - prediction[0]);
            adaptation.learn(known, &phi, &[y - prediction[0]]);
        }
        last
    }

    #[test]
    fn a_wrong_database_is_corrected() {
        let (fixed, adapted) = adapt(&[1.1, 0.45], &predictor(&[1.0, 0.5], 10.0), 4000);
        assert!(
            adapted.abs() < 0.02 * fixed.abs(),
            "{adapted} against {fixed}"
        );
    }

    #[test]
    fn a_response_that_strays_is_not_believed() {
        let (fixed, adapted) = adapt(&[-3.0, 0.5], &predictor(&[1.0, 0.5], 10.0), 4000);
        assert!(adapted.abs() <= fixed.abs() + 1e-12);
    }
}
