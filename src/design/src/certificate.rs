//! Proofs, after rounding, of everything a design promises.
//!
//! A certificate holds Lyapunov matrices and the units they were found in. [`verify`] rebuilds
//! every inequality from the plant and the shipped gains with a bound on each rounding error made
//! on the way ([`Enclosure`]), and proves it positive definite. No solver takes part.
//!
//! Sine and cosine of a resonator count as known to one unit in the last place, which covers the
//! doubles the controller turns by as well as the numbers they stand for.
//!
//! For gains `K~` and the closed loop `A_i + B_i K~_i` the inequalities are (T2) with `R = K~ G` and
//! `G_i = S_i`, which the solver's solution implies for every `G_i`.
//!
//! [`verify`]: crate::StateFeedback::verify

mod enclosure;

pub use enclosure::Enclosure;

use super::augmented::scaled;
use super::blocks::{BlockKind, BlockName};
use super::{DwellTime, Units};
use ftc_plant::rows;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A Lyapunov matrix `S = L M L'` of the function `x' S^-1 x`, in the certificate's units.
///
/// `L` takes up the bad conditioning, so that the proof, stated in the coordinates `L^-1 x`, is not
/// spoiled by rounding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FactoredLyapunov {
    /// `L` (d x d), regular.
    #[serde(with = "rows")]
    pub basis: DMatrix<f64>,
    /// `M` (d x d), symmetric and positive definite.
    #[serde(with = "rows")]
    pub core: DMatrix<f64>,
}

/// A Lyapunov matrix `P` of the function `e' P e`, in the certificate's units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
#[expect(clippy::exhaustive_structs, reason = "a matrix, named")]
pub struct LyapunovMatrix(
    /// Symmetric, positive definite (n x n).
    #[serde(with = "rows")]
    pub DMatrix<f64>,
);

/// What, beside the plant and the gains, it takes to prove a state feedback.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ControlCertificate {
    /// Units (powers of two) in which the inequalities are stated.
    pub units: Units,
    /// One matrix for `common`, else one per mode.
    pub lyapunov: Vec<FactoredLyapunov>,
}

/// Why a certificate does not check.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CertificateError {
    /// An inequality could not be proved.
    #[error("the {0} could not be proved")]
    Unproved(BlockName),
    /// Sizes, units or claims do not fit the plant; one sentence says which.
    #[error("{0}")]
    Malformed(String),
}

impl CertificateError {
    /// What does not fit, in a sentence.
    pub(crate) fn malformed(what: impl std::fmt::Display) -> Self {
        Self::Malformed(what.to_string())
    }
}

/// Proves a claim about a mode and its successor (indices from 0).
pub(crate) fn prove(
    claim: &Enclosure,
    kind: BlockKind,
    mode: usize,
    successor: usize,
) -> Result<(), CertificateError> {
    match claim.is_positive_definite() {
        true => Ok(()),
        false => Err(CertificateError::Unproved(BlockName::new(
            kind, mode, successor,
        ))),
    }
}

impl FactoredLyapunov {
    /// `S` itself, with `L = I`.
    pub(crate) fn plain(core: DMatrix<f64>) -> Self {
        Self {
            basis: DMatrix::identity(core.nrows(), core.nrows()),
            core,
        }
    }
}

/// A Lyapunov matrix as the proof uses it: any regular `X` will do, `X = L^-1` up to rounding is best.
pub(crate) struct Coordinates {
    /// `X`.
    outward: Enclosure,
    /// `L`.
    basis: Enclosure,
    /// `M (X L)'`.
    right: Enclosure,
    /// `X S X'`, near `M`.
    whole: Enclosure,
}

impl Coordinates {
    pub(crate) fn new(lyapunov: &FactoredLyapunov) -> Option<Self> {
        let outward = Enclosure::exact(lyapunov.basis.clone().try_inverse()?);
        let basis = Enclosure::exact(lyapunov.basis.clone());
        let core = Enclosure::exact(lyapunov.core.clone());
        if lyapunov.core != lyapunov.core.transpose() {
            return None;
        }
        let shape = &outward * &basis;
        let right = &core * &shape.transpose();
        Some(Self {
            whole: (&shape * &right).symmetric_part(),
            outward,
            basis,
            right,
        })
    }

    /// `matrix S X'` for a matrix that multiplies the state.
    pub(crate) fn after(&self, matrix: &Enclosure) -> Enclosure {
        &(matrix * &self.basis) * &self.right
    }

    /// `X matrix` for a matrix that yields a state.
    pub(crate) fn seen(&self, matrix: &Enclosure) -> Enclosure {
        &self.outward * matrix
    }

    /// `X S X'`.
    pub(crate) fn whole(&self) -> &Enclosure {
        &self.whole
    }

    /// `X S_other X'` of another Lyapunov matrix.
    pub(crate) fn view(&self, other: &FactoredLyapunov) -> Enclosure {
        let shape = &self.outward * &Enclosure::exact(other.basis.clone());
        let right = &Enclosure::exact(other.core.clone()) * &shape.transpose();
        (&shape * &right).symmetric_part()
    }
}

/// The coordinates of every Lyapunov matrix.
pub(crate) fn coordinates(
    matrices: &[FactoredLyapunov],
) -> Result<Vec<Coordinates>, CertificateError> {
    let singular =
        |mode: usize| CertificateError::Unproved(BlockName::new(BlockKind::Lyapunov, mode, mode));
    let numbered = matrices.iter().enumerate();
    numbered
        .map(|(mode, matrix)| Coordinates::new(matrix).ok_or_else(|| singular(mode)))
        .collect()
}

/// The stated dwell time is no shorter than `mu` and the decay rate ask for.
pub(crate) fn check_dwell(
    dwell: &DwellTime,
    decay: f64,
    sample_time: f64,
) -> Result<(), CertificateError> {
    let due = DwellTime::new(dwell.mu, decay, sample_time);
    let stated = dwell.samples >= due.samples && dwell.seconds >= due.seconds;
    require(&[(
        stated && dwell.mu >= 1.0 && decay < 1.0,
        "the dwell time does not follow from mu and the decay rate",
    )])
}

/// A matrix of given numbers in units (powers of two), enclosed.
pub(crate) fn scaled_plant(matrix: &DMatrix<f64>, rows: &[f64], columns: &[f64]) -> Enclosure {
    Enclosure::rounded(scaled(matrix, rows, columns))
}

/// `[f P_i (P_j N)'; . P_j]`: the function of mode `j` after a sample is below `f` times that of
/// mode `i` before it.
pub(crate) fn growth_block(
    error: &Enclosure,
    own: &Enclosure,
    next: &Enclosure,
    factor: &Enclosure,
) -> Enclosure {
    Enclosure::symmetric_blocks(&[vec![factor * own], vec![next * error, next.clone()]])
}

/// The largest eigenvalue of `below^-1 above` for symmetric matrices, `below` positive definite.
pub(crate) fn largest_ratio(above: &DMatrix<f64>, below: &DMatrix<f64>) -> Option<f64> {
    let factor = below.clone().cholesky()?.unpack();
    let half = factor.solve_lower_triangular(above)?;
    let ratio = factor.solve_lower_triangular(&half.transpose())?;
    let symmetric = 0.5 * (&ratio + ratio.transpose());
    Some(symmetric.symmetric_eigenvalues().max())
}

/// The first condition that fails, as an error.
pub(crate) fn require(conditions: &[(bool, &str)]) -> Result<(), CertificateError> {
    match conditions.iter().find(|(holds, _)| !holds) {
        Some((_, what)) => Err(CertificateError::Malformed((*what).into())),
        None => Ok(()),
    }
}
