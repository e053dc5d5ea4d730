//! Gated adaptation of the response: the database goes on growing with healthy samples.
//!
//! Recursive least squares without forgetting continues the fit of the database with healthy
//! samples, so it starts from everything the database knows and moves the less the more it has
//! seen. It must never increase the error, hence:
//!
//! * no decision depends on it: sensors are judged by the database alone, and only the estimate of a
//!   fault that is declared, or of a reading that is missing, is refined. Otherwise a fault that
//!   grows below its threshold would be followed, and never declared;
//! * it learns only from samples in which every sensor was judged healthy and the database's error
//!   was small: a few noise deviations, and a share of what is predicted. A plant that changed errs
//!   in proportion to what it does; a fault below its threshold does not;
//! * what it adds to a prediction keeps within the same bounds, whatever it has learned;
//! * it is used, sensor by sensor, only while its predictions have been better than those of the
//!   database alone, both judged before learning from the sample.

use super::least_squares::LeastSquares;
use crate::kernel;
use crate::matrix::Matrix;
use crate::parameters::Predictor;
use crate::tuning::DatabaseTuning;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// The adapted response of one mode, with `q = m j` regressors.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Adaptation {
    /// Adapted less database response (p x q).
    change: LeastSquares,
    /// What the change would add to the prediction, as learned (p).
    addition: Vec<f64>,
    /// The largest change of each output that is admitted in this sample (p).
    bound: Vec<f64>,
    /// Running means of the squared errors of the database's prediction (p).
    fixed_error: Vec<f64>,
    /// And of the adapted one (p).
    adapted_error: Vec<f64>,
}

crate::state!(Adaptation {
    parts: [change, addition, bound, fixed_error, adapted_error],
    constants: [],
    counters: []
});

impl Adaptation {
    /// Nothing learned beyond the database.
    pub fn new(predictor: &Predictor) -> Self {
        let (outputs, size) = predictor.response.shape();
        Self {
            change: LeastSquares::new(outputs, size, covariance(&predictor.factor)),
            addition: vec![0.0; outputs],
            bound: vec![0.0; outputs],
            fixed_error: vec![0.0; outputs],
            adapted_error: vec![0.0; outputs],
        }
    }

    /// Takes in a sample's `regressor` (q) and the database's `prediction` (p) from it; `y0` (p) is the
    /// output of the mode's operating point.
    pub fn predict(
        &mut self,
        predictor: &Predictor,
        regressor: &[f64],
        y0: &[f64],
        prediction: &[f64],
        tuning: &DatabaseTuning,
    ) {
        let changes = self.change.responses(regressor);
        for (addition, change) in self.addition.iter_mut().zip(changes) {
            *addition = kernel::bounded(change);
        }
        let outputs = prediction.iter().zip(y0).zip(&predictor.deviation);
        for (bound, ((value, centre), deviation)) in self.bound.iter_mut().zip(outputs) {
            *bound = kernel::bounded(
                tuning.adaptation_change * (value - centre).abs()
                    + tuning.adaptation_deviations * deviation,
            );
        }
    }

    /// What to add to the database's prediction of each sensor (p): nothing where that did not prove better.
    pub fn additions(&self, tuning: &DatabaseTuning) -> impl Iterator<Item = f64> {
        let scores = self.fixed_error.iter().zip(&self.adapted_error);
        let additions = self.addition.iter().zip(&self.bound);
        additions
            .zip(scores)
            .map(|((&addition, &bound), (&fixed, &adapted))| {
                if adapted < tuning.adaptation_advantage * fixed {
                    addition.clamp(-bound, bound)
                } else {
                    0.0
                }
            })
    }

    /// Learns from a healthy sample, the one last [predicted](Self::predict). `error` (p) is that of the
    /// database's prediction.
    pub fn learn(&mut self, regressor: &[f64], error: &[f64], tuning: &DatabaseTuning) {
        let plausible = |(error, bound): (&f64, &f64)| error.abs() <= *bound;
        if !error.iter().zip(&self.bound).all(plausible) {
            return;
        }
        let memory = tuning.adaptation_memory;
        let scores = self.fixed_error.iter_mut().zip(&mut self.adapted_error);
        let additions = self.addition.iter().zip(&self.bound);
        let mut left = error.iter().zip(additions).zip(scores).map(
            |((&error, (&addition, &bound)), (fixed, adapted))| {
                update_mean(fixed, error, memory);
                update_mean(adapted, error - addition.clamp(-bound, bound), memory);
                error - addition
            },
        );
        self.change.aim(regressor);
        let leverage = self.change.leverage(regressor);
        self.change
            .learn(leverage, 1.0, |_| left.next().unwrap_or(0.0));
    }
}

/// Takes an error into a running mean of squares.
fn update_mean(mean: &mut f64, error: f64, memory: f64) {
    *mean = kernel::bounded(memory * *mean + (1.0 - memory) * error * error);
}

