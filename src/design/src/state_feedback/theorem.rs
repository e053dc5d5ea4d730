//! Theorems T1 and T2 as they stand: unknowns, block matrices, and how to read the gains.

use super::transformation::Part;
use crate::augmented::AugmentedMode;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::FactoredLyapunov;
use crate::lmi::{Affine, Inequality, Margin, Problem, Variable, trace};
use crate::pseudo_inverse::pseudo_inverse;
use crate::verdict::SolverFailure;
use crate::{ControlSpec, Lyapunov};
use nalgebra::DMatrix;

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
    let (matrices, total) = matrices(spec.lyapunov, &unknowns, models);
    problem.require_trace(&matrices, total);
    (problem, unknowns)
}

/// The distinct Lyapunov matrices, and what their traces add up to if each is the identity.
fn matrices(
    lyapunov: Lyapunov,
    unknowns: &[ModeUnknowns],
    models: &[AugmentedMode],
) -> (Vec<Affine>, f64) {
    let distinct = &unknowns[..lyapunov.matrices(unknowns.len())];
    let matrices = distinct.iter().map(|unknown| unknown.lyapunov.expression());
    let total = distinct.len() * models[0].a.nrows();
    (matrices.collect(), total as f64)
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
                lyapunov: FactoredLyapunov::plain(unknowns.lyapunov.value(scalars)),
            })
        })
        .collect()
}

/// The stabilising gains of largest margin (T1).
pub(super) fn stabilise(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
) -> Result<(Margin, Vec<Part>), SolverFailure> {
    let (problem, unknowns) = stability(models, spec, group);
    let margin = problem.margin_by_general_solver()?;
    let mut parts = read(group, &unknowns, &margin.scalars)?;
    for part in &mut parts {
        // Nothing in (T1) holds down what the inputs do to no state: take it out.
        let input = &models[part.mode].b;
        part.gain = pseudo_inverse(input, 1e-12) * (input * &part.gain);
    }
    Ok((margin, parts))
}

/// How far, as a factor, Lyapunov matrices may be from the identity in one solution of
/// [`least_level`], tried in turn.
const REACHES: [f64; 3] = [1e2, 1e4, 1e6];

/// What of `g` (about 1) may be lost to keep Lyapunov matrices near the identity where they are free.
const NEARNESS: f64 = 1e-6;

/// A solution of [`least_level`].
pub(super) struct LeastLevel {
    /// The `g` that is reached.
    pub level: f64,
    /// Below this no `g` is reached, in the solver's view.
    pub bound: f64,
    /// Gains and Lyapunov matrices.
    pub parts: Vec<Part>,
}

/// The least `g >= floor` of a group (T2), as the solver sees it, with the gains that come with it,
/// among Lyapunov matrices within reach of the identity. Without that limit the least `g` need not
/// be attained: what the disturbance does not reach lets Lyapunov matrices grow or vanish for ever.
pub(super) fn least_level(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    floor: f64,
) -> Result<LeastLevel, SolverFailure> {
    let within = |reach| least_level_within(reach, models, spec, group, floor);
    let farther = REACHES[1..].iter().copied();
    farther.fold(within(REACHES[0]), |found, reach| {
        found.or_else(|_| within(reach))
    })
}

/// [`least_level`] with one reach.
fn least_level_within(
    reach: f64,
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    floor: f64,
) -> Result<LeastLevel, SolverFailure> {
    let mut problem = Problem::new();
    let unknowns = unknowns(&mut problem, models, spec.lyapunov, group);
    let (level, least) = (problem.scalar(), problem.scalar());
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
    problem.require_at_least(&level, floor);
    problem.require_at_least(&least, 1.0 / reach);
    let (matrices, total) = matrices(spec.lyapunov, &unknowns, models);
    problem.require_trace_below(&matrices, reach * total);
    let spread = (1.0 / (reach * total)) * trace(&matrices) - least.expression();
    for (matrix, &mode) in matrices.into_iter().zip(group) {
        let name = BlockName::new(BlockKind::Lyapunov, mode, mode);
        let above = matrix - least.times_identity(models[0].a.nrows());
        problem.require(Inequality::new(name, vec![vec![Some(above)]]));
    }
    let found = problem.minimise(level.expression() + NEARNESS * spread)?;
    Ok(LeastLevel {
        level: level.value(&found.scalars)[(0, 0)],
        bound: found.bound - NEARNESS,
        parts: read(group, &unknowns, &found.scalars)?,
    })
}

/// How much larger than the identity the Lyapunov matrices of a centred solution may be on average.
pub(super) const CENTRED_TRACE: f64 = 10.0;

/// The gains of largest margin at a given `g` (T2), in coordinates where Lyapunov matrices near the
/// identity will do.
pub(super) fn centred(
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
    let (matrices, total) = matrices(spec.lyapunov, &unknowns, models);
    problem.require_trace_below(&matrices, CENTRED_TRACE * total);
    read(
        group,
        &unknowns,
        &problem.margin_by_general_solver()?.scalars,
    )
}
