//! From the augmented model to certified gains.
//!
//! Scale; decide feasibility by the margin problem; minimise `g = gamma^2` in well-conditioned
//! coordinates; relax `g` by a few parts in 1e5 and maximise the margin, so that the result lies strictly
//! inside; scale back; certify.

use super::advice;
use super::proof::provable_dwell;
use super::structured;
use super::theorem;
use super::transformation::{Part, Transformation};
use super::{ModeGains, REJECTION, StateFeedback};
use crate::augmented::{AugmentedMode, augment, scaled};
use crate::certificate::{ControlCertificate, FactoredLyapunov};
use crate::lmi::Margin;
use crate::units::other_scaling;
use crate::verdict::{DesignError, SolverFailure, infeasible};
use crate::{ControlSpec, Lyapunov, Objective, Run, Solver, Step, Units, parallel};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Dimensions, SwitchedPlant, spectral_radius};
use nalgebra::DMatrix;

/// Relative increases of `g = gamma^2` for a margin, tried in turn until the certificate holds.
pub(super) const RELAXATIONS: [f64; 6] = [2e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// A margin below this is no margin: the solver's own accuracy.
const SMALLEST_MARGIN: f64 = 1e-9;

/// A margin that rounding errors in the proof cannot take away.
const PROVABLE_MARGIN: f64 = 1e-6;

/// A margin above this needs no better coordinates.
const SUFFICIENT_MARGIN: f64 = 1e-2;

/// How often better coordinates are sought.
pub(super) const TRANSFORMATIONS: usize = 12;

/// A least level that better coordinates change by less than this, relatively, is the least.
pub(super) const AGREEMENT: f64 = 1e-5;

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
    synthesise_with(plant, spec, scaling, &Run::default())
}

/// [`synthesise`] with a chosen solver, its progress reported. A verdict that there is no design is
/// given only after another scaling has confirmed it.
///
/// # Errors
/// As [`synthesise`].
pub fn synthesise_with(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    scaling: &Scaling,
    run: &Run,
) -> Result<StateFeedback, DesignError> {
    let first = attempt(plant, spec, scaling, run);
    let confirmed = first.or_else(|error| match error {
        DesignError::Request(_) => Err(error),
        doubtful => attempt(plant, spec, &other_scaling(plant, scaling), run).or(Err(doubtful)),
    });
    confirmed.map_err(|mut error| {
        if let Some(advice) = error.advice_mut() {
            let works = |candidate: &ControlSpec| succeeds(plant, candidate, scaling, run);
            *advice = advice::search(spec, &works);
        }
        error
    })
}

/// The same without advice.
fn attempt(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    scaling: &Scaling,
    run: &Run,
) -> Result<StateFeedback, DesignError> {
    let dims = Dimensions::check(plant)?;
    spec.check(dims)?;
    let units = Units::choose(plant, spec, scaling);
    let problem = Problem {
        plant,
        spec,
        run: *run,
        models: augment(plant, spec, &units),
        units,
    };
    let disturbed = problem.models.iter().any(|model| model.e.amax() > 0.0);
    let optimised = spec.objective == Objective::Attenuation && disturbed;
    if !(optimised && run.solver == Solver::Structured) {
        return problem.step_by_step(optimised);
    }
    let Some(direct) = problem.direct() else {
        return problem.step_by_step(true);
    };
    if is_sharp(&direct) || !problem.is_small() {
        return Ok(direct);
    }
    (run.watch)(Step::GeneralSolver);
    let general = Problem {
        run: Run {
            solver: Solver::General,
            ..*run
        },
        ..problem
    };
    Ok(match general.step_by_step(true) {
        Ok(other) if is_sharp(&other) || mean_gamma(&other) < mean_gamma(&direct) => other,
        _ => direct,
    })
}

/// Whether every mode's gamma is known to be the optimum well within 1e-4, or as good as zero.
fn is_sharp(design: &StateFeedback) -> bool {
    const SHARP: f64 = 5e-5;
    let pairs = design
        .gamma
        .iter()
        .flatten()
        .zip(design.optimum.iter().flatten());
    let units = &design.certificate.units;
    let rejection = 2.0 * REJECTION * units.performance / units.disturbance;
    let sharp =
        |(gamma, optimum): (&f64, &f64)| *gamma < (1.0 + SHARP) * optimum || *gamma < rejection;
    pairs.into_iter().all(sharp)
}

