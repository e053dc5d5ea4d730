//! Kalman filters in correction form: `x_hat = prior + H (y - C prior)`.
//!
//! The stationary filter of a mode for process noise `E E' + q I` and sensor noise
//! `lambda^2 R0 + F F'`, all in per-unit and per unit of the disturbance. `lambda`, the ratio of the
//! two noises, is what a design chooses: a small one trusts the sensors, a large one the model.

use super::existence::PerUnit;
use crate::augmented::scaled;
use crate::riccati;
use ftc_plant::Mode;
use nalgebra::DMatrix;

/// Process noise on every state beside the disturbance, relative to the largest of `E E'`: without
/// it a stable state that no disturbance moves would not be corrected at all.
const PROCESS_FLOOR: f64 = 1e-6;

/// A mode as a filter sees it, in per-unit.
pub(crate) struct Filtered {
    /// `A` (n x n).
    pub a: DMatrix<f64>,
    /// `C` (p x n).
    pub c: DMatrix<f64>,
    /// Covariance of the process noise (n x n).
    process: DMatrix<f64>,
    /// Standard deviation of each sensor's noise (p), up to the factor `lambda`.
    noise: Vec<f64>,
    /// `F` (p x s).
    feedthrough: DMatrix<f64>,
}

impl Filtered {
    /// `noise` holds the sensors' deviations relative to each other (p), in output units.
    pub fn new(mode: &Mode, units: &PerUnit, noise: &[f64]) -> Self {
        let (n, s) = mode.e.shape();
        let channels = vec![1.0; s];
        let mut e = scaled(&mode.e, units.states, &channels);
        let mut f = scaled(&mode.f, units.outputs, &channels);
        if e.amax() == 0.0 && f.amax() == 0.0 {
            // No disturbance is known: the inputs move the state.
            let inputs = vec![1.0; mode.b.ncols()];
            e = scaled(&mode.b, units.states, &inputs);
            f = DMatrix::zeros(mode.c.nrows(), inputs.len());
        }
        let size = if e.amax() > 0.0 { e.amax() } else { f.amax() };
        if size > 0.0 {
            e /= size;
            f /= size;
        }
        let floor = PROCESS_FLOOR * DMatrix::<f64>::identity(n, n);
        let deviations = noise.iter().zip(units.outputs).map(|(d, unit)| d / unit);
        Self {
            a: units.a(mode),
            c: units.c(mode),
            process: &e * e.transpose() + floor,
            noise: deviations.collect(),
            feedthrough: f,
        }
    }

    /// The rows of `C` whose sensors are not in `lost`, and their indices.
    pub fn kept(&self, lost: &[usize]) -> (DMatrix<f64>, Vec<usize>) {
        let kept: Vec<usize> = (0..self.c.nrows()).filter(|k| !lost.contains(k)).collect();
        (self.c.select_rows(&kept), kept)
    }

    /// The stationary gain `H` (n x p) without the sensors in `lost`, whose columns are zero; `None`
    /// where the filter does not exist.
    pub fn gain(&self, lost: &[usize], ratio: f64) -> Option<DMatrix<f64>> {
        let (n, p) = (self.a.nrows(), self.c.nrows());
        let (c, kept) = self.kept(lost);
        let mut gain = DMatrix::zeros(n, p);
        if kept.is_empty() {
            return Some(gain);
        }
        let f = self.feedthrough.select_rows(&kept);
        let mut sensor = &f * f.transpose();
        for (k, &row) in kept.iter().enumerate() {
            sensor[(k, k)] += (ratio * self.noise[row]).powi(2);
        }
        let found = riccati::filter_gain(&self.a, &c, &self.process, &sensor)?;
        for (k, &column) in kept.iter().enumerate() {
            gain.set_column(column, &found.column(k));
        }
        gain.iter().all(|value| value.is_finite()).then_some(gain)
    }

    /// `A (I - H C)`: what a filter leaves of the error of its prediction, one sample on.
    pub fn error(&self, gain: &DMatrix<f64>) -> DMatrix<f64> {
        &self.a - &self.a * gain * &self.c
    }

    /// `P^-1 C' (C P^-1 C')^+` without the lost sensors: of all gains, the one that makes the error's
    /// dynamics smallest in the norm of `P`; `inverse` is `P^-1`.
    pub fn projection(&self, lost: &[usize], inverse: &DMatrix<f64>) -> DMatrix<f64> {
        let (c, kept) = self.kept(lost);
        let mut gain = DMatrix::zeros(self.a.nrows(), self.c.nrows());
        let across = inverse * c.transpose();
        let seen = riccati::symmetric(&c * &across);
        let found = across * crate::pseudo_inverse::pseudo_inverse(&seen, 1e-12);
        for (k, &column) in kept.iter().enumerate() {
            gain.set_column(column, &found.column(k));
        }
        gain
    }
}
