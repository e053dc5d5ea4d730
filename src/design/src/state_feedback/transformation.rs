//! Coordinates in which the inequalities are well conditioned.
//!
//! An interior-point method converges best with unknowns near the identity. A rough solution gives
//! coordinates that make them so: with `S = L L'` and `x~ = L xi` the Lyapunov matrix becomes `I`. All of
//! (T1) and (T2) is invariant under this congruence, so only the solver sees it; the certificate
//! is stated in the design's own units.

use crate::augmented::AugmentedMode;
use crate::certificate::FactoredLyapunov;
use nalgebra::DMatrix;

/// Gains and Lyapunov matrix of one mode.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Index of the mode.
    pub mode: usize,
    /// `K~ = [K, K_u, G]` (m x d).
    pub gain: DMatrix<f64>,
    /// `S` (d x d).
    pub lyapunov: FactoredLyapunov,
}

/// A change of coordinates with units for disturbance and performance signal.
#[derive(Clone, Debug)]
pub(super) struct Transformation {
    /// `L`: `x~ = L xi`.
    basis: DMatrix<f64>,
    inverse: DMatrix<f64>,
    /// `U`: `u = U nu`.
    input: DMatrix<f64>,
    disturbance: f64,
    performance: f64,
}

impl Transformation {
    /// The design's own coordinates.
    pub fn identity(size: usize, inputs: usize) -> Self {
        Self {
            basis: DMatrix::identity(size, size),
            inverse: DMatrix::identity(size, size),
            input: DMatrix::identity(inputs, inputs),
            disturbance: 1.0,
            performance: 1.0,
        }
    }

    /// Coordinates in which the mean Lyapunov matrix of a rough solution (found in one set of coordinates) is
    /// the identity; `None` when it is not positive definite.
    fn of(models: &[AugmentedMode], parts: &[Part]) -> Option<Self> {
        let first = &parts.first()?.lyapunov;
        let cores = parts.iter().map(|part| &part.lyapunov.core);
        let sum = cores.fold(0.0 * &first.core, |sum, core| sum + core);
        let root = (sum / parts.len() as f64).cholesky()?.unpack();
        let basis = &first.basis * root;
        let inverse = basis.clone().try_inverse()?;
        let finite = inverse.iter().all(|value| value.is_finite());
        let inputs = models[0].b.ncols();
        finite.then_some(Self {
            basis,
            inverse,
            ..Self::identity(0, inputs)
        })
    }

    /// The same with inputs whose effects on state and performance signal, taken together, are
    /// orthonormal.
    fn with_inputs(mut self, models: &[AugmentedMode], parts: &[Part]) -> Self {
        let inputs = models[0].b.ncols();
        let effect = parts.iter().map(|part| {
            let model = &models[part.mode];
            let (state, signal) = (&self.inverse * &model.b, &model.d / self.performance);
            state.tr_mul(&state) + signal.tr_mul(&signal)
        });
        let effect = effect.fold(DMatrix::zeros(inputs, inputs), |sum, effect| sum + effect);
        let root = effect
            .cholesky()
            .and_then(|factor| factor.l().transpose().try_inverse());
        if let Some(root) = root.filter(|root| root.iter().all(|value| value.is_finite())) {
            self.input = root;
        }
        self
    }

    /// Coordinates in which linear-quadratic regulators of the modes, each with a decay somewhat faster
    /// than asked, have the identity as their mean Lyapunov matrix. A single mode shows a margin in
    /// them whenever it can be stabilised so, however badly its states are scaled. `None` when a
    /// regulator does not exist.
    pub fn of_regulated(models: &[AugmentedMode], group: &[usize], decay: f64) -> Option<Self> {
        /// The regulators are designed for the asked decay to this power.
        const DECAY_EXPONENT: f64 = 1.3;
        let faster = decay.min(0.999).powf(DECAY_EXPONENT);
        let part = |&mode: &usize| {
            let model = &models[mode];
            let cost = regulator_cost(&(&model.a / faster), &(&model.b / faster))?;
            let lyapunov = cost.cholesky()?.inverse();
            let symmetric = 0.5 * (&lyapunov + lyapunov.transpose());
            Some(Part {
                mode,
                gain: model.b.transpose(),
                lyapunov: FactoredLyapunov::plain(symmetric),
            })
        };
        let parts = group.iter().map(part).collect::<Option<Vec<_>>>()?;
        Some(Self::of(models, &parts)?.with_inputs(models, &parts))
    }

