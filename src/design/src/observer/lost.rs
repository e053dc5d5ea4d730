//! The observer without some of its sensors: what proves its error stable.
//!
//! With the sensors in `h` lost, `x_hat = prior + H_ih (y - C_i prior)`, and the error of the prediction
//! obeys `e(k+1) = A_i (I - H_ih C_i) e(k)`: one matrix for each mode `i` and each set `h`. Where one
//! function `e' P e` shrinks under all of them, sets (and modes) may change at every sample; else a
//! set must last for [`Observer::minimum_dwell`] samples.
//!
//! [`Observer::minimum_dwell`]: ftc_control::parameters::Observer::minimum_dwell

use super::ObserverDesign;
use super::dynamics::{corrected_error, error_dynamics};
use crate::blocks::BlockKind;
use crate::certificate::{
    CertificateError, Enclosure, LyapunovMatrix, growth_block, prove, require, scaled_plant,
};
use crate::lyapunov::all_pairs;
use ftc_control::Matrix;
use ftc_control::parameters::Observer;
use ftc_control::parameters::{LostSet, ObserverKind};
use ftc_plant::SwitchedPlant;
use ftc_record::dense;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// What, beside plant and gains, proves the error stable with sensors lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LostCertificate {
    /// Decay rate of the error's function while the set does not change.
    pub decay: f64,
    /// Matrices `P` in the observer's units. One list for all sets, or one list for each set (that
    /// of a healthy Kalman filter first, then in the order of the sets); in a list one matrix for all
    /// modes, or one for each.
    pub lyapunov: Vec<Vec<LyapunovMatrix>>,
    /// By how much the function may grow when the set (or, with one matrix per mode, the mode)
    /// changes; 1 where it cannot.
    pub mu: f64,
}

/// Every set of lost sensors a design is asked about: each one, each pair (up to
/// [`MOST_FOR_PAIRS`] sensors), all of them.
pub fn sets(sensors: usize) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = (0..sensors).map(|k| vec![k]).collect();
    if sensors <= MOST_FOR_PAIRS {
        sets.extend((0..sensors).flat_map(|a| (a + 1..sensors).map(move |b| vec![a, b])));
    }
    if sensors > 2 || sets.is_empty() {
        sets.push((0..sensors).collect());
    }
    sets.dedup();
    sets
}

/// The most sensors for which pairs are looked at.
pub const MOST_FOR_PAIRS: usize = 8;

/// Whether the healthy observer is one of the family: a prediction error with one index.
fn healthy_in_family(design: &ObserverDesign) -> bool {
    design.observer.kind == ObserverKind::Kalman
}

/// The error's dynamics of every set, the healthy Kalman filter's first, and of every mode.
struct Family {
    /// `[set][mode]`.
    errors: Vec<Vec<Enclosure>>,
    /// `[set]`: index of its list of matrices.
    lists: Vec<usize>,
}

impl Family {
    fn new(plant: &SwitchedPlant, design: &ObserverDesign, lists: usize) -> Self {
        let modes = plant.modes.len();
        let mut errors = Vec::new();
        if healthy_in_family(design) {
            errors.push(
                (0..modes)
                    .map(|i| error_dynamics(plant, design, i, i))
                    .collect(),
            );
        }
        let of = |set: &LostSet| {
            (0..modes)
                .map(|i| corrected_error(plant, design, i, &set.correction[i]))
                .collect()
        };
        errors.extend(design.observer.lost.iter().map(of));
        let index = |set: usize| if lists == 1 { 0 } else { set };
        Self {
            lists: (0..errors.len()).map(index).collect(),
            errors,
        }
    }
}

/// Proves the error stable with every set that is served, and the dwell time between changes.
pub(crate) fn verify(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
) -> Result<(), CertificateError> {
    let Some(certificate) = &design.lost else {
        return require(&[(
            design.observer.lost.is_empty() && design.observer.minimum_dwell == 0,
            "lost sensors are served without a proof",
        )]);
    };
    check_sizes(plant, design, certificate)?;
    let family = Family::new(plant, design, certificate.lyapunov.len());
    let matrices = enclosed(certificate);
    let n = plant.modes[0].a.nrows();
    let squared = Enclosure::square_times_identity(certificate.decay, n);
    for (errors, &list) in family.errors.iter().zip(&family.lists) {
        for (mode, error) in errors.iter().enumerate() {
            let own = of_mode(&matrices[list], mode);
            let block = growth_block(error, own, own, &squared);
            prove(&block, BlockKind::ObserverDecay, mode, mode)?;
        }
    }
    if certificate.mu > 1.0 || !healthy_in_family(design) {
        prove_changes(plant, design, certificate, &matrices)?;
    }
    require(&[(
        design.observer.minimum_dwell == due_dwell(design, certificate),
        "the least time between changes of the lost sensors does not follow from the proof",
    )])
}

fn enclosed(certificate: &LostCertificate) -> Vec<Vec<Enclosure>> {
    let exact = |matrix: &LyapunovMatrix| Enclosure::exact(matrix.0.clone());
    let lists = certificate.lyapunov.iter();
    lists.map(|list| list.iter().map(exact).collect()).collect()
}

