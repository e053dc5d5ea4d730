//! What an observer claims, proved from the shipped doubles: the decay of its error and the dwell time.

use super::ObserverDesign;
use super::dynamics::error_dynamics;
use super::lost;
use crate::Lyapunov;
use crate::blocks::BlockKind;
use crate::certificate::largest_ratio;
use crate::certificate::{CertificateError, Enclosure, check_dwell, growth_block, prove, require};
use crate::lyapunov::all_pairs;
use crate::units::is_unit;
use ftc_control::Matrix;
use ftc_control::parameters::ObserverKind;
use ftc_plant::{Dimensions, SwitchedPlant};
use nalgebra::DMatrix;

impl ObserverDesign {
    /// Proves, from these very doubles, the decay of the estimation error on this plant.
    ///
    /// # Errors
    /// The first inequality that cannot be proved, or what does not fit.
    pub fn verify(&self, plant: &SwitchedPlant) -> Result<(), CertificateError> {
        verify(plant, self)
    }
}

/// Proves everything an observer claims: the decay of its error and the dwell time.
fn verify(plant: &SwitchedPlant, design: &ObserverDesign) -> Result<(), CertificateError> {
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
    lost::verify(plant, design)?;
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

/// Everything [`verify`] indexes has the size it must have.
fn check_observer_sizes(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
) -> Result<(), CertificateError> {
    let dims = Dimensions::check(plant).map_err(CertificateError::malformed)?;
    design.spec.check().map_err(CertificateError::malformed)?;
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
