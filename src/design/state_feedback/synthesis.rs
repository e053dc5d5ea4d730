//! The road from the augmented model to certified gains.
//!
//! Scale; decide feasibility by the margin problem; minimise `g = gamma^2`; give up a hair of the
//! optimum for the largest margin, so that the result lies strictly inside; scale back; certify.

use super::advice;
use super::{ModeGains, StateFeedback};
use crate::design::augmented::{AugmentedMode, augment, scaled};
use crate::design::certificate::{ControlCertificate, LyapunovMatrix, largest_ratio};
use crate::design::lmi::{Affine, Inequality, Problem, Variable};
use crate::design::lyapunov::all_pairs;
use crate::design::verdict::{BlockKind, BlockName, DesignError, SolverFailure, infeasible};
use crate::design::{CertificateError, ControlSpec, DwellTime, Lyapunov, Objective, Units};
use crate::plant::scaling::Scaling;
use crate::plant::{Dimensions, SwitchedPlant, spectral_radius};
use nalgebra::DMatrix;

/// Relative sacrifices of `g = gamma^2` for a margin, tried in turn until the certificate holds.
const SACRIFICES: [f64; 4] = [2e-5, 1e-4, 1e-3, 1e-2];

/// A margin below this is no margin: the solver's own accuracy.
const SMALLEST_MARGIN: f64 = 1e-9;

/// Designs the state feedback that is asked for and proves it.
///
/// `scaling` holds the nominal values of the signals (see [`Scaling::automatic`]).
///
/// # Errors
/// An ill-formed request, a conflict between inequalities (named, with advice that was tried), a
/// failure of the solver, or a result that cannot be certified.
pub fn synthesise(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    scaling: &Scaling,
) -> Result<StateFeedback, DesignError> {
    let dims = Dimensions::check(plant).map_err(DesignError::Request)?;
    spec.check(dims).map_err(DesignError::Request)?;
    let units = Units::choose(plant, spec, scaling);
    let models = augment(plant, spec, &units);

    for group in spec.lyapunov.groups(models.len()) {
        let margin = stability(&models, spec, &group).0.margin()?;
        if margin.margin < SMALLEST_MARGIN {
            let advice = advice::search(plant, spec, scaling);
            return Err(infeasible(margin.margin, margin.weights, advice));
        }
    }
    let attenuates =
        spec.objective == Objective::Attenuation && models.iter().any(|model| model.e.amax() > 0.0);
    if attenuates {
        attenuate(plant, spec, &units, &models)
    } else {
        let parts = each_group(spec, &models, |group| stabilise(&models, spec, group))?;
        let design = assemble(plant, spec, &units, &models, parts, None)?;
        design.verify(plant)?;
        Ok(design)
    }
}

/// Whether decay and guarantee can be had at all; the cheap question behind every advice.
pub(super) fn is_feasible(plant: &SwitchedPlant, spec: &ControlSpec, scaling: &Scaling) -> bool {
    let units = Units::choose(plant, spec, scaling);
    let models = augment(plant, spec, &units);
    spec.lyapunov.groups(models.len()).iter().all(|group| {
        let margin = stability(&models, spec, group).0.margin();
        margin.is_ok_and(|found| found.margin > 1e3 * SMALLEST_MARGIN)
    })
}

/// The unknowns of one mode: `S`, `G + G' - S` as an expression, `G` and `R = K~ G`.
struct ModeUnknowns {
    /// `S_i`: proves.
    lyapunov: Variable,
    /// `G_i`: equals `S_i` unless the guarantee is `switched`.
    slack: Variable,
    /// `R_i = K~_i G_i`.
    feedback: Variable,
}

impl ModeUnknowns {
    /// `G + G' - S`, which is `S` itself when `G` is.
    fn own(&self, lyapunov: Lyapunov) -> Affine {
        match lyapunov {
            Lyapunov::Switched => {
                let slack = self.slack.expression();
                slack.clone() + slack.transpose() - self.lyapunov.expression()
            }
            Lyapunov::Common | Lyapunov::Dwell => self.lyapunov.expression(),
        }
    }
}

/// Makes the unknowns for the modes of a group.
fn unknowns(
    problem: &mut Problem,
    models: &[AugmentedMode],
    lyapunov: Lyapunov,
    group: &[usize],
) -> Vec<ModeUnknowns> {
    let (size, inputs) = models[0].b.shape();
    let mut shared = None;
    group
        .iter()
        .map(|_| {
            let own = match (lyapunov, shared) {
                (Lyapunov::Common, Some(first)) => first,
                _ => problem.symmetric(size),
            };
            shared = Some(own);
            ModeUnknowns {
                lyapunov: own,
                slack: match lyapunov {
                    Lyapunov::Switched => problem.full(size, size),
                    Lyapunov::Common | Lyapunov::Dwell => own,
                },
                feedback: problem.full(inputs, size),
            }
        })
        .collect()
}

