//! A primal-dual interior-point method for the inequalities of (T1) and (T2) that uses their structure.
//!
//! Every block is a signed sum of congruences of the Lyapunov matrices, plus a product `U Y V'` with
//! its transpose, plus a scalar times a matrix. Nesterov-Todd scaling, Mehrotra's predictor and
//! corrector, started infeasible at the identity. What comes back is a candidate, whatever its gap:
//! the certificate decides.

mod dense;
mod newton;
mod problem;
mod scaling_point;

pub(crate) use problem::{Block, Bound, Congruence, Point, Problem, Product};

use nalgebra::DMatrix;
use newton::Newton;
use problem::Gradient;
use scaling_point::ScalingPoint;

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Relative distance between the value and its dual bound.
    pub gap: f64,
    /// The same in absolute terms.
    pub absolute_gap: f64,
    /// A feasible value above this is enough.
    pub enough: f64,
    /// The most iterations.
    pub iterations: usize,
}

/// What the method came to.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    /// The unknowns.
    pub point: Point,
    /// The scalar unknown.
    pub value: f64,
    /// No value is above this, in the method's view.
    pub bound: f64,
    /// Trace of the multiplier of each block.
    pub multipliers: Vec<f64>,
    /// Points on the way, near the central path, the widest gap first.
    pub earlier: Vec<Centred>,
    /// Whether the gap was closed (or enough was reached).
    pub converged: bool,
    /// Whether nothing more is to be had.
    exhausted: bool,
    /// Whether the point satisfies every inequality strictly.
    pub feasible: bool,
    /// Iterations taken.
    pub iterations: usize,
}

/// A point that satisfies every inequality strictly, some way off the optimum.
#[derive(Clone, Debug)]
pub(crate) struct Centred {
    /// The unknowns.
    pub point: Point,
    /// The scalar unknown.
    pub value: f64,
}

/// Slacks and multipliers of blocks and bounds.
struct Iterate {
    point: Point,
    slacks: Vec<DMatrix<f64>>,
    multipliers: Vec<DMatrix<f64>>,
    bound_slacks: Vec<f64>,
    bound_multipliers: Vec<f64>,
    equation: f64,
}

/// What is left of each condition.
struct Residuals {
    blocks: Vec<DMatrix<f64>>,
    bounds: Vec<f64>,
    trace: f64,
    dual: Gradient,
    primal_size: f64,
    dual_size: f64,
    /// Rows of all blocks and bounds.
    rows: usize,
    /// Mean product of slack and multiplier.
    complementarity: f64,
    bound: f64,
}

impl Residuals {
    /// The distance between value and bound, were the multipliers feasible.
    fn gap(&self) -> f64 {
        self.complementarity * self.rows as f64
    }
}

/// A Newton direction, slacks and multipliers scaled.
struct Direction {
    point: Point,
    slacks: Vec<DMatrix<f64>>,
    scaled_slacks: Vec<DMatrix<f64>>,
    scaled_multipliers: Vec<DMatrix<f64>>,
    bound_slacks: Vec<f64>,
    bound_multipliers: Vec<f64>,
    equation: f64,
}

/// Slack and multiplier of every block at the start.
const START: f64 = 10.0;

/// Largest residual of the inequalities that counts as none.
const PRIMAL: f64 = 1e-8;

/// Largest residual of the multipliers that counts as none.
const DUAL: f64 = 1e-7;

/// A gap of slacks and multipliers this far below what is asked for brings nothing any more.
const EXHAUSTED: f64 = 0.1;

/// Relative gap of the first point on the central path that is kept.
const FIRST_GAP: f64 = 1e-2;

/// Least ratio of the gaps of two points that are kept.
const GAP_BETWEEN: f64 = 5.0;

