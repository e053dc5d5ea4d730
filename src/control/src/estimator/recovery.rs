//! Clears a sensor that was called faulty because of the disturbance.
//!
//! While a fault is declared nothing is learned, so a response to the disturbance that was learned
//! wrongly would have its sensor called faulty again and again. Time tells the two apart: over a whole
//! period, the disturbance leaves its harmonics alone, a fault leaves something else. Period by period,
//! what the plant's own response does not explain is fitted by a constant and the harmonics; where
//! the constant is small and nothing else remains, the sensor's learned response is replaced
//! by the fit, and its residual, now small, clears it.

use super::least_squares::LeastSquares;
use crate::kernel;
use crate::parameters::Harmonics;
use crate::tuning::DatabaseTuning;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The fit of one period, with `1 + q` regressors: a constant and the harmonics.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Recovery {
    /// The constant, then the harmonics (p x (1 + q)).
    fit: LeastSquares,
    regressor: Vec<f64>,
    /// Weighted sum of squared errors per sensor (p).
    unexplained: Vec<f64>,
    /// Sensors called faulty at some time in this period (p).
    was_flagged: Vec<bool>,
    samples: u64,
}

crate::state!(Recovery {
    parts: [fit, regressor, unexplained, was_flagged],
    constants: [],
    counters: [samples]
});

impl Recovery {
    /// Nothing seen yet.
    pub fn new(harmonics: &Harmonics, outputs: usize, tuning: &DatabaseTuning) -> Self {
        let size = 1 + 2 * harmonics.count;
        Self {
            fit: LeastSquares::with_variance(outputs, size, tuning.recovery_variance),
            regressor: vec![0.0; size],
            unexplained: vec![0.0; outputs],
            was_flagged: vec![false; outputs],
            samples: 0,
        }
    }

    /// Drops the period begun.
    pub fn restart(&mut self, tuning: &DatabaseTuning) {
        self.fit.restart(tuning.recovery_variance);
        self.unexplained.fill(0.0);
        self.was_flagged.fill(false);
        self.samples = 0;
    }

    /// Takes a sample: the sines and cosines (q), and per sensor what the plant's own response leaves
    /// and whether it is called faulty. Says whether a period is full.
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
        self.fit.aim(&self.regressor);
        let leverage = self.fit.leverage(&self.regressor);
        let scale = 1.0 / (1.0 + leverage);
        let sums = self.unexplained.iter_mut().zip(&mut self.was_flagged);
        let mut signals = sensors.zip(sums);
        self.fit.learn(leverage, 1.0, |row| {
            let Some(((value, flagged), (sum, was_flagged))) = signals.next() else {
                return 0.0;
            };
            *was_flagged |= flagged;
            let error = kernel::bounded(value) - kernel::dot(row, &self.regressor);
            // The squared error after the fit, by the recursion of least squares.
            *sum = kernel::bounded(*sum + scale * error * error);
            error
        });
        self.samples = self.samples.saturating_add(1);
        self.samples as f64 >= harmonics.period
    }

    /// The harmonics (q) that explain all that was seen of `sensor` up to `limit` (output units), if it was called
    /// faulty and they do. Where the disturbance was not `settled` yet, a constant fault may be left beside them.
    pub fn explanation(&self, sensor: usize, limit: f64, settled: bool) -> Option<&[f64]> {
        let (constant, waves) = self.fit.rows().nth(sensor)?.split_first()?;
        let mean_square = self.unexplained.get(sensor)? / self.samples.max(1) as f64;
        let no_bias = constant.abs() <= limit || !settled;
        let explained = mean_square <= limit * limit;
        (no_bias && explained && *self.was_flagged.get(sensor)?).then_some(waves)
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
        let mut recovery = Recovery::new(&KNOWN, 1, &DatabaseTuning::default());
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
        let waves = recovery.explanation(0, 0.05, true).unwrap();
        assert!(
            (waves[0] - 0.4 * 1f64.cos()).abs() < 1e-5
                && (waves[1] - 0.4 * 1f64.sin()).abs() < 1e-5
        );
    }

    /// A bias that was there from the start is told from the disturbance after a period.
    #[test]
    fn a_bias_beside_an_unknown_disturbance_is_left() {
        let recovery = watch(|k| 0.5 + 0.4 * (core::f64::consts::TAU * k / 50.0).sin());
        assert!(recovery.explanation(0, 0.05, true).is_none());
        let waves = recovery.explanation(0, 0.05, false).unwrap();
        assert!((waves[0] - 0.4).abs() < 1e-5 && waves[1].abs() < 1e-5);
    }

    #[test]
    fn a_fault_is_not_explained_away() {
        assert!(watch(|_| 0.4).explanation(0, 0.05, true).is_none());
        assert!(
            watch(|k| 0.01 * k - 0.25)
                .explanation(0, 0.05, true)
                .is_none()
        );
        assert!(
            watch(|k| if k < 25.0 { 0.4 } else { -0.4 })
                .explanation(0, 0.05, true)
                .is_none()
        );
    }
}
