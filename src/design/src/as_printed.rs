//! The paper's Theorems 1 and 2 as they are printed, put to the margin problem.
//!
//! They are kept as a baseline that shows why [`state_feedback`](super::state_feedback) builds
//! something else: for no plant do they have a strictly feasible point.

use super::augmented::augment;
use super::blocks::{BlockKind, BlockName};
use super::lmi::{Affine, Inequality, Margin, Problem};
use super::verdict::{ConflictingBlock, DesignError, by_weight};
use super::{ControlSpec, RequestError, Units};
use ftc_plant::{Dimensions, SwitchedPlant};
use serde::Serialize;

/// A margin below this is no margin: the solver's own accuracy.
const SMALLEST_MARGIN: f64 = 1e-8;

/// What became of a printed theorem.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PrintedVerdict {
    /// The paper's equation.
    pub equation: &'static str,
    /// Whether it has a strictly feasible point.
    pub feasible: bool,
    /// The largest `t` for which every inequality holds with `>= t I` and `trace Q = n`.
    pub margin: f64,
    /// The inequalities that limit the margin, the largest share first.
    pub blocks: Vec<ConflictingBlock>,
    /// Why it cannot be otherwise.
    pub reason: &'static str,
}

impl PrintedVerdict {
    fn new(equation: &'static str, reason: &'static str, margin: Margin) -> Self {
        Self {
            equation,
            feasible: margin.margin > SMALLEST_MARGIN,
            margin: margin.margin,
            blocks: by_weight(margin.weights),
            reason,
        }
    }
}

/// The printed theorems have one block `Q` for states and integrators: they need as many of these
/// as of those.
fn check(plant: &SwitchedPlant, equation: &'static str) -> Result<Dimensions, DesignError> {
    let dims = Dimensions::check(plant)?;
    match dims.states == dims.outputs {
        true => Ok(dims),
        false => Err(RequestError::Printed {
            equation,
            outputs: dims.outputs,
            states: dims.states,
        }
        .into()),
    }
}

/// Theorem 1, equation (10), for every mode:
///
/// ```text
/// [ Q                .           .   . ]
/// [ 0                Q           .   . ]
/// [ A_i Q + B_i F_i' B_i H_i'    Q   . ]  > 0
/// [ 0                Q           0   Q ]
/// ```
///
/// # Errors
/// When the plant does not have as many outputs as states, or the solver fails.
pub fn theorem_1(plant: &SwitchedPlant) -> Result<PrintedVerdict, DesignError> {
    let n = check(plant, "(10)")?.states;
    let mut problem = Problem::new();
    let q = problem.symmetric(n);
    let whole = || Some(q.expression());
    for (index, mode) in plant.modes.iter().enumerate() {
        let inputs = mode.b.ncols();
        // F_i' and H_i' of (10).
        let (f, h) = (problem.full(inputs, n), problem.full(inputs, n));
        let next = &mode.a * &q + &mode.b * &f;
        problem.require(Inequality::new(
            BlockName::new(BlockKind::Printed, index, index),
            vec![
                vec![whole()],
                vec![None, whole()],
                vec![Some(next), Some(&mode.b * &h), whole()],
                vec![None, whole(), None, whole()],
            ],
        ));
    }
    problem.require_trace(&[q.expression()], n as f64);
    Ok(PrintedVerdict::new(
        "(10)",
        "block rows 2 and 4 hold [Q Q; Q Q], which is singular for every Q, so the matrix cannot be positive \
         definite; semidefinite it forces H_i B_i' = 0, that is, no integral action",
        problem.margin_by_general_solver()?,
    ))
}

/// Theorem 2, equation (36) (the same as (21)), in its best case.
///
/// `eta = X'QX - X' - X` is not linear, but `eta >= -Q^-1` for every `X`, with equality at
/// `X = Q^-1`: no other `X` can do better. With that `X` and the congruence
/// `diag(I, I, I, I, -Q, -Q)` the negative of (36) reads
///
/// ```text
/// [ Q - H'H        .           .       .     .  . ]
/// [ 0              Q - H'H     .       .     .  . ]
/// [ 0              0           g I     .     .  . ]
/// [ 0              0           0       g I   .  . ]  > 0
/// [ Q A_i + Q K_i  Q B_i G_i   Q E_i   0     Q  . ]
/// [ 0              Q           0       Q E_i 0  Q ]
/// ```
///
/// where `Q K_i` and `Q B_i G_i` are taken as free unknowns: what this cannot satisfy, (36) cannot.
/// `H` is the output weight, `W_y S C`.
///
/// # Errors
/// When the request is ill-formed, the plant does not have as many outputs as states, or the
/// solver fails.
pub fn theorem_2(plant: &SwitchedPlant, spec: &ControlSpec) -> Result<PrintedVerdict, DesignError> {
    let dims = check(plant, "(36)")?;
    spec.check(dims)?;
    let (n, s) = (dims.states, dims.disturbances);
    let models = augment(plant, spec, &Units::unit(plant, spec.tracked.len()));
    let mut problem = Problem::new();
    let q = problem.symmetric(n);
    let level = problem.scalar();
    for (index, (mode, model)) in plant.modes.iter().zip(&models).enumerate() {
        let output = model.h.view((0, 0), (spec.tracked.len(), n));
        let weighted: Affine = q.expression() - Affine::from(output.transpose() * output);
        let (state, integral) = (problem.full(n, n), problem.full(n, n));
        let next = &q * &mode.a + state.expression();
        let disturbance = || Some(&q * &mode.e);
        problem.require(Inequality::new(
            BlockName::new(BlockKind::Printed, index, index),
            vec![
                vec![Some(weighted.clone())],
                vec![None, Some(weighted)],
                vec![None, None, Some(level.times_identity(s))],
                vec![None, None, None, Some(level.times_identity(s))],
                vec![
                    Some(next),
                    Some(integral.expression()),
                    disturbance(),
                    None,
                    Some(q.expression()),
                ],
                vec![
                    None,
                    Some(q.expression()),
                    None,
                    disturbance(),
                    None,
                    Some(q.expression()),
                ],
            ],
        ));
    }
    problem.require_trace(&[q.expression()], n as f64);
    Ok(PrintedVerdict::new(
        "(36)",
        "eta >= -Q^-1 for every X, so the Schur complement of blocks 2 and 6 is at least H'H and cannot be \
         negative: the printed model (24) leaves the integrator's eigenvalue at 1",
        problem.margin_by_general_solver()?,
    ))
}
