//! Theorems T1 and T2 for the interior-point method that uses their structure.
//!
//! With `h = 1/g` the rows of `g` in (T2) go out by a Schur complement and `h` enters linearly; the
//! order of the rows is (next state, performance signal, state):
//!
//! ```text
//! attenuation  [ S_j - h E E'   0    A G + B R  ]        decay  [ S_j   (A G + B R) / alpha ]
//!              [      .         I    H G + D R  ]               [  .      G + G' - S_i      ]
//!              [      .         .  G + G' - S_i ]
//! ```
//!
//! Where `G = S` (all but `switched`), `A S` and its transpose are a difference of congruences of `S`.

use super::transformation::Part;
use crate::augmented::AugmentedMode;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::FactoredLyapunov;
use crate::interior_point::{
    Block, Bound, Congruence, Point, Problem, Product, Settings, Solution, maximise,
};
use crate::lmi::Margin;
use crate::pseudo_inverse::pseudo_inverse;
use crate::solver::{Run, Step};
use crate::verdict::SolverFailure;
use crate::{ControlSpec, Lyapunov};
use nalgebra::DMatrix;

/// How far, as a factor, Lyapunov matrices may be from the identity on average.
const REACH: f64 = 1e6;

/// Share of that at which the limit counts as active.
const AT_REACH: f64 = 1e-2;

/// What becomes of the scalar unknown.
#[derive(Clone, Copy)]
enum Scalar {
    /// `h` of every attenuation block.
    Level,
    /// `t`, taken off every block.
    Margin,
}

/// A group's inequalities under construction.
struct Theorem<'a> {
    models: &'a [AugmentedMode],
    spec: &'a ControlSpec,
    group: &'a [usize],
    scalar: Scalar,
    run: &'a Run<'a>,
    problem: Problem,
    names: Vec<BlockName>,
}

/// `blocks` stacked, zero where there is none, of `columns` columns.
fn stacked(rows: &[(usize, Option<&DMatrix<f64>>)], columns: usize) -> DMatrix<f64> {
    let size = rows.iter().map(|(rows, _)| rows).sum();
    let mut matrix = DMatrix::zeros(size, columns);
    let mut first = 0;
    for (rows, block) in rows {
        if let Some(block) = block {
            matrix
                .view_mut((first, 0), (*rows, columns))
                .copy_from(block);
        }
        first += rows;
    }
    matrix
}

/// Two matrices side by side.
fn beside(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut matrix = left
        .clone()
        .resize_horizontally(left.ncols() + right.ncols(), 0.0);
    matrix
        .columns_mut(left.ncols(), right.ncols())
        .copy_from(right);
    matrix
}

impl<'a> Theorem<'a> {
    fn new(
        models: &'a [AugmentedMode],
        spec: &'a ControlSpec,
        group: &'a [usize],
        scalar: Scalar,
        run: &'a Run<'a>,
    ) -> Self {
        let (order, inputs) = models[0].b.shape();
        let rows = match spec.lyapunov {
            Lyapunov::Switched => order + inputs,
            Lyapunov::Common | Lyapunov::Dwell => inputs,
        };
        Self {
            models,
            spec,
            group,
            scalar,
            run,
            problem: Problem {
                order,
                symmetric: spec.lyapunov.matrices(group.len()),
                full: vec![(rows, order); group.len()],
                blocks: Vec::new(),
                bounds: Vec::new(),
                total: None,
            },
            names: Vec::new(),
        }
    }

