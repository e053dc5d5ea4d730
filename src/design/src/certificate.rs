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

use super::augmented::{AugmentedMode, augment, scaled};
use super::lyapunov::all_pairs;
use super::matrices::dense;
use super::observer::{self, ObserverDesign, corrected_error};
use super::state_feedback::{ModeGains, StateFeedback};
use super::units::is_unit;
use super::verdict::{BlockKind, BlockName};
use super::{ControlSpec, DwellTime, Lyapunov, Units};
use ftc_control::Matrix;
use ftc_control::parameters::ObserverKind;
use ftc_plant::rows;
use ftc_plant::{Dimensions, SwitchedPlant};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A Lyapunov matrix `S = L M L'` of the function `x' S^-1 x`, in the certificate's units.
///
/// `L` carries the bad conditioning, so that the proof, stated in the coordinates `L^-1 x`, does not
/// drown in rounding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
pub struct LyapunovMatrix(
    /// Symmetric, positive definite (n x n).
    #[serde(with = "rows")]
    pub DMatrix<f64>,
);

/// What, beside the plant and the gains, it takes to prove a state feedback.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControlCertificate {
    /// Units (powers of two) in which the inequalities are stated.
    pub units: Units,
    /// One matrix for `common`, else one per mode.
    pub lyapunov: Vec<FactoredLyapunov>,
}

/// Why a certificate does not check.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CertificateError {
    /// An inequality could not be proved.
    #[error("the {0} could not be proved")]
    Unproved(BlockName),
    /// Sizes, units or claims do not fit the plant; one sentence says which.
    #[error("{0}")]
    Malformed(String),
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

/// The closed loop of one mode, enclosed.
struct ClosedLoop {
    /// `A + B K~` (d x d).
    a: Enclosure,
    /// `E` (d x s).
    e: Enclosure,
    /// `H + D K~`.
    h: Enclosure,
}