/// Maximises the scalar unknown from `symmetric = I`, `full = 0`, `scalar = 0`; `watch` is called at
/// every iteration. `None` where not a single step could be made.
pub(crate) fn maximise(
    problem: &Problem,
    settings: Settings,
    watch: &mut dyn FnMut(usize),
) -> Option<Solution> {
    let mut iterate = Iterate::start(problem);
    let mut best = None;
    let mut earlier = Vec::new();
    let mut next = FIRST_GAP;
    let mut bound = f64::INFINITY;
    for iteration in 0..settings.iterations {
        watch(iteration);
        let residuals = iterate.residuals(problem);
        let solution = iterate.solution(&residuals, &settings, iteration);
        let gap = residuals.gap() / solution.value.abs();
        if solution.feasible && gap < next {
            let (point, value) = (solution.point.clone(), solution.value);
            earlier.push(Centred { point, value });
            next = gap / GAP_BETWEEN;
        }
        let stop = solution.converged || solution.exhausted;
        bound = bound.min(solution.bound);
        if solution.feasible || best.is_none() {
            best = Some(solution);
        }
        if stop || !residuals.complementarity.is_finite() {
            break;
        }
        if iterate.step(problem, &residuals).is_none() {
            break;
        }
    }
    let best = best.filter(|solution: &Solution| solution.iterations > 0)?;
    Some(Solution {
        earlier,
        bound,
        ..best
    })
}

impl Iterate {
    fn start(problem: &Problem) -> Self {
        let (order, sizes) = (problem.order, problem.blocks.iter().map(Block::size));
        let scaled: Vec<_> = sizes
            .map(|n| DMatrix::from_diagonal_element(n, n, START))
            .collect();
        let full = problem.full.iter().map(|&(r, c)| DMatrix::zeros(r, c));
        let point = Point {
            symmetric: vec![DMatrix::identity(order, order); problem.symmetric],
            full: full.collect(),
            scalar: 0.0,
        };
        // A bound far away starts where it is.
        let bounds = problem.bounds.iter();
        let bounds: Vec<f64> = bounds
            .map(|bound| (bound.constant + bound.linear(&point)).max(START))
            .collect();
        Self {
            point,
            slacks: scaled.clone(),
            multipliers: scaled,
            bound_multipliers: bounds.iter().map(|slack| START * START / slack).collect(),
            bound_slacks: bounds,
            equation: 0.0,
        }
    }

    fn residuals(&self, problem: &Problem) -> Residuals {
        let blocks: Vec<_> = problem
            .blocks
            .iter()
            .zip(&self.slacks)
            .map(|(block, slack)| block.linear(&self.point) + &block.constant - slack)
            .collect();
        let bounds: Vec<_> = problem
            .bounds
            .iter()
            .zip(&self.bound_slacks)
            .map(|(bound, slack)| bound.linear(&self.point) + bound.constant - slack)
            .collect();
        let traces: f64 = self.point.symmetric.iter().map(DMatrix::trace).sum();
        let trace = problem.total.map_or(0.0, |total| total - traces);
        let mut dual = problem.adjoint(&self.multipliers, &self.bound_multipliers);
        let last = dual.reduced.len() - 1;
        dual.reduced[last] += 1.0;
        let mut bound = self.equation * problem.total.unwrap_or(0.0);
        if problem.total.is_some() {
            dual.reduced.axpy(-self.equation, &problem.trace(), 1.0);
        }
        let pairs = self
            .slacks
            .iter()
            .zip(&self.multipliers)
            .map(|(s, x)| s.dot(x));
        let bound_pairs = self
            .bound_slacks
            .iter()
            .zip(&self.bound_multipliers)
            .map(|(s, x)| s * x);
        let products: f64 = pairs.chain(bound_pairs).sum();
        let constants = problem
            .blocks
            .iter()
            .zip(&self.multipliers)
            .map(|(b, x)| b.constant.dot(x));
        let bound_constants = problem
            .bounds
            .iter()
            .zip(&self.bound_multipliers)
            .map(|(b, x)| b.constant * x);
        bound += constants.chain(bound_constants).sum::<f64>();
        let primal_size = blocks
            .iter()
            .map(DMatrix::amax)
            .chain(bounds.iter().map(|b| b.abs()))
            .fold(trace.abs(), f64::max);
        Residuals {
            primal_size,
            rows: problem.rows(),
            dual_size: dual.amax(),
            complementarity: products / problem.rows() as f64,
            blocks,
            bounds,
            trace,
            dual,
            bound,
        }
    }

