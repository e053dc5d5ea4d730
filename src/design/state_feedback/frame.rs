//! Coordinates in which a solver is at ease.
//!
//! An interior-point method wants its unknowns near the identity. A rough solution tells which
//! coordinates make them so: with `S = L L'` and `x~ = L xi` the Lyapunov matrix becomes `I`. All of
//! (T1) and (T2) is invariant under this congruence, so only the solver sees it; the certificate
//! is stated in the design's own units.

use crate::design::augmented::AugmentedMode;
use crate::design::certificate::FactoredLyapunov;
use crate::plant::spectral_radius;
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
pub(super) struct Frame {
    /// `L`: `x~ = L xi`.
    basis: DMatrix<f64>,
    inverse: DMatrix<f64>,
    disturbance: f64,
    performance: f64,
}

impl Frame {
    /// The design's own coordinates.
    pub fn identity(size: usize) -> Self {
        Self {
            basis: DMatrix::identity(size, size),
            inverse: DMatrix::identity(size, size),
            disturbance: 1.0,
            performance: 1.0,
        }
    }

    /// Coordinates in which the mean Lyapunov matrix of a rough solution (found in one frame) is
    /// the identity; `None` when it is not positive definite.
    fn of(parts: &[Part]) -> Option<Self> {
        let first = &parts.first()?.lyapunov;
        let cores = parts.iter().map(|part| &part.lyapunov.core);
        let sum = cores.fold(0.0 * &first.core, |sum, core| sum + core);
        let root = (sum / parts.len() as f64).cholesky()?.unpack();
        let basis = &first.basis * root;
        let inverse = basis.clone().try_inverse()?;
        let sound = inverse.iter().all(|value| value.is_finite());
        sound.then_some(Self {
            basis,
            inverse,
            disturbance: 1.0,
            performance: 1.0,
        })
    }

    /// Coordinates in which the inputs reach every direction about equally, from the mean of the
    /// modes' reachability Gramians over `REACH` samples: at small sample times the plain margin
    /// problem hardly sees the states far from the inputs. `None` when some are not reached at all.
    pub fn of_reachable(models: &[AugmentedMode], group: &[usize]) -> Option<Self> {
        const REACH: usize = 500;
        let gramian = |model: &AugmentedMode| {
            let shrink = 1.0 / spectral_radius(&model.a).max(1.0);
            let mut reached = model.b.clone();
            let mut sum = &reached * reached.transpose();
            for _ in 0..REACH {
                reached = shrink * (&model.a * reached);
                sum += &reached * reached.transpose();
            }
            let scale = sum.nrows() as f64 / sum.trace();
            sum * scale
        };
        let parts: Vec<Part> = group
            .iter()
            .map(|&mode| Part {
                mode,
                gain: models[mode].b.transpose(),
                lyapunov: FactoredLyapunov::plain(gramian(&models[mode])),
            })
            .collect();
        Self::of(&parts)
    }

    /// Coordinates from a stabilising solution, with the units in which disturbance and closed-loop
    /// performance signal are near one.
    pub fn of_stabilised(models: &[AugmentedMode], parts: &[Part]) -> Option<Self> {
        let mut frame = Self::of(parts)?;
        let largest = |matrices: &mut dyn Iterator<Item = DMatrix<f64>>| {
            let norm = matrices.map(|matrix| matrix.norm()).fold(0.0, f64::max);
            if norm > 0.0 { norm } else { 1.0 }
        };
        let disturbance = largest(
            &mut parts
                .iter()
                .map(|part| &frame.inverse * &models[part.mode].e),
        );
        let performance = largest(&mut parts.iter().map(|part| {
            let model = &models[part.mode];
            (&model.h + &model.d * &part.gain) * &frame.basis
        }));
        frame.disturbance = disturbance;
        frame.performance = performance;
        Some(frame)
    }

    /// Coordinates from a rough optimum of (T2) at level `g`, in which the new optimum is near 1.
    pub fn of_attenuated(parts: &[Part], level: f64) -> Option<Self> {
        let disturbance = level.sqrt();
        (disturbance.is_normal() && disturbance > 0.0)
            .then(|| Self::of(parts))?
            .map(|frame| Self {
                disturbance,
                ..frame
            })
    }

    /// The models in these coordinates.
    pub fn view(&self, models: &[AugmentedMode]) -> Vec<AugmentedMode> {
        models
            .iter()
            .map(|model| AugmentedMode {
                a: &self.inverse * &model.a * &self.basis,
                b: &self.inverse * &model.b,
                e: &self.inverse * &model.e / self.disturbance,
                h: &model.h * &self.basis / self.performance,
                d: &model.d / self.performance,
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
            gain: part.gain * &self.inverse,
            lyapunov: FactoredLyapunov {
                basis: &self.basis * part.lyapunov.basis,
                core: part.lyapunov.core / self.performance.powi(2),
            },
        };
        parts.into_iter().map(back).collect()
    }
}
