//! A way back for a sensor that was accused because of the disturbance.
//!
//! While a fault is declared nothing is learned, so a response to the disturbance that was learned
//! wrongly would accuse its sensor again and again. Time tells the two apart: over a whole period,
//! the disturbance leaves its harmonics alone, a fault leaves something else. Period by period,
//! what the plant's own response does not explain is fitted by a constant and the harmonics; where
//! the constant is small and nothing else remains, an accused sensor's learned response is replaced
//! by the fit, and its own, now small, residual clears it.

use crate::kernel;
use crate::parameters::Harmonics;
use crate::tuning::TUNING;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The fit of one period, with `1 + q` regressors: a constant and the harmonics.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Recovery {
    /// Coefficients per sensor (p x (1 + q), row after row), the constant first.
    coefficients: Vec<f64>,
    /// Covariance ((1 + q) x (1 + q)).
    covariance: Vec<f64>,
    regressor: Vec<f64>,
    direction: Vec<f64>,
    /// Weighted sum of squared errors per sensor (p).
    unexplained: Vec<f64>,
    /// Sensors accused at some time in this period (p).
    accused: Vec<bool>,
    samples: u64,
}

crate::state!(Recovery {
    parts: [
        coefficients,
        covariance,
        regressor,
        direction,
        unexplained,
        accused
    ],
    constants: [],
    counters: [samples]
});

impl Recovery {
    /// Nothing seen yet.
    pub fn new(harmonics: &Harmonics, outputs: usize) -> Self {
        let size = 1 + 2 * harmonics.count;
        let mut fresh = Self {
            coefficients: vec![0.0; outputs * size],
            covariance: vec![0.0; size * size],
            regressor: vec![0.0; size],
            direction: vec![0.0; size],
            unexplained: vec![0.0; outputs],
            accused: vec![false; outputs],
            samples: 0,
        };
        fresh.restart();
        fresh
    }

    /// Forgets the period begun.
    pub fn restart(&mut self) {
        let size = self.regressor.len();
        self.coefficients.fill(0.0);
        self.covariance.fill(0.0);
        self.covariance
            .iter_mut()
            .step_by(size + 1)
            .for_each(|v| *v = TUNING.recovery_variance);
        self.unexplained.fill(0.0);
        self.accused.fill(false);
        self.samples = 0;
    }

    /// Takes a sample: the sines and cosines (q), and per sensor what the plant's own response leaves
    /// and whether it is accused. Says whether a period is full.
    pub fn watch(
        &mut self,
        harmonics: &Harmonics,
        waves: &[f64],
        sensors: impl Iterator<Item = (f64, bool)>,
    ) -> bool {
        if let Some((constant, rest)) = self.regressor.split_first_mut() {
            *constant = 1.0;
            kernel::copy(rest, waves);
        }
        let size = self.regressor.len().max(1);
        for (value, row) in self
            .direction
            .iter_mut()
            .zip(self.covariance.chunks_exact(size))
        {
            *value = kernel::dot(row, &self.regressor);
        }
        let scale = 1.0 / (1.0 + kernel::dot(&self.direction, &self.regressor).max(0.0));
        let rows = self.coefficients.chunks_exact_mut(size).zip(sensors);
        let sums = self.unexplained.iter_mut().zip(&mut self.accused);
        for ((row, (value, flagged)), (sum, accused)) in rows.zip(sums) {
            *accused |= flagged;
            let error = kernel::bounded(value) - kernel::dot(row, &self.regressor);
            kernel::add_scaled(row, scale * error, &self.direction);
            kernel::bound(row);
            // The squared error after the fit, by the recursion of least squares.
            *sum = kernel::bounded(*sum + scale * error * error);
        }
        kernel::subtract_square(&mut self.covariance, scale, &self.direction);
        kernel::bound(&mut self.covariance);
        self.samples = self.samples.saturating_add(1);
        self.samples as f64 >= harmonics.period
    }

    /// The harmonics (q) that explain all that was seen of `sensor`, if it was accused and they do.
    /// Where the disturbance was not `settled` yet, a constant fault may be left beside them.
    pub fn acquittal(&self, sensor: usize, threshold: f64, settled: bool) -> Option<&[f64]> {
        let size = self.regressor.len().max(1);
        let (constant, waves) = self
            .coefficients
            .chunks_exact(size)
            .nth(sensor)?
            .split_first()?;
        let mean_square = self.unexplained.get(sensor)? / self.samples.max(1) as f64;
        let limit = TUNING.recovery_share * threshold;
        let innocent = constant.abs() <= limit || !settled;
        let explained = mean_square <= limit * limit;
        (innocent && explained && *self.accused.get(sensor)?).then_some(waves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::HarmonicState;

    const KNOWN: Harmonics = Harmonics {
        period: 50.0,
        count: 1,
        memory: 500.0,
        initial_variance: 1e6,
    };

    fn watch(residual: impl Fn(f64) -> f64) -> Recovery {
        let mut recovery = Recovery::new(&KNOWN, 1);
        let mut waves = HarmonicState::new(&KNOWN, 1);
        for k in 0..50 {
            waves.rotate(&KNOWN, k);
            let sensor = (residual(k as f64), k == 7);
            let full = recovery.watch(&KNOWN, waves.regressor(), [sensor].into_iter());
            assert_eq!(full, k == 49);
        }
        recovery
    }

    #[test]
    fn a_wrong_response_is_recognised() {
        let recovery = watch(|k| 0.4 * (core::f64::consts::TAU * k / 50.0 + 1.0).sin());
        let waves = recovery.acquittal(0, 0.1, true).unwrap();
        assert!(
            (waves[0] - 0.4 * 1f64.cos()).abs() < 1e-5
                && (waves[1] - 0.4 * 1f64.sin()).abs() < 1e-5
        );
    }

    /// A bias that was there from the start is told from the disturbance after a period.
    #[test]
    fn a_bias_beside_an_unknown_disturbance_is_left() {
        let recovery = watch(|k| 0.5 + 0.4 * (core::f64::consts::TAU * k / 50.0).sin());
        assert!(recovery.acquittal(0, 0.1, true).is_none());
        let waves = recovery.acquittal(0, 0.1, false).unwrap();
        assert!((waves[0] - 0.4).abs() < 1e-5 && waves[1].abs() < 1e-5);
    }

    #[test]
    fn a_fault_is_not_explained_away() {
        assert!(watch(|_| 0.4).acquittal(0, 0.1, true).is_none());
        assert!(watch(|k| 0.01 * k - 0.25).acquittal(0, 0.1, true).is_none());
        assert!(
            watch(|k| if k < 25.0 { 0.4 } else { -0.4 })
                .acquittal(0, 0.1, true)
                .is_none()
        );
    }
}
