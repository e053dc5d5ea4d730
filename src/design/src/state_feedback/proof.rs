//! What a state feedback claims, proved from the shipped doubles: decay, attenuation, dwell time.

use super::{ModeGains, StateFeedback};
use crate::augmented::{AugmentedMode, augment, scaled};
use crate::blocks::BlockKind;
use crate::blocks::BlockName;
use crate::certificate::largest_ratio;
use crate::certificate::{
    CertificateError, Coordinates, Enclosure, FactoredLyapunov, check_dwell, coordinates, prove,
    require,
};
use crate::lyapunov::all_pairs;
use crate::{ControlSpec, DwellTime, Lyapunov, Units};
use ftc_plant::{Dimensions, SwitchedPlant};
use nalgebra::DMatrix;

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

impl StateFeedback {
    /// Proves, from these very doubles, decay, attenuation and dwell time on this plant.
    ///
    /// # Errors
    /// The first inequality that cannot be proved, or what does not fit.
    pub fn verify(&self, plant: &SwitchedPlant) -> Result<(), CertificateError> {
        verify(plant, self)
    }
}

/// Proves everything a state feedback claims: decay, attenuation, dwell time.
fn verify(plant: &SwitchedPlant, design: &StateFeedback) -> Result<(), CertificateError> {
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
    let size = own.whole().shape().0;
    let reduced = &Enclosure::square_times_identity(decay, size) * own.whole();
    Enclosure::symmetric_blocks(&[
        vec![reduced.symmetric_part()],
        vec![own.after(&next.seen(&closed.a)), next.whole().clone()],
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
        vec![own.whole().clone()],
        vec![
            Enclosure::zeros(disturbances, size),
            Enclosure::square_times_identity(gamma, disturbances),
        ],
        vec![
            own.after(&next.seen(&closed.a)),
            next.seen(&closed.e),
            next.whole().clone(),
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
        let size = next.whole().shape().0;
        let factor = Enclosure::exact(DMatrix::from_diagonal_element(size, size, dwell.mu));
        let ratio = &(&factor * next.whole()) - &next.view(&matrices[i]);
        prove(&ratio.symmetric_part(), BlockKind::LyapunovRatio, i, j)?;
    }
    Ok(())
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

/// The dwell time that the factor between Lyapunov matrices `S` asks for, with the smallest `mu`
/// that can be proved.
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
        let whole = next.whole().clone().into_midpoint();
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

/// Everything [`verify`] indexes has the size it must have.
fn check_sizes(plant: &SwitchedPlant, design: &StateFeedback) -> Result<(), CertificateError> {
    let dims = Dimensions::check(plant).map_err(CertificateError::malformed)?;
    let (spec, certificate) = (&design.spec, &design.certificate);
    spec.check(dims).map_err(CertificateError::malformed)?;
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