/// `A G + B R`.
fn next_state(model: &AugmentedMode, unknowns: &ModeUnknowns) -> Affine {
    &model.a * &unknowns.slack + &model.b * &unknowns.feedback
}

/// Demands the decay block of (T2) for every pair of a group.
fn require_decay(
    problem: &mut Problem,
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    unknowns: &[ModeUnknowns],
) {
    for (i, j) in spec.lyapunov.pairs(group.len()) {
        let name = BlockName::new(BlockKind::Decay, group[i], group[j]);
        let own = spec.decay.powi(2) * unknowns[i].own(spec.lyapunov);
        let next = next_state(&models[group[i]], &unknowns[i]);
        problem.require(Inequality::new(
            name,
            vec![
                vec![Some(own)],
                vec![Some(next), Some(unknowns[j].lyapunov.expression())],
            ],
        ));
    }
}

/// Demands the attenuation block of (T2) for every pair of a group, `level` being `g I`.
fn require_attenuation(
    problem: &mut Problem,
    models: &[AugmentedMode],
    lyapunov: Lyapunov,
    group: &[usize],
    unknowns: &[ModeUnknowns],
    level: &Affine,
) {
    for (i, j) in lyapunov.pairs(group.len()) {
        let model = &models[group[i]];
        let name = BlockName::new(BlockKind::Attenuation, group[i], group[j]);
        let performance = &model.h * &unknowns[i].slack + &model.d * &unknowns[i].feedback;
        let signals = model.h.nrows();
        problem.require(Inequality::new(
            name,
            vec![
                vec![Some(unknowns[i].own(lyapunov))],
                vec![None, Some(level.clone())],
                vec![
                    Some(next_state(model, &unknowns[i])),
                    Some(model.e.clone().into()),
                    Some(unknowns[j].lyapunov.expression()),
                ],
                vec![
                    Some(performance),
                    None,
                    None,
                    Some(DMatrix::identity(signals, signals).into()),
                ],
            ],
        ));
    }
}

/// Theorem T1 of a group, normalised: the traces of the Lyapunov matrices add up to their sizes.
fn stability(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
) -> (Problem, Vec<ModeUnknowns>) {
    let mut problem = Problem::new();
    let unknowns = unknowns(&mut problem, models, spec.lyapunov, group);
    require_decay(&mut problem, models, spec, group, &unknowns);
    let distinct = spec.lyapunov.matrices(group.len());
    let matrices: Vec<Affine> = unknowns[..distinct]
        .iter()
        .map(|unknown| unknown.lyapunov.expression())
        .collect();
    let total = distinct * models[0].a.nrows();
    problem.require_trace(&matrices, total as f64);
    (problem, unknowns)
}

/// Gains and Lyapunov matrix of one mode, in the design's units.
struct Part {
    mode: usize,
    gain: DMatrix<f64>,
    lyapunov: DMatrix<f64>,
}

/// Solves every group and puts the parts in the order of the modes.
fn each_group(
    spec: &ControlSpec,
    models: &[AugmentedMode],
    mut solve: impl FnMut(&[usize]) -> Result<Vec<Part>, SolverFailure>,
) -> Result<Vec<Part>, DesignError> {
    let mut parts = Vec::new();
    for group in spec.lyapunov.groups(models.len()) {
        parts.extend(solve(&group)?);
    }
    parts.sort_by_key(|part| part.mode);
    Ok(parts)
}

/// Reads gains and Lyapunov matrices of a group: `K~ = R G^-1`.
fn read(
    group: &[usize],
    unknowns: &[ModeUnknowns],
    scalars: &[f64],
) -> Result<Vec<Part>, SolverFailure> {
    let modes = group.iter().zip(unknowns);
    modes
        .map(|(&mode, unknowns)| {
            let slack = unknowns.slack.value(scalars);
            let feedback = unknowns.feedback.value(scalars);
            let gain = slack
                .transpose()
                .lu()
                .solve(&feedback.transpose())
                .ok_or(SolverFailure::NumericalTrouble)?
                .transpose();
            Ok(Part {
                mode,
                gain,
                lyapunov: unknowns.lyapunov.value(scalars),
            })
        })
        .collect()
}

/// The stabilising gains of largest margin.
fn stabilise(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
) -> Result<Vec<Part>, SolverFailure> {
    let (problem, unknowns) = stability(models, spec, group);
    read(group, &unknowns, &problem.margin()?.scalars)
}

/// The least `g` of a group, as the solver sees it.
fn least_level(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
) -> Result<f64, SolverFailure> {
    let mut problem = Problem::new();
    let unknowns = unknowns(&mut problem, models, spec.lyapunov, group);
    let level = problem.scalar();
    let identity = level.times_identity(models[0].e.ncols());
    require_attenuation(
        &mut problem,
        models,
        spec.lyapunov,
        group,
        &unknowns,
        &identity,
    );
    require_decay(&mut problem, models, spec, group, &unknowns);
    Ok(problem.minimise(&level)?.objective)
}