    /// `[S_j, (A G + B R)/scale ; . , G + G' - S_i]` with `signals` rows of `H G + D R` between.
    fn pair(&mut self, kind: BlockKind, (i, j): (usize, usize), attenuation: bool) -> Block {
        let model = &self.models[self.group[i]];
        let (order, inputs) = model.b.shape();
        let signals = if attenuation { model.h.nrows() } else { 0 };
        let scale = if attenuation { 1.0 } else { self.spec.decay };
        let identity = DMatrix::identity(order, order);
        let stack = |next: Option<&DMatrix<f64>>, signal: Option<&DMatrix<f64>>, own, columns| {
            stacked(
                &[
                    (order, next),
                    (signals, signal.filter(|_| attenuation)),
                    (order, own),
                ],
                columns,
            )
        };
        let next = stack(Some(&identity), None, None, order);
        let own = stack(None, None, Some(&identity), order);
        let (a, b) = (&model.a / scale, &model.b / scale);
        self.names
            .push(BlockName::new(kind, self.group[i], self.group[j]));
        let congruence = |unknown, sign, map| Congruence { unknown, sign, map };
        let (congruences, left) = match self.spec.lyapunov {
            Lyapunov::Switched => {
                let zero = DMatrix::zeros(order, inputs);
                let left = stack(
                    Some(&beside(&a, &b)),
                    Some(&beside(&model.h, &model.d)),
                    Some(&beside(&identity, &zero)),
                    order + inputs,
                );
                (
                    vec![congruence(j, 1.0, next), congruence(i, -1.0, own.clone())],
                    left,
                )
            }
            Lyapunov::Common | Lyapunov::Dwell => {
                let effect = stack(Some(&a), Some(&model.h), None, order);
                let left = stack(Some(&b), Some(&model.d), None, inputs);
                let sum = &own + &effect;
                let terms = vec![
                    congruence(0, 1.0, next),
                    congruence(0, 1.0, sum),
                    congruence(0, -1.0, effect),
                ];
                (terms, left)
            }
        };
        let size = 2 * order + signals;
        Block {
            constant: DMatrix::zeros(size, size),
            congruences,
            product: Some(Product {
                unknown: i,
                left,
                right: own,
            }),
            scalar: match self.scalar {
                Scalar::Margin => Some(-DMatrix::identity(size, size)),
                Scalar::Level => None,
            },
        }
    }

    /// The decay inequalities.
    fn require_decay(&mut self) {
        for pair in self.spec.lyapunov.pairs(self.group.len()) {
            let block = self.pair(BlockKind::Decay, pair, false);
            self.problem.blocks.push(block);
        }
    }

    /// The attenuation inequalities; `level` is `h` where it is not the unknown.
    fn require_attenuation(&mut self, level: f64) {
        for pair in self.spec.lyapunov.pairs(self.group.len()) {
            let mut block = self.pair(BlockKind::Attenuation, pair, true);
            let model = &self.models[self.group[pair.0]];
            let (order, signals) = (model.a.nrows(), model.h.nrows());
            for k in order..order + signals {
                block.constant[(k, k)] = 1.0;
            }
            let entering = -(&model.e * model.e.transpose());
            match self.scalar {
                Scalar::Level => {
                    let size = block.size();
                    let mut coefficient = DMatrix::zeros(size, size);
                    coefficient
                        .view_mut((0, 0), (order, order))
                        .copy_from(&entering);
                    block.scalar = Some(coefficient);
                }
                Scalar::Margin => {
                    let mut part = block.constant.view_mut((0, 0), (order, order));
                    part += level * entering;
                }
            }
            self.problem.blocks.push(block);
        }
    }

    /// The traces of the Lyapunov matrices add up to at most `reach` times their sizes.
    fn require_reach(&mut self, reach: f64) {
        let matrices = self.problem.symmetric;
        self.problem.bounds.push(Bound {
            constant: reach * (matrices * self.problem.order) as f64,
            traces: vec![-1.0; matrices],
            scalar: 0.0,
        });
    }

    /// The scalar unknown is at most this.
    fn require_at_most(&mut self, value: f64) {
        self.problem.bounds.push(Bound {
            constant: value,
            traces: vec![0.0; self.problem.symmetric],
            scalar: -1.0,
        });
    }

    /// Gains and Lyapunov matrices: `K~ = R G^-1`.
    fn read(&self, point: &Point) -> Result<Vec<Part>, SolverFailure> {
        let order = self.problem.order;
        let modes = self.group.iter().zip(&point.full).enumerate();
        modes
            .map(|(index, (&mode, full))| {
                let lyapunov = &point.symmetric[self.spec.lyapunov.index(index)];
                let (slack, feedback) = match self.spec.lyapunov {
                    Lyapunov::Switched => (
                        full.rows(0, order).into_owned(),
                        full.rows(order, full.nrows() - order).into_owned(),
                    ),
                    Lyapunov::Common | Lyapunov::Dwell => (lyapunov.clone(), full.clone()),
                };
                let gain = slack.transpose().lu().solve(&feedback.transpose());
                Ok(Part {
                    mode,
                    gain: gain.ok_or(SolverFailure::NumericalTrouble)?.transpose(),
                    lyapunov: FactoredLyapunov::plain(lyapunov.clone()),
                })
            })
            .collect()
    }

    fn solve(&self, what: &'static str, settings: Settings) -> Result<Solution, SolverFailure> {
        const USUAL: usize = 25;
        let (unknowns, mode) = (self.problem.reduced(), self.group[0] + 1);
        let step = |number| Step::Iteration {
            number,
            usual: USUAL.max(number + 1),
            unknowns,
            what,
            mode,
        };
        let found = maximise(&self.problem, settings, &mut |number| {
            (self.run.watch)(step(number))
        });
        found.ok_or(SolverFailure::NumericalTrouble)
    }
}