    fn solution(&self, residuals: &Residuals, settings: &Settings, iterations: usize) -> Solution {
        let value = self.point.scalar;
        let feasible = residuals.primal_size < PRIMAL;
        let bounded = residuals.dual_size < DUAL;
        let allowed = settings.absolute_gap.max(settings.gap * value.abs());
        let gap = residuals.gap();
        let bound = residuals.bound.max(value + gap);
        Solution {
            point: self.point.clone(),
            value,
            bound: if bounded { bound } else { f64::INFINITY },
            earlier: Vec::new(),
            exhausted: feasible && gap < EXHAUSTED * allowed,
            multipliers: self.multipliers.iter().map(DMatrix::trace).collect(),
            converged: feasible && (bounded && gap < allowed || value > settings.enough),
            feasible,
            iterations,
        }
    }

    /// One step of predictor and corrector; `None` where numbers break down.
    fn step(&mut self, problem: &Problem, residuals: &Residuals) -> Option<()> {
        let pairs = self.slacks.iter().zip(&self.multipliers);
        let scalings = pairs
            .map(|(s, x)| ScalingPoint::new(s, x))
            .collect::<Option<Vec<_>>>()?;
        let weights: Vec<_> = scalings.iter().map(|scaling| &scaling.weight).collect();
        let ratios: Vec<_> = self
            .bound_multipliers
            .iter()
            .zip(&self.bound_slacks)
            .map(|(x, s)| x / s)
            .collect();
        let newton = Newton::new(problem, &weights, &ratios)?;
        let stage = Stage {
            problem,
            residuals,
            scalings: &scalings,
            newton: &newton,
            iterate: self,
        };

        let targets: Vec<_> = scalings.iter().map(ScalingPoint::predicted).collect();
        let bound_targets: Vec<_> = self.bound_multipliers.iter().map(|x| -x).collect();
        let predictor = stage.direction(&targets, &bound_targets)?;
        let (primal, dual) = stage.longest_steps(&predictor);
        let reached = stage.complementarity(&predictor, primal, dual);
        let centring = (reached / residuals.complementarity)
            .powi(3)
            .clamp(1e-4, 1.0);
        let centre = centring * residuals.complementarity;

        let targets: Vec<_> = scalings
            .iter()
            .enumerate()
            .map(|(at, scaling)| {
                scaling.corrected(
                    centre,
                    &predictor.scaled_slacks[at],
                    &predictor.scaled_multipliers[at],
                )
            })
            .collect();
        let bound_targets: Vec<_> = (0..self.bound_slacks.len())
            .map(|at| {
                let second = predictor.bound_slacks[at] * predictor.bound_multipliers[at];
                (centre - second) / self.bound_slacks[at] - self.bound_multipliers[at]
            })
            .collect();
        let corrector = stage.direction(&targets, &bound_targets)?;
        let (primal, dual) = stage.longest_steps(&corrector);
        let share = if primal.min(dual) > 0.5 { 0.98 } else { 0.9 };
        let shorten = |step: f64| (share * step).min(1.0);
        let multipliers: Vec<_> = scalings
            .iter()
            .zip(&corrector.scaled_multipliers)
            .map(|(s, m)| s.multiplier(m))
            .collect();
        self.advance(&corrector, &multipliers, shorten(primal), shorten(dual));
        Some(())
    }

    fn advance(
        &mut self,
        direction: &Direction,
        multipliers: &[DMatrix<f64>],
        primal: f64,
        dual: f64,
    ) {
        self.point.advance(primal, &direction.point);
        for (slack, change) in self.slacks.iter_mut().zip(&direction.slacks) {
            *slack += primal * change;
        }
        for (slack, change) in self.bound_slacks.iter_mut().zip(&direction.bound_slacks) {
            *slack += primal * change;
        }
        for (multiplier, change) in self.multipliers.iter_mut().zip(multipliers) {
            *multiplier += dual * change;
        }
        for (multiplier, change) in self
            .bound_multipliers
            .iter_mut()
            .zip(&direction.bound_multipliers)
        {
            *multiplier += dual * change;
        }
        self.equation += dual * direction.equation;
    }
}

/// One iteration's data.
struct Stage<'a> {
    problem: &'a Problem,
    residuals: &'a Residuals,
    scalings: &'a [ScalingPoint],
    newton: &'a Newton,
    iterate: &'a Iterate,
}