/// The gains of largest margin at a given `g`.
fn centred(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    level: f64,
) -> Result<Vec<Part>, SolverFailure> {
    let mut problem = Problem::new();
    let unknowns = unknowns(&mut problem, models, spec.lyapunov, group);
    let disturbances = models[0].e.ncols();
    let identity = DMatrix::from_diagonal_element(disturbances, disturbances, level).into();
    require_attenuation(
        &mut problem,
        models,
        spec.lyapunov,
        group,
        &unknowns,
        &identity,
    );
    require_decay(&mut problem, models, spec, group, &unknowns);
    read(group, &unknowns, &problem.margin()?.scalars)
}

/// Theorem T2: the least `gamma`, the gains that reach it, and their proof.
fn attenuate(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    units: &Units,
    models: &[AugmentedMode],
) -> Result<StateFeedback, DesignError> {
    let mut least = vec![0.0; models.len()];
    for group in spec.lyapunov.groups(models.len()) {
        let level = least_level(models, spec, &group)?.max(f64::MIN_POSITIVE);
        group.iter().for_each(|&mode| least[mode] = level);
    }
    let physical = units.performance / units.disturbance;
    let optimum: Vec<f64> = least.iter().map(|level| level.sqrt() * physical).collect();

    let mut outcome = Err(DesignError::Solver(SolverFailure::NumericalTrouble));
    for sacrifice in SACRIFICES {
        let gamma: Vec<f64> = least
            .iter()
            .map(|level| (level * (1.0 + sacrifice)).sqrt() * physical)
            .collect();
        let level = |mode: usize| (gamma[mode] / physical).powi(2);
        outcome = each_group(spec, models, |group| {
            centred(models, spec, group, level(group[0]))
        })
        .and_then(|parts| {
            let levels = Some((gamma.clone(), optimum.clone()));
            let design = assemble(plant, spec, units, models, parts, levels)?;
            design.verify(plant)?;
            Ok(design)
        });
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// Puts the parts together, in physical units.
fn assemble(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    units: &Units,
    models: &[AugmentedMode],
    parts: Vec<Part>,
    levels: Option<(Vec<f64>, Vec<f64>)>,
) -> Result<StateFeedback, DesignError> {
    let distinct = spec.lyapunov.matrices(parts.len());
    let matrices: Vec<DMatrix<f64>> = parts[..distinct]
        .iter()
        .map(|part| part.lyapunov.clone())
        .collect();
    let dwell = match spec.lyapunov {
        Lyapunov::Dwell => Some(dwell_time(&matrices, spec.decay, plant.sample_time)?),
        Lyapunov::Common | Lyapunov::Switched => None,
    };
    let closed = models.iter().zip(&parts);
    let (gamma, optimum) = levels.unzip();
    Ok(StateFeedback {
        spec: spec.clone(),
        spectral_radius: closed
            .map(|(model, part)| spectral_radius(&(&model.a + &model.b * &part.gain)))
            .collect(),
        modes: parts
            .iter()
            .map(|part| physical_gains(&part.gain, units, spec.latency))
            .collect(),
        gamma,
        optimum,
        dwell,
        certificate: ControlCertificate {
            units: units.clone(),
            lyapunov: matrices.into_iter().map(LyapunovMatrix).collect(),
        },
    })
}

/// Splits `K~ = [K, K_u, G]` and undoes the scaling; exact, since the units are powers of two.
fn physical_gains(gain: &DMatrix<f64>, units: &Units, latency: usize) -> ModeGains {
    let (n, m, r) = (
        units.states.len(),
        units.inputs.len(),
        units.integrators.len(),
    );
    let previous = latency * m;
    let inverse = |values: &[f64]| values.iter().map(|v| 1.0 / v).collect::<Vec<_>>();
    let outward = inverse(&units.inputs);
    let part = |first: usize, units: &[f64]| {
        let block = gain.columns(first, units.len()).into_owned();
        scaled(&block, &outward, &inverse(units))
    };
    ModeGains {
        state_feedback: part(0, &units.states),
        previous_input: part(n, &units.inputs[..previous]),
        integral: part(n + previous, &units.integrators[..r]),
    }
}

/// The dwell time that the factor between the Lyapunov matrices asks for, with `mu` a hair above
/// its computed value so that it can be proved.
fn dwell_time(
    matrices: &[DMatrix<f64>],
    decay: f64,
    sample_time: f64,
) -> Result<DwellTime, DesignError> {
    let mut mu = 1.0_f64;
    for (i, j) in all_pairs(matrices.len()) {
        if i != j {
            let ratio = largest_ratio(&matrices[i], &matrices[j]).ok_or_else(|| {
                CertificateError::Unproved(BlockName::new(BlockKind::Lyapunov, j, j))
            })?;
            mu = mu.max(ratio);
        }
    }
    Ok(DwellTime::new(mu * (1.0 + 1e-9), decay, sample_time))
}
