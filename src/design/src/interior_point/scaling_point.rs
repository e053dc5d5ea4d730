//! The Nesterov-Todd scaling point of a slack `S` and its multiplier `X`.

use super::dense::{
    Triangular, congruence, symmetric, times, transposed_congruence, transposed_times,
};
use nalgebra::{DMatrix, DVector};

/// `G` with `G^-1 S G^-T = G' X G = diag(lambda)`, and `W = G^-T G^-1`, so that `W S W = X`.
pub(super) struct ScalingPoint {
    /// `G^-1` (size x size).
    inverse: DMatrix<f64>,
    /// `lambda`: roots of the eigenvalues of `S X`.
    pub lambda: DVector<f64>,
    /// `W`.
    pub weight: DMatrix<f64>,
}

impl ScalingPoint {
    /// `None` where `S` or `X` is not positive definite to working precision.
    pub fn new(slack: &DMatrix<f64>, multiplier: &DMatrix<f64>) -> Option<Self> {
        let lower = Triangular::factor(slack.clone())?;
        let dual = Triangular::factor(multiplier.clone())?.lower();
        let size = slack.nrows();
        let mut unlower = DMatrix::identity(size, size);
        lower.solve_lower(&mut unlower);
        let lower = lower.lower();
        let between = transposed_times(&dual, &lower);
        let gram = symmetric(transposed_times(&between, &between));
        let eigen = gram.symmetric_eigen();
        let smallest = f64::EPSILON.powi(2) * eigen.eigenvalues.max();
        if smallest.is_nan() || smallest <= 0.0 {
            return None;
        }
        let lambda = eigen.eigenvalues.map(|value| value.max(smallest).sqrt());
        let mut inverse = transposed_times(&eigen.eigenvectors, &unlower);
        for (k, value) in lambda.iter().enumerate() {
            inverse.row_mut(k).scale_mut(value.sqrt());
        }
        let weight = symmetric(transposed_times(&inverse, &inverse));
        Some(Self {
            inverse,
            lambda,
            weight,
        })
    }

    /// `G^-1 D G^-T` of a direction of the slack.
    pub fn scaled_slack(&self, direction: &DMatrix<f64>) -> DMatrix<f64> {
        symmetric(congruence(&self.inverse, direction))
    }

    /// `G^-T D G^-1`: the multiplier of a scaled multiplier.
    pub fn multiplier(&self, scaled: &DMatrix<f64>) -> DMatrix<f64> {
        symmetric(transposed_congruence(&self.inverse, scaled))
    }

    /// The longest step, at most 1, along a scaled direction of slack or multiplier.
    pub fn longest_step(&self, scaled: &DMatrix<f64>) -> f64 {
        let roots = self.lambda.map(f64::sqrt);
        let relative = DMatrix::from_fn(scaled.nrows(), scaled.ncols(), |r, c| {
            scaled[(r, c)] / (roots[r] * roots[c])
        });
        let least = relative.symmetric_eigenvalues().min();
        if least >= 0.0 {
            1.0
        } else {
            (-1.0 / least).min(1.0)
        }
    }

    /// The scaled right-hand side of the corrector: `lambda o (ds + dx) = centre I - lambda^2 - ds o dx`.
    pub fn corrected(
        &self,
        centre: f64,
        slack: &DMatrix<f64>,
        multiplier: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let second = times(slack, multiplier);
        DMatrix::from_fn(second.nrows(), second.ncols(), |r, c| {
            let mixed = 0.5 * (second[(r, c)] + second[(c, r)]);
            let mean = 0.5 * (self.lambda[r] + self.lambda[c]);
            if r == c {
                (centre - mixed) / mean - self.lambda[r]
            } else {
                -mixed / mean
            }
        })
    }

    /// `-diag(lambda)`: the scaled right-hand side of the predictor.
    pub fn predicted(&self) -> DMatrix<f64> {
        -DMatrix::from_diagonal(&self.lambda)
    }
}