/// The stabilising gains of largest margin (T1).
pub(super) fn stabilise(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    run: &Run,
) -> Result<(Margin, Vec<Part>), SolverFailure> {
    let mut theorem = Theorem::new(models, spec, group, Scalar::Margin, run);
    theorem.require_decay();
    theorem.problem.total = Some((theorem.problem.symmetric * theorem.problem.order) as f64);
    let solution = theorem.solve(
        "largest margin",
        Settings {
            gap: 1e-3,
            absolute_gap: 1e-10,
            enough: f64::INFINITY,
            iterations: 60,
        },
    )?;
    if !solution.converged {
        return Err(SolverFailure::NumericalTrouble);
    }
    let total: f64 = solution.multipliers.iter().sum();
    let shares = solution.multipliers.iter().map(|weight| weight / total);
    let mut parts = theorem.read(&solution.point)?;
    for part in &mut parts {
        // Nothing in (T1) holds down what the inputs do to no state: take it out.
        let input = &models[part.mode].b;
        part.gain = pseudo_inverse(input, 1e-12) * (input * &part.gain);
    }
    let margin = Margin {
        margin: solution.value,
        scalars: Vec::new(),
        weights: theorem.names.iter().cloned().zip(shares).collect(),
    };
    Ok((margin, parts))
}

/// The way to the least level.
pub(super) struct Path {
    /// The least `g` that was reached.
    pub level: f64,
    /// Below this no `g` is reached, in the method's view; zero where it cannot tell.
    pub bound: f64,
    /// Whether larger Lyapunov matrices might reach less.
    pub at_reach: bool,
    /// Gains and Lyapunov matrices there.
    pub parts: Vec<Part>,
    /// Levels that were passed, the largest first, with what satisfies their inequalities strictly.
    pub centred: Vec<(f64, Vec<Part>)>,
}

/// The least `g >= floor` of a group (T2), as the method sees it, with the gains that come with it.
pub(super) fn least_level(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    floor: f64,
    run: &Run,
) -> Result<Path, SolverFailure> {
    let mut theorem = Theorem::new(models, spec, group, Scalar::Level, run);
    theorem.require_attenuation(0.0);
    theorem.require_decay();
    theorem.require_reach(REACH);
    theorem.require_at_most(1.0 / floor);
    let solution = theorem.solve(
        "least gamma",
        Settings {
            gap: 1e-6,
            absolute_gap: 0.0,
            enough: f64::INFINITY,
            iterations: 80,
        },
    )?;
    if !(solution.feasible && solution.value > 0.0) {
        return Err(SolverFailure::NumericalTrouble);
    }
    let earlier = solution.earlier.iter().map(|centred| {
        let level = 1.0 / centred.value;
        theorem.read(&centred.point).map(|parts| (level, parts))
    });
    let positive = solution.earlier.iter().all(|centred| centred.value > 0.0);
    let traces: f64 = solution.point.symmetric.iter().map(DMatrix::trace).sum();
    let reach = REACH * (theorem.problem.symmetric * theorem.problem.order) as f64;
    Ok(Path {
        at_reach: traces > AT_REACH * reach,
        level: 1.0 / solution.value,
        bound: 1.0 / solution.bound.max(solution.value),
        centred: if positive {
            earlier.collect::<Result<_, _>>()?
        } else {
            Vec::new()
        },
        parts: theorem.read(&solution.point)?,
    })
}

/// The gains of largest margin at a given `g` (T2), in coordinates where Lyapunov matrices near the
/// identity will do.
pub(super) fn centred(
    models: &[AugmentedMode],
    spec: &ControlSpec,
    group: &[usize],
    level: f64,
    run: &Run,
) -> Result<Vec<Part>, SolverFailure> {
    let mut theorem = Theorem::new(models, spec, group, Scalar::Margin, run);
    theorem.require_attenuation(1.0 / level);
    theorem.require_decay();
    theorem.require_reach(super::theorem::CENTRED_TRACE);
    let solution = theorem.solve(
        "centred gains",
        Settings {
            gap: 1e-2,
            absolute_gap: 0.0,
            enough: f64::INFINITY,
            iterations: 60,
        },
    )?;
    match solution.feasible && solution.value > 0.0 {
        true => theorem.read(&solution.point),
        false => Err(SolverFailure::NumericalTrouble),
    }
}