/// `(R'R)^-1`, row after row: what the database leaves open.
fn covariance(factor: &Matrix) -> Vec<f64> {
    let size = factor.nrows();
    let inverse = inverse_rows(factor);
    let row = |index: usize| &inverse[index * size..(index + 1) * size];
    let mut covariance = vec![0.0; size * size];
    for i in 0..size {
        for j in i..size {
            // Of an upper triangle, what stands left of the diagonal is zero.
            let entry = kernel::bounded(kernel::dot(&row(i)[j..], &row(j)[j..]));
            covariance[i * size + j] = entry;
            covariance[j * size + i] = entry;
        }
    }
    covariance
}

/// The inverse of an upper triangular matrix, row after row, by back substitution; zero where it is
/// singular.
fn inverse_rows(factor: &Matrix) -> Vec<f64> {
    let size = factor.nrows();
    let mut inverse = vec![0.0; size * size];
    if factor.ncols() != size || (0..size).any(|i| factor.get(i, i).is_none_or(|d| d == 0.0)) {
        return inverse;
    }
    for index in (0..size).rev() {
        let (row, below) = inverse[index * size..].split_at_mut(size);
        row[index] = 1.0;
        for (k, entry) in factor.row(index).enumerate().skip(index + 1) {
            kernel::add_scaled(
                row,
                -entry,
                &below[(k - index - 1) * size..(k - index) * size],
            );
        }
        let pivot = factor.as_slice()[index * size + index];
        row.iter_mut().for_each(|value| *value /= pivot);
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    fn predictor(response: &[f64], information: f64) -> Predictor {
        Predictor {
            response: Matrix::from_fn(1, response.len(), |_, column| response[column]),
            factor: Matrix::identity(response.len()).scaled(information.sqrt()),
            deviation: vec![0.01],
            samples: 100,
        }
    }

    /// Feeds a plant with another response than the database's; returns the last prediction errors.
    fn adapt(truth: &[f64], known: &Predictor, ticks: u32) -> (f64, f64) {
        let tuning = DatabaseTuning::default();
        let mut adaptation = Adaptation::new(known);
        let mut last = (0.0, 0.0);
        for k in 0..ticks {
            let phi = [f64::from(k).sin(), f64::from(2 * k).cos()];
            let fixed = kernel::dot(known.response.as_slice(), &phi);
            adaptation.predict(known, &phi, &[0.0], &[fixed], &tuning);
            let error = kernel::dot(truth, &phi) - fixed;
            last = (error, error - adaptation.additions(&tuning).sum::<f64>());
            adaptation.learn(&phi, &[error], &tuning);
        }
        last
    }

    #[test]
    fn the_covariance_is_the_inverse_of_the_gram_matrix() {
        let factor = Matrix::from_rows(&[[2.0, 1.0, -3.0], [0.0, 4.0, 0.5], [0.0, 0.0, -1.0]]);
        let r = nalgebra::DMatrix::from_column_slice(3, 3, factor.as_slice());
        let wanted = (r.transpose() * r).try_inverse().unwrap();
        for (got, want) in covariance(&factor).iter().zip(wanted.iter()) {
            assert!((got - want).abs() < 1e-12, "{got} for {want}");
        }
        assert_eq!(covariance(&Matrix::zeros(2, 2)), [0.0; 4]);
    }

    #[test]
    fn a_wrong_database_is_corrected() {
        let (fixed, adapted) = adapt(&[1.02, 0.49], &predictor(&[1.0, 0.5], 10.0), 4000);
        assert!(
            adapted.abs() < 0.02 * fixed.abs(),
            "{adapted} against {fixed}"
        );
    }

    #[test]
    fn a_response_that_strays_is_not_used() {
        let (fixed, adapted) = adapt(&[-3.0, 0.5], &predictor(&[1.0, 0.5], 10.0), 4000);
        assert!(adapted.abs() <= fixed.abs() + 1e-12);
    }

    /// A fault that grows slowly enough to stay undetected was once followed to any size.
    #[test]
    fn a_fault_that_grows_unseen_is_not_followed() {
        let known = predictor(&[1.0, 0.5], 10.0);
        let tuning = DatabaseTuning::default();
        let mut adaptation = Adaptation::new(&known);
        for k in 0..4000 {
            let phi = [1.0, 0.2];
            adaptation.predict(&known, &phi, &[0.0], &[1.1], &tuning);
            adaptation.learn(&phi, &[1e-3 * f64::from(k)], &tuning);
            let added: f64 = adaptation.additions(&tuning).sum();
            assert!(
                added <= tuning.adaptation_change * 1.1 + tuning.adaptation_deviations * 0.01,
                "{added} at {k}"
            );
        }
    }
}