impl ClosedLoop {
    fn new(model: AugmentedMode, gain: DMatrix<f64>) -> Self {
        let gain = Enclosure::rounded(gain);
        let [a, b, e, h, d] = [model.a, model.b, model.e, model.h, model.d].map(Enclosure::rounded);
        Self {
            a: &a + &(&b * &gain),
            e,
            h: &h + &(&d * &gain),
        }
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
    fn view(&self, other: &FactoredLyapunov) -> Enclosure {
        let shape = &self.outward * &Enclosure::exact(other.basis.clone());
        let right = &Enclosure::exact(other.core.clone()) * &shape.transpose();
        (&shape * &right).symmetric_part()
    }
}

/// The coordinates of every Lyapunov matrix.
fn coordinates(matrices: &[FactoredLyapunov]) -> Result<Vec<Coordinates>, CertificateError> {
    let singular =
        |mode: usize| CertificateError::Unproved(BlockName::new(BlockKind::Lyapunov, mode, mode));
    let numbered = matrices.iter().enumerate();
    numbered
        .map(|(mode, matrix)| Coordinates::new(matrix).ok_or_else(|| singular(mode)))
        .collect()
}

/// Proves everything a state feedback claims: decay, attenuation, dwell time.
pub(crate) fn verify_state_feedback(
    plant: &SwitchedPlant,
    design: &StateFeedback,
) -> Result<(), CertificateError> {
    check_sizes(plant, design)?;
    let (spec, certificate) = (&design.spec, &design.certificate);
    let (units, modes) = (&certificate.units, plant.modes.len());
    let loops: Vec<ClosedLoop> = augment(plant, spec, units)
        .into_iter()
        .zip(&design.modes)
        .map(|(model, gains)| ClosedLoop::new(model, scaled_gain(gains, units, spec)))
        .collect();
    let coordinates = coordinates(&certificate.lyapunov)?;
    let lyapunov = |mode: usize| &coordinates[spec.lyapunov.index(mode)];

    for (i, j) in spec.lyapunov.pairs(modes) {
        let decay = decay_block(&loops[i], lyapunov(i), lyapunov(j), spec.decay);
        prove(&decay, BlockKind::Decay, i, j)?;
        if let Some(gamma) = &design.gamma {
            let level = gamma[i] * units.disturbance / units.performance;
            let block = attenuation_block(&loops[i], lyapunov(i), lyapunov(j), level);
            prove(&block, BlockKind::Attenuation, i, j)?;
        }
    }
    match &design.dwell {
        Some(dwell) => prove_dwell(&certificate.lyapunov, dwell, spec.decay, plant.sample_time),
        None => Ok(()),
    }
}

/// `[alpha^2 S_i (A S_i)'; . S_j]`, each block seen through the `X` of its mode.
fn decay_block(
    closed: &ClosedLoop,
    own: &Coordinates,
    next: &Coordinates,
    decay: f64,
) -> Enclosure {
    let size = own.whole.shape().0;
    let reduced = &Enclosure::square_times_identity(decay, size) * &own.whole;
    Enclosure::symmetric_blocks(&[
        vec![reduced.symmetric_part()],
        vec![own.after(&(&next.outward * &closed.a)), next.whole.clone()],
    ])
}

/// `[S_i 0 (A S_i)' (H S_i)'; . gamma^2 I E' 0; . . S_j 0; . . . I]`, seen likewise.
fn attenuation_block(
    closed: &ClosedLoop,
    own: &Coordinates,
    next: &Coordinates,
    gamma: f64,
) -> Enclosure {
    let (size, disturbances) = closed.e.shape();
    let signals = closed.h.shape().0;
    Enclosure::symmetric_blocks(&[
        vec![own.whole.clone()],
        vec![
            Enclosure::zeros(disturbances, size),
            Enclosure::square_times_identity(gamma, disturbances),
        ],
        vec![
            own.after(&(&next.outward * &closed.a)),
            &next.outward * &closed.e,
            next.whole.clone(),
        ],
        vec![
            own.after(&closed.h),
            Enclosure::zeros(signals, disturbances),
            Enclosure::zeros(signals, size),
            Enclosure::exact(DMatrix::identity(signals, signals)),
        ],
    ])
}

/// `mu S_j - S_i` for every switch from `i` to `j`, and the dwell time that follows from `mu`.
fn prove_dwell(
    matrices: &[FactoredLyapunov],
    dwell: &DwellTime,
    decay: f64,
    sample_time: f64,
) -> Result<(), CertificateError> {
    check_dwell(dwell, decay, sample_time)?;
    let coordinates = coordinates(matrices)?;
    for (i, j) in all_pairs(matrices.len())
        .into_iter()
        .filter(|(i, j)| i != j)
    {
        let next = &coordinates[j];
        let size = next.whole.shape().0;
        let factor = Enclosure::exact(DMatrix::from_diagonal_element(size, size, dwell.mu));
        let ratio = &(&factor * &next.whole) - &next.view(&matrices[i]);
        prove(&ratio.symmetric_part(), BlockKind::LyapunovRatio, i, j)?;
    }
    Ok(())
}

/// The stated dwell time is no shorter than `mu` and the decay rate ask for.
fn check_dwell(dwell: &DwellTime, decay: f64, sample_time: f64) -> Result<(), CertificateError> {
    let due = DwellTime::new(dwell.mu, decay, sample_time);
    let stated = dwell.samples >= due.samples && dwell.seconds >= due.seconds;
    require(&[(
        stated && dwell.mu >= 1.0 && decay < 1.0,
        "the dwell time does not follow from mu and the decay rate",
    )])
}

/// `K~ = [K, K_u, G]` in the certificate's units.
pub(crate) fn scaled_gain(gains: &ModeGains, units: &Units, spec: &ControlSpec) -> DMatrix<f64> {
    let m = units.inputs.len();
    let previous = if spec.latency == 0 { 0 } else { m };
    let (n, integral_part) = (units.states.len(), units.integral_part(spec));
    let mut gain = DMatrix::zeros(m, n + previous + integral_part.len());
    gain.columns_mut(0, n)
        .copy_from(&scaled(&gains.state_feedback, &units.inputs, &units.states));
    if spec.latency == 1 {
        let block = scaled(&gains.previous_input, &units.inputs, &units.inputs);
        gain.columns_mut(n, m).copy_from(&block);
    }
    let integral = scaled(&gains.integral, &units.inputs, &integral_part);
    gain.columns_mut(n + previous, integral_part.len())
        .copy_from(&integral);
    gain
}

/// A matrix of given numbers in units (powers of two), enclosed.
pub(crate) fn scaled_plant(matrix: &DMatrix<f64>, rows: &[f64], columns: &[f64]) -> Enclosure {
    Enclosure::rounded(scaled(matrix, rows, columns))
}

/// The error dynamics `T_ij A_i - K_i C_i` of an observer in its certificate's units, enclosed; of a
/// Kalman filter the error of the prediction, `A_i - A_i H_i C_i`, whatever mode follows.
pub(crate) fn error_dynamics(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    i: usize,
    j: usize,
) -> Enclosure {
    if design.observer.kind == ObserverKind::Kalman {
        return corrected_error(plant, design, i, &design.observer.decoupling[i][i]);
    }
    let (states, outputs) = (&design.certificate.states, &design.certificate.outputs);
    let matrix = scaled_plant;
    let (own, next) = (&plant.modes[i], &plant.modes[j]);
    let a = matrix(&own.a, states, states);
    let gain = matrix(&dense(&design.observer.gains[i]), states, outputs);
    let decoupling = matrix(&dense(&design.observer.decoupling[i][j]), states, outputs);
    let seen = &matrix(&next.c, outputs, states) * &a;
    let injected = &gain * &matrix(&own.c, outputs, states);
    &(&a - &(&decoupling * &seen)) - &injected
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

/// Proves everything an observer claims: the decay of its error and the dwell time.
pub(crate) fn verify_observer(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
) -> Result<(), CertificateError> {
    check_observer_sizes(plant, design)?;
    let (spec, modes) = (&design.spec, plant.modes.len());
    let matrices: Vec<Enclosure> = design
        .certificate
        .lyapunov
        .iter()
        .map(|matrix| Enclosure::exact(matrix.0.clone()))
        .collect();
    let lyapunov = |mode: usize| &matrices[spec.lyapunov.index(mode)];
    let squared = Enclosure::square_times_identity(spec.decay, plant.modes[0].a.nrows());
    for (i, j) in spec.lyapunov.observer_pairs(modes) {
        let error = error_dynamics(plant, design, i, j);
        let block = growth_block(&error, lyapunov(i), lyapunov(j), &squared);
        prove(&block, BlockKind::ObserverDecay, i, j)?;
    }
    observer::verify_lost(plant, design)?;
    let Some(dwell) = &design.dwell else {
        return Ok(());
    };
    check_dwell(dwell, spec.decay, plant.sample_time)?;
    let size = plant.modes[0].a.nrows();
    let mu = Enclosure::exact(DMatrix::from_diagonal_element(size, size, dwell.mu));
    let factor = &mu * &squared;
    for (i, j) in all_pairs(modes).into_iter().filter(|(i, j)| i != j) {
        let error = error_dynamics(plant, design, i, j);
        let block = growth_block(&error, lyapunov(i), lyapunov(j), &factor);
        prove(&block, BlockKind::LyapunovRatio, i, j)?;
    }
    Ok(())
}

/// The least factor `mu >= 1` by which
/// an observer's Lyapunov function exceeds `decay^2` over a switch.
#[cfg(feature = "solver")]
pub(crate) fn observer_growth(plant: &SwitchedPlant, design: &ObserverDesign) -> Option<f64> {
    let matrices = &design.certificate.lyapunov;
    let switches = all_pairs(plant.modes.len())
        .into_iter()
        .filter(|(i, j)| i != j);
    let mut mu = 1.0_f64;
    for (i, j) in switches {
        let error = error_dynamics(plant, design, i, j).into_midpoint();
        let after = error.transpose() * &matrices[j].0 * &error;
        let growth = largest_ratio(&after, &matrices[i].0)?;
        mu = mu.max(growth / design.spec.decay.powi(2));
    }
    Some(mu)
}

/// The dwell time that the factor between Lyapunov matrices `S` asks for, with the smallest `mu`
/// that can be proved.
#[cfg(feature = "solver")]
pub(crate) fn provable_dwell(
    matrices: &[FactoredLyapunov],
    decay: f64,
    sample_time: f64,
) -> Result<DwellTime, CertificateError> {
    let coordinates = coordinates(matrices)?;
    let mut mu = 1.0_f64;
    for (i, j) in all_pairs(matrices.len()) {
        let next = &coordinates[j];
        let own = next.view(&matrices[i]).into_midpoint();
        let whole = next.whole.clone().into_midpoint();
        let ratio = largest_ratio(&own, &whole)
            .ok_or_else(|| CertificateError::Unproved(BlockName::new(BlockKind::Lyapunov, j, j)))?;
        mu = mu.max(ratio);
    }
    let mut outcome = Err(CertificateError::Malformed(
        "no dwell time was tried".into(),
    ));
    for allowance in DwellTime::ALLOWANCES {
        let dwell = DwellTime::new(mu * (1.0 + allowance), decay, sample_time);
        outcome = prove_dwell(matrices, &dwell, decay, sample_time).map(|()| dwell);
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// The largest eigenvalue of `below^-1 above` for symmetric matrices, `below` positive definite.
#[cfg(feature = "solver")]
pub(crate) fn largest_ratio(above: &DMatrix<f64>, below: &DMatrix<f64>) -> Option<f64> {
    let factor = below.clone().cholesky()?.unpack();
    let half = factor.solve_lower_triangular(above)?;
    let ratio = factor.solve_lower_triangular(&half.transpose())?;
    let symmetric = 0.5 * (&ratio + ratio.transpose());
    Some(symmetric.symmetric_eigenvalues().max())
}

/// Everything [`verify_observer`] indexes has the size it must have.
fn check_observer_sizes(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
) -> Result<(), CertificateError> {
    let malformed = CertificateError::Malformed;
    let dims = Dimensions::check(plant).map_err(malformed)?;
    design.spec.check().map_err(malformed)?;
    let (n, p, modes) = (dims.states, dims.outputs, plant.modes.len());
    let (observer, certificate) = (&design.observer, &design.certificate);
    let fits = |gain: &Matrix| gain.shape() == (n, p);
    let gains_fit = observer.gains.len() == modes
        && observer.decoupling.len() == modes
        && observer.decoupling.iter().all(|row| row.len() == modes)
        && observer.gains.iter().all(fits)
        && observer.decoupling.iter().flatten().all(fits);
    let one_index = |(i, gain): (usize, &Matrix)| {
        let mut entered = observer.decoupling.iter().map(|row| &row[i]);
        gain.as_slice().iter().all(|&k| k == 0.0)
            && entered.all(|h| *h == observer.decoupling[i][i])
    };
    let form_fits = !gains_fit
        || observer.kind != ObserverKind::Kalman
        || observer.gains.iter().enumerate().all(one_index);
    let matrices_fit = certificate.lyapunov.len() == design.spec.lyapunov.matrices(modes)
        && certificate
            .lyapunov
            .iter()
            .all(|matrix| matrix.0.shape() == (n, n));
    let mut units = certificate.states.iter().chain(&certificate.outputs);
    let units_fit = certificate.states.len() == n
        && certificate.outputs.len() == p
        && units.all(|&unit| is_unit(unit));
    let dwell_fits = design.dwell.is_some() == (design.spec.lyapunov == Lyapunov::Dwell);
    require(&[
        (
            gains_fit,
            "the observer's gains do not have the sizes of the plant",
        ),
        (
            form_fits,
            "a Kalman filter has no injection and one H for each mode entered",
        ),
        (
            matrices_fit,
            "the observer's Lyapunov matrices do not have the size of the state",
        ),
        (
            dwell_fits,
            "a dwell time belongs to the dwell guarantee, and to it only",
        ),
        (
            units_fit,
            "the units are not one power of two per signal, of moderate size",
        ),
    ])
}

/// The first condition that fails, as an error.
pub(crate) fn require(conditions: &[(bool, &str)]) -> Result<(), CertificateError> {
    match conditions.iter().find(|(holds, _)| !holds) {
        Some((_, what)) => Err(CertificateError::Malformed((*what).into())),
        None => Ok(()),
    }
}

/// Everything [`verify_state_feedback`] indexes has the size it must have.
fn check_sizes(plant: &SwitchedPlant, design: &StateFeedback) -> Result<(), CertificateError> {
    let malformed = CertificateError::Malformed;
    let dims = Dimensions::check(plant).map_err(malformed)?;
    let (spec, certificate) = (&design.spec, &design.certificate);
    spec.check(dims).map_err(malformed)?;
    let (n, m, r) = (dims.states, dims.inputs, spec.tracked.len());
    let (modes, previous) = (plant.modes.len(), spec.latency * m);
    let q = spec.integral_size();
    let size = n + previous + q;
    let gains_fit = design.modes.len() == modes
        && design.modes.iter().all(|gains| {
            gains.state_feedback.shape() == (m, n)
                && gains.integral.shape() == (m, q)
                && gains.previous_input.shape() == (m, previous)
        });
    let matrices_fit = certificate.lyapunov.len() == spec.lyapunov.matrices(modes)
        && certificate
            .lyapunov
            .iter()
            .all(|matrix| [&matrix.basis, &matrix.core].map(DMatrix::shape) == [(size, size); 2]);
    let gamma_fits = design
        .gamma
        .as_ref()
        .is_none_or(|gamma| gamma.len() == modes && gamma.iter().all(|g| *g >= 0.0));
    let dwell_fits = design.dwell.is_some() == (spec.lyapunov == Lyapunov::Dwell);
    require(&[
        (gains_fit, "the gains do not have the sizes of the plant"),
        (
            matrices_fit,
            "the Lyapunov matrices do not have the sizes of the augmented model",
        ),
        (gamma_fits, "gamma is not one number >= 0 per mode"),
        (
            dwell_fits,
            "a dwell time belongs to the dwell guarantee, and to it only",
        ),
        (
            certificate.units.fit(plant, r),
            "the units are not one power of two per signal, of moderate size",
        ),
    ])
}