fn of_mode(list: &[Enclosure], mode: usize) -> &Enclosure {
    &list[if list.len() == 1 { 0 } else { mode }]
}

/// Samples for which a set must last: the growth at its end is made up for. A healthy observer that
/// is no Kalman filter counts its error one sample earlier, which costs one more.
pub(crate) fn due_dwell(design: &ObserverDesign, certificate: &LostCertificate) -> usize {
    if certificate.mu <= 1.0 && healthy_in_family(design) {
        return 0;
    }
    let slowest = match healthy_in_family(design) {
        true => certificate.decay,
        false => certificate.decay.max(design.spec.decay),
    };
    let samples = certificate.mu.max(1.0).ln() / (-2.0 * slowest.ln());
    let offset = if healthy_in_family(design) { 1 } else { 2 };
    // The cast saturates, and the sum with it.
    ((samples * (1.0 + 1e-12)) as usize).saturating_add(offset)
}

/// No change lets the function grow by more than `mu`.
fn prove_changes(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    certificate: &LostCertificate,
    matrices: &[Vec<Enclosure>],
) -> Result<(), CertificateError> {
    let n = plant.modes[0].a.nrows();
    let identity = Enclosure::exact(DMatrix::identity(n, n));
    let factor = Enclosure::exact(DMatrix::from_diagonal_element(n, n, certificate.mu));
    for (map, before, after) in changes(plant, design, matrices, &identity) {
        let block = growth_block(&map, &before, &after, &factor);
        prove(&block, BlockKind::LyapunovRatio, 0, 0)?;
    }
    Ok(())
}

/// Every change of set, or of mode where each has its own matrix: the error after it, and the
/// functions before and after.
pub(crate) fn changes(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    matrices: &[Vec<Enclosure>],
    identity: &Enclosure,
) -> Vec<(Enclosure, Enclosure, Enclosure)> {
    let modes = plant.modes.len();
    let all: Vec<&Enclosure> = matrices.iter().flatten().collect();
    let mut found = Vec::new();
    for (a, before) in all.iter().enumerate() {
        for (b, after) in all.iter().enumerate() {
            if a != b {
                found.push((identity.clone(), (*before).clone(), (*after).clone()));
            }
        }
    }
    if healthy_in_family(design) {
        return found;
    }
    let healthy = |mode: usize| {
        let index = design.spec.lyapunov.index(mode);
        Enclosure::exact(design.certificate.lyapunov[index].0.clone())
    };
    let states = &design.certificate.states;
    for (i, j) in all_pairs(modes) {
        let a = scaled_plant(&plant.modes[i].a, states, states);
        let outputs = &design.certificate.outputs;
        let h = scaled_plant(&dense(&design.observer.decoupling[i][j]), states, outputs);
        let c = scaled_plant(&plant.modes[j].c, outputs, states);
        let entered = identity - &(&h * &c);
        for list in matrices {
            found.push((a.clone(), healthy(i), of_mode(list, j).clone()));
            found.push((entered.clone(), of_mode(list, i).clone(), healthy(j)));
        }
    }
    found
}

/// Whether every gain for lost sensors is finite.
pub(crate) fn gains_fit(observer: &Observer) -> bool {
    let gains = observer.lost.iter().flat_map(|set| &set.correction);
    gains.into_iter().all(Matrix::is_finite)
}

/// Everything [`verify`] indexes has the size it must have.
fn check_sizes(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    certificate: &LostCertificate,
) -> Result<(), CertificateError> {
    let dims = plant.dimensions();
    let (n, p, modes) = (dims.states, dims.outputs, plant.modes.len());
    let asked = sets(p);
    let lost = &design.observer.lost;
    let listed = |set: &LostSet| {
        let silent = |gain: &Matrix| {
            gain.shape() == (n, p) && {
                let mut columns = set.sensors.iter().map(|&k| dense(gain).column(k).amax());
                columns.all(|largest| largest == 0.0)
            }
        };
        asked.contains(&set.sensors)
            && set.correction.len() == modes
            && set.correction.iter().all(silent)
    };
    let distinct = (1..lost.len()).all(|k| !lost[..k].iter().any(|o| o.sensors == lost[k].sensors));
    let members = lost.len() + usize::from(healthy_in_family(design));
    let lists = &certificate.lyapunov;
    let one_each = lists.iter().all(|list| list.len() == 1);
    let sized = (one_each || lists.iter().all(|list| list.len() == modes))
        && lists.iter().flatten().all(|p| p.0.shape() == (n, n));
    require(&[
        (
            !lost.is_empty() && lost.iter().all(listed) && distinct,
            "the gains for lost sensors are not one per mode, zero for the lost sensors",
        ),
        (
            sized && (lists.len() == 1 || lists.len() == members),
            "the Lyapunov matrices for lost sensors do not have the sizes of the sets",
        ),
        (
            certificate.decay > 0.0 && certificate.decay < 1.0 && certificate.mu >= 1.0,
            "the claims for lost sensors are out of range",
        ),
        (
            certificate.mu > 1.0 || (lists.len() == 1 && lists[0].len() == 1),
            "several Lyapunov matrices for lost sensors need a growth at changes",
        ),
    ])
}