/// The geometric mean of the modes' gammas, as a logarithm times their number: modes of unlike gammas count
/// alike.
fn mean_gamma(design: &StateFeedback) -> f64 {
    let gamma = design.gamma.iter().flatten();
    gamma.map(|gamma| gamma.max(f64::MIN_POSITIVE).ln()).sum()
}

/// Whether a request leads all the way to certified gains. The fastest test comes first: whether
/// decay and guarantee can be had at all.
fn succeeds(plant: &SwitchedPlant, spec: &ControlSpec, scaling: &Scaling, run: &Run) -> bool {
    let units = Units::choose(plant, spec, scaling);
    let models = augment(plant, spec, &units);
    let stabilised = spec.lyapunov.groups(models.len()).iter().all(|group| {
        let found = stable(&models, spec, group, run);
        found.is_ok_and(|(margin, parts)| parts.is_some() && margin.margin >= PROVABLE_MARGIN)
    });
    stabilised && attempt(plant, spec, scaling, run).is_ok()
}

/// Gains with their margin.
type Stabilised = (Margin, Vec<Part>);

/// (T1) by the general solver, or by the one that uses the structure.
fn stabilise(
    solver: Solver,
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    run: &Run,
) -> Result<Stabilised, SolverFailure> {
    match solver {
        Solver::Structured => structured::stabilise(models, spec, group, run),
        Solver::General => theorem::stabilise(models, spec, group),
    }
}

/// Stabilising gains of a group with their margin, sought in the design's coordinates and, where
/// these show hardly any, in those of a regulator; no gains where neither does. The general solver is
/// asked where the other one gives no clear answer.
fn stable(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    run: &Run,
) -> Result<(Margin, Option<Vec<Part>>), SolverFailure> {
    if run.solver == Solver::Structured {
        if let Ok(answer) = stable_by(Solver::Structured, models, spec, group, run) {
            return Ok(answer);
        }
        (run.watch)(Step::GeneralSolver);
    }
    stable_by(Solver::General, models, spec, group, run)
}

/// [`stable`] by one solver.
fn stable_by(
    solver: Solver,
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    run: &Run,
) -> Result<(Margin, Option<Vec<Part>>), SolverFailure> {
    let plain = match stabilise(solver, models, spec, group, run) {
        Ok((margin, parts)) if margin.margin >= PROVABLE_MARGIN => {
            return Ok((margin, Some(parts)));
        }
        uncertain => uncertain,
    };
    let regulated = Transformation::of_regulated(models, group, spec.decay).map(|transformation| {
        let found = stabilise(solver, &transformation.view(models), spec, group, run);
        found.map(|(margin, parts)| (margin, transformation.restore(parts)))
    });
    match regulated {
        Some(Ok((margin, parts))) if margin.margin >= PROVABLE_MARGIN => {
            return Ok((margin, Some(parts)));
        }
        // Both must have an answer, unless the other solver has been asked already.
        Some(Err(failure)) if solver == Solver::Structured => return Err(failure),
        _ => {}
    }
    let (margin, parts) = plain?;
    let shown = margin.margin >= SMALLEST_MARGIN;
    Ok((margin, shown.then_some(parts)))
}

/// The gains solved for again in the coordinates they suggest, as long as the margin is below
/// [`SUFFICIENT_MARGIN`] and doubles.
fn with_larger_margin(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    (mut margin, mut parts): Stabilised,
    run: &Run,
) -> Stabilised {
    for _ in 0..TRANSFORMATIONS {
        let transformation = Transformation::of_stabilised(models, &parts);
        let Some(transformation) = transformation.filter(|_| margin.margin < SUFFICIENT_MARGIN)
        else {
            break;
        };
        match stabilise(run.solver, &transformation.view(models), spec, group, run) {
            Ok((better, found)) if better.margin > 2.0 * margin.margin => {
                (margin, parts) = (better, transformation.restore(found));
            }
            _ => break,
        }
    }
    (margin, parts)
}

/// Whether a group of modes can be stabilised as asked.
enum Verdict {
    Stable(Vec<Part>),
    Conflict(Margin),
}

