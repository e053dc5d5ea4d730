//! Figures of merit: mean square error (63) and variance accounted for (64).

use serde::Serialize;

/// Both figures of one output, against the measured and against the true signal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[expect(
    clippy::exhaustive_structs,
    reason = "a new figure must be reported everywhere: the compiler says where"
)]
pub struct Merit {
    /// Mean square of the tracking error.
    pub mse: f64,
    /// Variance accounted for, in percent.
    pub vaf: f64,
}

/// Both figures of one signal, gathered sample by sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeritSum {
    square: f64,
    signal: Spread,
    error: Spread,
}

impl MeritSum {
    /// Adds a sample; one that is not a number (a lost sensor) is left out.
    pub fn add(&mut self, signal: f64, reference: f64) {
        if signal.is_finite() {
            let error = signal - reference;
            self.square += error * error;
            self.signal.add(signal);
            self.error.add(error);
        }
    }

    /// The mean square error, and `max(1 - var(y - y_ref) / var(y), 0)` in percent; zero where `y` does
    /// not vary.
    pub fn merit(&self) -> Merit {
        let total = self.signal.squares;
        Merit {
            mse: self.square / self.signal.count.max(1.0),
            vaf: match total > 0.0 {
                true => 100.0 * (1.0 - self.error.squares / total).max(0.0),
                false => 0.0,
            },
        }
    }
}

/// Mean and sum of squared deviations from it, updated value by value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Spread {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Spread {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let before = value - self.mean;
        self.mean += before / self.count;
        self.squares += before * (value - self.mean);
    }
}

/// Both figures at once. Samples that are not a number (a lost sensor) are left out.
pub fn merit(signal: &[f64], reference: &[f64]) -> Merit {
    let mut sum = MeritSum::default();
    for (y, r) in signal.iter().zip(reference) {
        sum.add(*y, *r);
    }
    sum.merit()
}

/// Mean square deviation from the mean; zero where there are no values.
pub fn variance(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_follower_has_no_error_and_all_variance() {
        let signal = [0.0, 1.0, 0.0, -1.0];
        assert_eq!(
            merit(&signal, &signal),
            Merit {
                mse: 0.0,
                vaf: 100.0
            }
        );
    }

    #[test]
    fn a_small_variance_about_a_large_mean_is_not_lost() {
        let signal: Vec<f64> = (0..1000).map(|k| 1e8 + f64::from(k % 2)).collect();
        let reference = vec![1e8 + 0.5; 1000];
        let found = merit(&signal, &reference);
        assert!(
            (found.mse - 0.25).abs() < 1e-12 && found.vaf == 0.0,
            "{found:?}"
        );
        let expected = variance(&signal);
        let mut sum = MeritSum::default();
        signal.iter().for_each(|&y| sum.add(y, 0.0));
        assert!((sum.signal.squares / 1000.0 - expected).abs() < 1e-9);
    }

    #[test]
    fn a_constant_offset_costs_error_but_no_variance() {
        let merit = merit(&[1.5, 2.5, 1.5, 0.5], &[1.0, 2.0, 1.0, 0.0]);
        assert_eq!(
            merit,
            Merit {
                mse: 0.25,
                vaf: 100.0
            }
        );
    }
}