    /// The same with the units in which the disturbance and the state's part of the performance
    /// signal are at most one.
    pub fn with_signals(mut self, models: &[AugmentedMode], group: &[usize]) -> Self {
        let largest = |norms: &mut dyn Iterator<Item = f64>| {
            let norm = norms.fold(0.0, f64::max);
            if norm > 0.0 { norm } else { 1.0 }
        };
        let (basis, inverse) = (&self.basis, &self.inverse);
        let entering = |&mode: &usize| (inverse * &models[mode].e).norm();
        let leaving = |&mode: &usize| (&models[mode].h * basis).norm();
        self.disturbance = largest(&mut group.iter().map(entering));
        self.performance = largest(&mut group.iter().map(leaving));
        self
    }

    /// Coordinates from a stabilising solution, with the units in which disturbance and closed-loop
    /// performance signal are near one.
    pub fn of_stabilised(models: &[AugmentedMode], parts: &[Part]) -> Option<Self> {
        let mut transformation = Self::of(models, parts)?;
        let largest = |matrices: &mut dyn Iterator<Item = DMatrix<f64>>| {
            let norm = matrices.map(|matrix| matrix.norm()).fold(0.0, f64::max);
            if norm > 0.0 { norm } else { 1.0 }
        };
        let disturbance = largest(
            &mut parts
                .iter()
                .map(|part| &transformation.inverse * &models[part.mode].e),
        );
        let performance = largest(&mut parts.iter().map(|part| {
            let model = &models[part.mode];
            (&model.h + &model.d * &part.gain) * &transformation.basis
        }));
        transformation.disturbance = disturbance;
        transformation.performance = performance;
        Some(transformation.with_inputs(models, parts))
    }

    /// Coordinates from a rough optimum of (T2) at level `g`, in which the new optimum is near 1.
    pub fn of_attenuated(models: &[AugmentedMode], parts: &[Part], level: f64) -> Option<Self> {
        let disturbance = level.sqrt();
        let transformation = Self::of(models, parts)?.with_inputs(models, parts);
        (disturbance.is_normal() && disturbance > 0.0).then_some(Self {
            disturbance,
            ..transformation
        })
    }

    /// The models in these coordinates.
    pub fn view(&self, models: &[AugmentedMode]) -> Vec<AugmentedMode> {
        models
            .iter()
            .map(|model| AugmentedMode {
                a: &self.inverse * &model.a * &self.basis,
                b: &self.inverse * &model.b * &self.input,
                e: &self.inverse * &model.e / self.disturbance,
                r: &self.inverse * &model.r,
                h: &model.h * &self.basis / self.performance,
                d: &model.d * &self.input / self.performance,
            })
            .collect()
    }

    /// A level `g` found in these coordinates, in the design's own.
    pub fn restore_level(&self, level: f64) -> f64 {
        level * (self.disturbance * self.performance).powi(2)
    }

    /// A level `g` of the design's own, in these coordinates.
    pub fn view_level(&self, level: f64) -> f64 {
        level / (self.disturbance * self.performance).powi(2)
    }

    /// Solutions found in these coordinates, in the design's own.
    pub fn restore(&self, parts: Vec<Part>) -> Vec<Part> {
        let back = |part: Part| Part {
            mode: part.mode,
            gain: &self.input * part.gain * &self.inverse,
            lyapunov: FactoredLyapunov {
                basis: &self.basis * part.lyapunov.basis,
                core: part.lyapunov.core / self.performance.powi(2),
            },
        };
        parts.into_iter().map(back).collect()
    }
}

/// The cost matrix `P` of the regulator of `x+ = a x + b u` that minimises the sum of `x'x + u'u`, by
/// the doubling algorithm for the discrete Riccati equation; `None` where it does not converge.
fn regulator_cost(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    const DOUBLINGS: usize = 40;
    let identity = DMatrix::<f64>::identity(a.nrows(), a.nrows());
    let (mut transition, mut reach, mut cost) = (a.clone(), b * b.transpose(), identity.clone());
    for _ in 0..DOUBLINGS {
        let shared = (&identity + &reach * &cost).try_inverse()?;
        let carried = &transition * shared;
        let growth = transition.transpose()
            * &cost
            * (&identity + &reach * &cost).lu().solve(&transition)?;
        reach += &carried * &reach * transition.transpose();
        transition = &carried * transition;
        cost += &growth;
        cost = 0.5 * (&cost + cost.transpose());
        if !cost.iter().all(|value| value.is_finite()) {
            return None;
        }
        if growth.norm() <= 1e-12 * cost.norm() {
            return Some(cost);
        }
    }
    None
}