/// The least level of a group.
pub(super) struct Optimum {
    /// `g = gamma^2` in the design's units.
    pub level: f64,
    /// The solver's lower bound of `g` (not proved); zero where it gives none.
    pub bound: f64,
    /// Coordinates in which the solution is near the identity.
    pub transformation: Transformation,
}

/// What every stage works on.
pub(super) struct Problem<'a> {
    plant: &'a SwitchedPlant,
    pub spec: &'a ControlSpec,
    pub run: Run<'a>,
    units: Units,
    pub models: Vec<AugmentedMode>,
}

impl Problem<'_> {
    /// Modes that share a problem.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        self.spec.lyapunov.groups(self.models.len())
    }

    /// Step by step: stabilising gains first, which decides feasibility, then the least level from there.
    fn step_by_step(&self, optimised: bool) -> Result<StateFeedback, DesignError> {
        let stable = parallel::all(&self.groups(), |group| match self.stabilised(group)? {
            Verdict::Stable(parts) => Ok(parts),
            Verdict::Conflict(margin) => Err(infeasible(margin.margin, margin.weights)),
        })?;
        match optimised {
            true => self.attenuate(&stable),
            false => self.certified(stable.concat(), None),
        }
    }

    /// Stabilising gains of a group (T1).
    fn stabilised(&self, group: &[usize]) -> Result<Verdict, SolverFailure> {
        Ok(match stable(&self.models, self.spec, group, &self.run)? {
            (margin, Some(parts)) => {
                let found = (margin, parts);
                Verdict::Stable(
                    with_larger_margin(&self.models, self.spec, group, found, &self.run).1,
                )
            }
            (margin, None) => Verdict::Conflict(margin),
        })
    }

    /// The least `g` of a group, and coordinates in which (T2) is at ease near it: each solution's
    /// coordinates serve the next, which looks at Lyapunov matrices further away, until both agree.
    fn least_level(&self, group: &[usize], start: &[Part]) -> Result<Optimum, SolverFailure> {
        let models = &self.models;
        let (size, inputs) = models[0].b.shape();
        let mut transformation = Transformation::of_stabilised(models, start)
            .unwrap_or_else(|| Transformation::identity(size, inputs));
        if self.run.solver == Solver::Structured {
            if let Some(found) = self.settled_level(&transformation, group) {
                return Ok(found.optimum);
            }
            (self.run.watch)(Step::GeneralSolver);
        }
        let (mut least, mut bound): (Option<f64>, f64) = (None, 0.0);
        for _ in 0..TRANSFORMATIONS {
            let floor = transformation.view_level(REJECTION.powi(2));
            let view = transformation.view(models);
            let Ok(found) = theorem::least_level(&view, self.spec, group, floor) else {
                break;
            };
            let level = transformation.restore_level(found.level.max(floor));
            if least.is_some_and(|least| (level / least - 1.0).abs() < AGREEMENT) {
                (least, bound) = (
                    Some(level),
                    transformation.restore_level(found.bound.max(0.0)),
                );
                break;
            }
            let parts = transformation.restore(found.parts);
            let Some(better) = Transformation::of_attenuated(models, &parts, level) else {
                break;
            };
            (least, transformation) = (Some(level), better);
        }
        let level = least.ok_or(SolverFailure::NumericalTrouble)?;
        Ok(Optimum {
            level,
            bound,
            transformation,
        })
    }

    /// Theorem T2: the least `gamma`, gains that reach it up to the relaxation, and their proof.
    fn attenuate(&self, stable: &[Vec<Part>]) -> Result<StateFeedback, DesignError> {
        let groups = self.groups();
        let starts: Vec<(&Vec<usize>, &Vec<Part>)> = groups.iter().zip(stable).collect();
        let least = parallel::all(&starts, |(group, start)| self.least_level(group, start))?;
        let mut outcome = Err(DesignError::Solver(SolverFailure::NumericalTrouble));
        for relaxation in RELAXATIONS {
            outcome = self.centred(&groups, &least, relaxation);
            if outcome.is_ok() {
                break;
            }
        }
        outcome
    }

    /// Gains of largest margin at the least levels, each increased by the factor `1 + relaxation`, certified.
    fn centred(
        &self,
        groups: &[Vec<usize>],
        least: &[Optimum],
        relaxation: f64,
    ) -> Result<StateFeedback, DesignError> {
        let mut levels = Levels::new(self);
        let problems: Vec<(&Vec<usize>, &Transformation, f64)> = groups
            .iter()
            .zip(least)
            .map(|(group, least)| {
                let level = levels.set(group, least, relaxation);
                (group, &least.transformation, level)
            })
            .collect();
        let parts = parallel::all(&problems, |&(group, transformation, level)| {
            let structured = match self.run.solver {
                Solver::Structured => self.direct_centre(group, transformation, level),
                Solver::General => None,
            };
            match structured {
                Some(found) => Ok(found),
                None => {
                    let view = transformation.view(&self.models);
                    let level = transformation.view_level(level);
                    let found = theorem::centred(&view, self.spec, group, level)?;
                    Ok::<_, SolverFailure>(transformation.restore(found))
                }
            }
        })?;
        self.certified(parts.concat(), Some(levels))
    }

    /// Puts the parts together in physical units, and proves the whole.
    pub fn certified(
        &self,
        parts: Vec<Part>,
        levels: Option<Levels>,
    ) -> Result<StateFeedback, DesignError> {
        let (spec, plant) = (self.spec, self.plant);
        let distinct = &parts[..spec.lyapunov.matrices(parts.len())];
        let matrices: Vec<FactoredLyapunov> =
            distinct.iter().map(|part| part.lyapunov.clone()).collect();
        let dwell = match spec.lyapunov {
            Lyapunov::Dwell => Some(provable_dwell(&matrices, spec.decay, plant.sample_time)?),
            Lyapunov::Common | Lyapunov::Switched => None,
        };
        let closed = self.models.iter().zip(&parts);
        let (gamma, optimum) = levels.map(|l| (l.gamma, l.optimum)).unzip();
        let design = StateFeedback {
            spec: spec.clone(),
            spectral_radius: closed
                .map(|(model, part)| spectral_radius(&(&model.a + &model.b * &part.gain)))
                .collect(),
            modes: parts
                .iter()
                .map(|part| physical_gains(&part.gain, &self.units, spec))
                .collect(),
            gamma,
            optimum,
            dwell,
            certificate: ControlCertificate {
                units: self.units.clone(),
                lyapunov: matrices,
            },
        };
        design.verify(plant)?;
        Ok(design)
    }
}

