//! Figures of merit: mean square error (63) and variance accounted for (64).

use serde::Serialize;

/// Both figures of one output, against the measured and against the true signal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Merit {
    /// Mean square of the tracking error.
    pub mse: f64,
    /// Variance accounted for, in percent.
    pub vaf: f64,
}

/// Mean square error of `signal` about `reference`.
pub fn mean_square_error(signal: &[f64], reference: &[f64]) -> f64 {
    let sum: f64 = signal
        .iter()
        .zip(reference)
        .map(|(y, r)| (y - r) * (y - r))
        .sum();
    sum / signal.len().max(1) as f64
}

/// `max(1 - var(y - y_ref) / var(y), 0)` in percent; zero where `y` does not vary.
pub fn variance_accounted_for(signal: &[f64], reference: &[f64]) -> f64 {
    let error: Vec<f64> = signal.iter().zip(reference).map(|(y, r)| y - r).collect();
    let total = variance(signal);
    if total > 0.0 {
        100.0 * (1.0 - variance(&error) / total).max(0.0)
    } else {
        0.0
    }
}

/// Both figures at once. Samples that are not a number (a lost sensor) are left out.
pub fn merit(signal: &[f64], reference: &[f64]) -> Merit {
    let (signal, reference): (Vec<f64>, Vec<f64>) = signal
        .iter()
        .zip(reference)
        .filter(|(y, _)| y.is_finite())
        .map(|(y, r)| (*y, *r))
        .unzip();
    Merit {
        mse: mean_square_error(&signal, &reference),
        vaf: variance_accounted_for(&signal, &reference),
    }
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