impl Stage<'_> {
    /// The direction for scaled right-hand sides of complementarity.
    fn direction(&self, targets: &[DMatrix<f64>], bound_targets: &[f64]) -> Option<Direction> {
        let residuals = self.residuals;
        let ratios: Vec<f64> = self
            .iterate
            .bound_multipliers
            .iter()
            .zip(&self.iterate.bound_slacks)
            .map(|(x, s)| x / s)
            .collect();
        let pulled: Vec<_> = self
            .scalings
            .iter()
            .zip(targets)
            .zip(&residuals.blocks)
            .map(|((scaling, target), residual)| {
                scaling.multiplier(&(target - scaling.scaled_slack(residual)))
            })
            .collect();
        let bounds_pulled: Vec<_> = bound_targets
            .iter()
            .zip(&ratios)
            .zip(&residuals.bounds)
            .map(|((target, ratio), residual)| target - ratio * residual)
            .collect();
        let mut right = self.problem.adjoint(&pulled, &bounds_pulled);
        right.reduced += &residuals.dual.reduced;
        for (part, dual) in right.full.iter_mut().zip(&residuals.dual.full) {
            *part += dual;
        }
        let (point, equation) = self.newton.solve(self.problem, &right, residuals.trace);
        let slacks: Vec<_> = self
            .problem
            .blocks
            .iter()
            .zip(&residuals.blocks)
            .map(|(block, residual)| block.linear(&point) + residual)
            .collect();
        let bound_slacks: Vec<_> = self
            .problem
            .bounds
            .iter()
            .zip(&residuals.bounds)
            .map(|(bound, residual)| bound.linear(&point) + residual)
            .collect();
        let scaled_slacks: Vec<_> = self
            .scalings
            .iter()
            .zip(&slacks)
            .map(|(s, d)| s.scaled_slack(d))
            .collect();
        let finite = scaled_slacks
            .iter()
            .all(|slack| slack.iter().all(|value| value.is_finite()));
        finite.then(|| Direction {
            scaled_multipliers: targets
                .iter()
                .zip(&scaled_slacks)
                .map(|(t, s)| t - s)
                .collect(),
            bound_multipliers: bound_targets
                .iter()
                .zip(&ratios)
                .zip(&bound_slacks)
                .map(|((t, r), s)| t - r * s)
                .collect(),
            point,
            slacks,
            scaled_slacks,
            bound_slacks,
            equation,
        })
    }

    /// The longest steps of slacks and multipliers, at most 1.
    fn longest_steps(&self, direction: &Direction) -> (f64, f64) {
        let longest = |directions: &[DMatrix<f64>], values: &[f64], changes: &[f64]| {
            let blocks = self
                .scalings
                .iter()
                .zip(directions)
                .map(|(s, d)| s.longest_step(d));
            let bounds = values
                .iter()
                .zip(changes)
                .map(|(v, d)| if *d < 0.0 { -v / d } else { 1.0 });
            blocks.chain(bounds).fold(1.0, f64::min)
        };
        let iterate = self.iterate;
        (
            longest(
                &direction.scaled_slacks,
                &iterate.bound_slacks,
                &direction.bound_slacks,
            ),
            longest(
                &direction.scaled_multipliers,
                &iterate.bound_multipliers,
                &direction.bound_multipliers,
            ),
        )
    }

    /// Mean product of slack and multiplier after these steps.
    fn complementarity(&self, direction: &Direction, primal: f64, dual: f64) -> f64 {
        let blocks = self
            .scalings
            .iter()
            .zip(&direction.scaled_slacks)
            .zip(&direction.scaled_multipliers);
        let mut sum = 0.0;
        for ((scaling, slack), multiplier) in blocks {
            // (lambda + a ds) . (lambda + b dx), scaled.
            sum += scaling.lambda.norm_squared() + primal * dual * slack.dot(multiplier);
            for (k, lambda) in scaling.lambda.iter().enumerate() {
                sum += lambda * (primal * slack[(k, k)] + dual * multiplier[(k, k)]);
            }
        }
        let iterate = self.iterate;
        for at in 0..iterate.bound_slacks.len() {
            let slack = iterate.bound_slacks[at] + primal * direction.bound_slacks[at];
            sum += slack * (iterate.bound_multipliers[at] + dual * direction.bound_multipliers[at]);
        }
        sum / self.problem.rows() as f64
    }
}