/// `gamma` per mode, in the user's units.
pub(super) struct Levels {
    gamma: Vec<f64>,
    optimum: Vec<f64>,
    /// What one unit of `gamma` in the design's units is to the user.
    physical: f64,
}

impl Levels {
    pub fn new(problem: &Problem) -> Self {
        let modes = problem.models.len();
        Self {
            gamma: vec![0.0; modes],
            optimum: vec![0.0; modes],
            physical: problem.units.performance / problem.units.disturbance,
        }
    }

    /// Notes the least level `g` of a group, increases it by the factor `1 + relaxation`, and returns the `g`
    /// to prove.
    pub fn set(&mut self, group: &[usize], least: &Optimum, relaxation: f64) -> f64 {
        let relaxed = least.level * (1.0 + relaxation);
        for &mode in group {
            self.optimum[mode] = least.bound.sqrt() * self.physical;
            self.gamma[mode] = relaxed.sqrt() * self.physical;
        }
        relaxed
    }
}

/// Splits `K~ = [K, K_u, G]` and undoes the scaling; exact, since the units are powers of two.
fn physical_gains(gain: &DMatrix<f64>, units: &Units, spec: &ControlSpec) -> ModeGains {
    let (n, m) = (units.states.len(), units.inputs.len());
    let previous = spec.latency * m;
    let inverse = |values: &[f64]| values.iter().map(|v| 1.0 / v).collect::<Vec<_>>();
    let outward = inverse(&units.inputs);
    let part = |first: usize, units: &[f64]| {
        let block = gain.columns(first, units.len()).into_owned();
        scaled(&block, &outward, &inverse(units))
    };
    ModeGains {
        state_feedback: part(0, &units.states),
        previous_input: part(n, &units.inputs[..previous]),
        integral: part(n + previous, &units.integral_part(spec)),
    }
}
