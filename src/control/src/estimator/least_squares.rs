//! Recursive least squares: one regressor, and so one covariance, for all sensors.

use crate::kernel;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A fit of `p` signals by `q` regressors.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct LeastSquares {
    /// Coefficients per signal (p x q, row after row).
    coefficients: Vec<f64>,
    /// Covariance in units of the noise variance (q x q, symmetric, row after row).
    covariance: Vec<f64>,
    /// Covariance times regressor (q).
    direction: Vec<f64>,
}

crate::state!(LeastSquares {
    parts: [coefficients, covariance, direction],
    constants: [],
    counters: []
});

impl LeastSquares {
    /// Zero coefficients for `signals` (p), with a covariance (q x q, row after row).
    pub fn new(signals: usize, regressors: usize, covariance: Vec<f64>) -> Self {
        Self {
            coefficients: vec![0.0; signals * regressors],
            covariance,
            direction: vec![0.0; regressors],
        }
    }

    /// The same with a multiple of the identity for covariance.
    pub fn with_variance(signals: usize, regressors: usize, variance: f64) -> Self {
        let mut fit = Self::new(signals, regressors, vec![0.0; regressors * regressors]);
        fit.restart(variance);
        fit
    }

    /// Back to the start.
    pub fn restart(&mut self, variance: f64) {
        self.coefficients.fill(0.0);
        self.covariance.fill(0.0);
        self.diagonal().for_each(|value| *value = variance);
    }

    /// Takes the coefficients (p x q, row after row) as `coefficients` leaves them, starting from zero,
    /// and the covariance of `other` raised by `variance`.
    pub fn start_from(
        &mut self,
        other: &Self,
        coefficients: impl FnOnce(&mut [f64]),
        variance: impl FnOnce(&Self) -> f64,
    ) {
        self.coefficients.fill(0.0);
        coefficients(&mut self.coefficients);
        kernel::bound(&mut self.coefficients);
        let variance = kernel::bounded(variance(self));
        kernel::copy(&mut self.covariance, &other.covariance);
        self.diagonal()
            .for_each(|value| *value = kernel::bounded(*value + variance));
    }

    fn diagonal(&mut self) -> impl Iterator<Item = &mut f64> {
        let step = self.direction.len() + 1;
        self.covariance.iter_mut().step_by(step)
    }

    fn regressors(&self) -> usize {
        self.direction.len().max(1)
    }

    /// The coefficients of each signal (q).
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.coefficients.chunks_exact(self.regressors())
    }

    /// The coefficients of one signal (q).
    pub fn row_mut(&mut self, signal: usize) -> Option<&mut [f64]> {
        let size = self.regressors();
        self.coefficients.chunks_exact_mut(size).nth(signal)
    }

    /// What the fit says of each signal under a regressor (q).
    pub fn responses(&self, regressor: &[f64]) -> impl Iterator<Item = f64> {
        self.rows().map(|row| kernel::dot(row, regressor))
    }

    /// Points the next [`learn`](Self::learn) and [`leverage`](Self::leverage) at a regressor (q).
    pub fn aim(&mut self, regressor: &[f64]) {
        let rows = self.covariance.chunks_exact(self.direction.len().max(1));
        for (value, row) in self.direction.iter_mut().zip(rows) {
            *value = kernel::dot(row, regressor);
        }
    }

    /// Variance of what the fit says under the regressor that was aimed at, in units of the noise variance.
    pub fn leverage(&self, regressor: &[f64]) -> f64 {
        kernel::dot(&self.direction, regressor).max(0.0)
    }

    /// One step under the regressor that was aimed at; `leverage` is that regressor's. Older samples keep the
    /// weight `keep`, in (0, 1]. `error` tells for each signal, in order, by how much its coefficients
    /// were wrong.
    pub fn learn(&mut self, leverage: f64, keep: f64, mut error: impl FnMut(&[f64]) -> f64) {
        let scale = 1.0 / (keep + leverage);
        let size = self.regressors();
        for row in self.coefficients.chunks_exact_mut(size) {
            let error = error(row);
            kernel::add_scaled(row, scale * error, &self.direction);
            kernel::bound(row);
        }
        kernel::subtract_square(&mut self.covariance, scale, &self.direction);
        if keep < 1.0 {
            self.covariance.iter_mut().for_each(|value| *value /= keep);
        }
        kernel::bound(&mut self.covariance);
    }
}
