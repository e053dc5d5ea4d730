//! The parameters that explain windows best: Gauss-Newton, and which matrices are worth a change.

use super::model::GreyBox;
use super::parameters::MatrixName;
use super::windows::Segment;
use nalgebra::{DMatrix, DVector};

/// Steps of the iteration, at most; none improves by less than this share where it ends.
const ITERATIONS: usize = 10;
const CONVERGED: f64 = 1e-4;

/// The inputs of a log act a sample later than their rows say where this leaves less than this share of the
/// variance that is left otherwise, by the model as by what is fitted.
const LATE: f64 = 0.5;

/// Error of what is taken for known, relative to what it could be.
const KNOWN: f64 = 1e-6;

impl GreyBox<'_> {
    /// The parameters that explain the windows best, and the relative error of the model that remains. The maps to
    /// the outputs and those of the disturbance are the design's unless the windows say otherwise: what is as probable without a
    /// change of theirs is not changed.
    pub(super) fn choose(&mut self, windows: &[Segment], model_error: f64) -> (DVector<f64>, f64) {
        let prior = self.prior.clone();
        let groups: [&[MatrixName]; 2] = [&[MatrixName::C], &MatrixName::OF_DISTURBANCE];
        let mut fixed: Vec<MatrixName> = groups.concat();
        self.prior = self.held(&prior, &fixed);
        let (mut theta, mut remaining) = self.improve(windows, model_error);
        for group in groups {
            let (before, known) = (fixed.clone(), self.prior.clone());
            fixed.retain(|matrix| !group.contains(matrix));
            self.prior = self.held(&prior, &fixed);
            let (freed, of_freed) = self.improve(windows, model_error);
            let with = self.evidence(windows, &freed);
            self.prior = known;
            if with > self.evidence(windows, &theta) {
                (theta, remaining) = (freed, of_freed);
                self.prior = self.held(&prior, &fixed);
            } else {
                fixed = before;
            }
        }
        for (at, of) in self.parameters.iter().enumerate() {
            if fixed.contains(&of.entry.matrix) {
                theta[at] = of.design;
            }
        }
        (theta, remaining)
    }

    /// The `prior` if the `fixed` matrices are known.
    pub(super) fn held(&self, prior: &DVector<f64>, fixed: &[MatrixName]) -> DVector<f64> {
        let each = self.parameters.iter().zip(prior.iter());
        let each = each.map(|(of, prior)| match fixed.contains(&of.entry.matrix) {
            true => KNOWN * prior,
            false => *prior,
        });
        DVector::from_iterator(prior.len(), each)
    }

    /// Logarithm of the probability of the windows, up to a constant (Laplace).
    fn evidence(&self, windows: &[Segment], theta: &DVector<f64>) -> f64 {
        let Some((normal, _)) = self.step(windows, theta) else {
            return f64::NEG_INFINITY;
        };
        let scaled = DMatrix::from_fn(theta.len(), theta.len(), |i, j| {
            self.prior[i] * normal[(i, j)] * self.prior[j] + f64::from(u8::from(i == j))
        });
        let Some(factor) = scaled.cholesky() else {
            return f64::NEG_INFINITY;
        };
        let volume: f64 = factor.l().diagonal().iter().map(|value| value.ln()).sum();
        -0.5 * self.cost(windows, theta) - volume
    }

    /// The parameters that explain the windows best, and the relative error of the model that remains.
    fn improve(&mut self, windows: &[Segment], model_error: f64) -> (DVector<f64>, f64) {
        let (mut theta, mut remaining) = (self.design.clone(), model_error);
        for _ in 0..ITERATIONS {
            self.deviation = self.residual_deviation(windows, &theta);
            let Some((normal, step)) = self.step(windows, &theta) else {
                break;
            };
            let before = self.cost(windows, &theta);
            let mut tried = (0..6).map(|halvings| {
                let next = &theta + 0.5_f64.powi(halvings) * &step;
                (self.cost(windows, &next), next)
            });
            let Some((cost, better)) = tried.find(|(cost, _)| *cost <= before) else {
                break;
            };
            theta = better;
            let variance = self.remaining_variance(&normal, &theta).unwrap_or(1.0);
            remaining = model_error * variance.sqrt();
            if before - cost <= CONVERGED * before {
                break;
            }
        }
        (theta, remaining)
    }

    /// The mode in which the inputs act a sample later than their rows say: neither the model nor what is fitted
    /// explains the `windows` nearly as well as the same does those where they do (`late`).
    pub(super) fn late(
        &mut self,
        windows: &[Segment],
        late: &[Segment],
        theta: &DVector<f64>,
        model_error: f64,
    ) -> Option<usize> {
        let suspect = |grey: &Self, [one, other]: [&DVector<f64>; 2]| {
            let found = grey.residual_deviation(windows, one);
            let later = grey.residual_deviation(late, other);
            let mut modes = found.iter().zip(&later);
            modes.position(|(found, later)| {
                let ratio = later.component_div(found);
                ratio.norm_squared() < LATE * ratio.len() as f64
            })
        };
        let model = self.design.clone();
        suspect(self, [&model, &model])?;
        let (of_late, _) = self.improve(late, model_error);
        suspect(self, [theta, &of_late])
    }

    /// Sum of squares of the residuals, in units of the deviations.
    pub(super) fn sum_of_squares(&self, windows: &[Segment], theta: &DVector<f64>) -> f64 {
        let modes = self.matrices(theta);
        let squares = |window| self.explain(window, &modes).residual.norm_squared();
        windows.iter().map(squares).sum()
    }

    fn cost(&self, windows: &[Segment], theta: &DVector<f64>) -> f64 {
        let moved = (theta - &self.design).component_div(&self.prior);
        self.sum_of_squares(windows, theta) + moved.norm_squared()
    }

    /// The data's normal matrix, and the step of Gauss and Newton.
    pub(super) fn step(
        &self,
        windows: &[Segment],
        theta: &DVector<f64>,
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let count = theta.len();
        let modes = self.matrices(theta);
        let mut normal = DMatrix::zeros(count, count);
        let mut gradient = DVector::zeros(count);
        for window in windows {
            let found = self.explain(window, &modes);
            let sensitivity = self.sensitivity(window, &modes, &found);
            normal += sensitivity.tr_mul(&sensitivity);
            gradient += sensitivity.tr_mul(&found.residual);
        }
        let weight = self.prior.map(|size| (size * size).recip());
        gradient -= weight.component_mul(&(theta - &self.design));
        let whole = &normal + DMatrix::from_diagonal(&weight);
        let step = whole.cholesky()?.solve(&gradient);
        Some((normal, step))
    }

    /// Share of the variance that the error of the model has in readings of the usual movement and that is left
    /// after windows with the `normal` matrix: what the log hardly moved is as uncertain as before.
    fn remaining_variance(&self, normal: &DMatrix<f64>, theta: &DVector<f64>) -> Option<f64> {
        let prior = self.prior.map(|size| size * size);
        let (usual, _) = self.step(&self.usual, theta)?;
        let before = usual.diagonal().dot(&prior);
        let whole = normal + DMatrix::from_diagonal(&prior.map(f64::recip));
        let after = whole.cholesky()?.solve(&usual).trace();
        (before > 0.0).then(|| (after / before).min(1.0))
    }
}
