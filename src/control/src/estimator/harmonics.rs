//! The response to the periodic disturbance, learned while no fault is declared.
//!
//! With the period known, the disturbance adds to each output a sum of sines and cosines whose
//! coefficients are not known beforehand. Recursive least squares with forgetting learns them;
//! the regressor is the same for every sensor, so one covariance serves all. While a fault is
//! declared nothing is learned and the last coefficients extrapolate.

use super::least_squares::LeastSquares;
use crate::kernel;
use crate::parameters::{Harmonics, PhasorMap};
use crate::tuning::DatabaseTuning;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// What was learned in one mode, with `q = 2 x harmonics` regressors.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct HarmonicState {
    /// Sines and cosines that fit the residuals (p).
    fit: LeastSquares,
    /// `[sin(w k), cos(w k), sin(2 w k), ...]` (q).
    regressor: Vec<f64>,
    /// Samples learned from.
    samples: u64,
}

crate::state!(HarmonicState {
    parts: [fit, regressor],
    constants: [],
    counters: [samples]
});

impl HarmonicState {
    /// Nothing learned yet.
    pub fn new(harmonics: &Harmonics, outputs: usize) -> Self {
        let size = 2 * harmonics.count;
        Self {
            fit: LeastSquares::with_variance(outputs, size, harmonics.initial_variance),
            regressor: vec![0.0; size],
            samples: 0,
        }
    }

    /// Sets the regressor of tick `tick`.
    pub fn rotate(&mut self, harmonics: &Harmonics, tick: u64) {
        let turns = libm::fmod(tick as f64, harmonics.period) / harmonics.period;
        for (index, pair) in self.regressor.chunks_exact_mut(2).enumerate() {
            let angle = core::f64::consts::TAU * turns * (index + 1) as f64;
            if let [sine, cosine] = pair {
                (*sine, *cosine) = libm::sincos(angle);
            }
        }
    }

    /// Adds the learned response to `outputs` (p).
    pub fn add_response(&self, outputs: &mut [f64]) {
        for (output, response) in outputs.iter_mut().zip(self.responses()) {
            *output += response;
        }
    }

    /// Variance of the learned response, in units of the noise variance.
    pub fn leverage(&mut self) -> f64 {
        self.fit.aim(&self.regressor);
        self.fit.leverage(&self.regressor)
    }

    /// The sines and cosines of the last [`rotate`](Self::rotate) (q).
    pub fn regressor(&self) -> &[f64] {
        &self.regressor
    }

    /// The learned response of each sensor.
    pub fn responses(&self) -> impl Iterator<Item = f64> {
        self.fit.responses(&self.regressor)
    }

    /// Replaces what was learned of one sensor (q).
    pub fn replace(&mut self, sensor: usize, waves: &[f64]) {
        if let Some(row) = self.fit.row_mut(sensor) {
            kernel::copy(row, waves);
        }
    }

    /// Whether enough was learned to say something of another mode.
    pub fn is_known(&self, tuning: &DatabaseTuning) -> bool {
        self.samples as f64 >= tuning.samples_per_coefficient * self.regressor.len() as f64
    }

    /// Whether a whole period has been learned from.
    pub fn is_settled(&self, harmonics: &Harmonics) -> bool {
        self.samples as f64 >= harmonics.period
    }

    /// Starts from what `other` learned in another mode; `deviations` (p) are the sensors' noise levels.
    pub fn carry_over(
        &mut self,
        other: &Self,
        maps: &[PhasorMap],
        deviations: impl Iterator<Item = f64> + Clone,
        tuning: &DatabaseTuning,
    ) {
        let size = self.regressor.len().max(1);
        let moved = |coefficients: &mut [f64]| {
            for (harmonic, map) in maps.iter().enumerate() {
                let (sine, cosine) = (2 * harmonic, 2 * harmonic + 1);
                for (row, to) in coefficients.chunks_exact_mut(size).enumerate() {
                    for (column, from) in other.fit.rows().enumerate() {
                        let (Some(re), Some(im)) =
                            (map.real.get(row, column), map.imaginary.get(row, column))
                        else {
                            continue;
                        };
                        if let (Some(&a), Some(&b)) = (from.get(sine), from.get(cosine)) {
                            add_at(to, sine, re * a - im * b);
                            add_at(to, cosine, im * a + re * b);
                        }
                    }
                }
            }
        };
        let variance = |fit: &LeastSquares| {
            let rows = fit.rows().zip(deviations);
            let relative = rows.map(|(row, deviation)| {
                tuning.transfer_error * libm::sqrt(kernel::dot(row, row)) / deviation
            });
            let largest = relative.fold(0.0, f64::max);
            largest * largest
        };
        self.fit.start_from(&other.fit, moved, variance);
    }

    /// One step of recursive least squares on the residuals (p) of a healthy sample.
    /// Call [`rotate`](Self::rotate) and [`leverage`](Self::leverage) of the same tick first.
    pub fn learn(&mut self, harmonics: &Harmonics, residual: &[f64]) {
        self.samples = self.samples.saturating_add(1);
        let keep = 1.0 - 1.0 / harmonics.memory.max(2.0);
        let mut errors = residual.iter().copied();
        let leverage = self.fit.leverage(&self.regressor);
        self.fit
            .learn(leverage, keep, |_| errors.next().unwrap_or(0.0));
    }
}

/// Adds to one entry of a slice.
fn add_at(values: &mut [f64], index: usize, amount: f64) {
    if let Some(value) = values.get_mut(index) {
        *value += amount;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding once made the covariance asymmetric, and forgetting let that grow until, after some
    /// ten thousand samples, healthy sensors were flagged.
    #[test]
    fn learning_for_ever_stays_sound() {
        let harmonics = Harmonics {
            period: 71.11350685098513,
            count: 2,
            memory: 200.0,
            initial_variance: 33.4,
        };
        let mut state = HarmonicState::new(&harmonics, 1);
        let mut noise = [0.0];
        for k in 0..300_000 {
            ftc_plant::noise::standard_normal(5, k, &mut noise);
            state.rotate(&harmonics, k);
            let leverage = state.leverage();
            let mut predicted = [0.0];
            state.add_response(&mut predicted);
            let truth = libm::sin(core::f64::consts::TAU * k as f64 / harmonics.period);
            state.learn(&harmonics, &[truth + 0.01 * noise[0] - predicted[0]]);
            assert!(k < 1000 || leverage < 0.1, "leverage {leverage} at {k}");
            assert!(
                k < 1000 || (truth - predicted[0]).abs() < 0.02,
                "error at {k}"
            );
        }
    }

    #[test]
    fn learns_amplitude_and_phase_of_every_harmonic() {
        let harmonics = Harmonics {
            period: 31.7,
            count: 2,
            memory: 400.0,
            initial_variance: 1e6,
        };
        let mut state = HarmonicState::new(&harmonics, 1);
        let truth = |k: u64| {
            let angle = core::f64::consts::TAU * k as f64 / harmonics.period;
            0.7 * libm::sin(angle + 0.3) - 0.2 * libm::sin(2.0 * angle + 1.1)
        };
        let mut error = f64::INFINITY;
        for k in 0..200 {
            state.rotate(&harmonics, k);
            state.leverage();
            let mut predicted = [0.0];
            state.add_response(&mut predicted);
            error = truth(k) - predicted[0];
            state.learn(&harmonics, &[error]);
        }
        assert!(error.abs() < 1e-6, "still {error} off after six periods");
    }
}
