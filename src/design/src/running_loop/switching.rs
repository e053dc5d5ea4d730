//! A gain under arbitrary switching: one Lyapunov function of the whole loop, its gains fixed.

use super::gain::Channel;
use super::model::Loop;
use super::subject::{Claim, Scaled, Subject};
use super::switching_proof::{SwitchingGain, prove_switching};
use crate::Lyapunov;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::FactoredLyapunov;
use crate::interior_point::{Block, Congruence, Problem as Structured, Settings, maximise};
use crate::lmi::{Inequality, Problem, Variable};
use crate::riccati;
use nalgebra::DMatrix;

/// The most unknowns for which the inequality is solved; beyond it only the gain of each mode is
/// claimed.
const MOST_UNKNOWNS: usize = 400;

/// What the storage function must decrease by beyond the signal, in coordinates in which it is near one.
const STRICTNESS: f64 = 1e-6;

/// When the method that uses the structure has the level.
const SETTINGS: Settings = Settings {
    gap: 1e-5,
    absolute_gap: 1e-9,
    enough: f64::INFINITY,
    iterations: 60,
};

/// By how much the level may lie above the solver's, tried in turn.
const ALLOWANCES: [f64; 4] = [1e-4, 1e-3, 1e-2, 3e-2];

/// The gain under arbitrary switching; none where switching is not arbitrary, where no one function
/// gives it, or where it exceeds that of a measured state by more than `tolerance`.
pub(super) fn gain(subject: &Subject, tolerance: f64) -> Option<SwitchingGain> {
    let arbitrary = subject.control.spec.lyapunov != Lyapunov::Dwell
        && subject.observer.spec.lyapunov != Lyapunov::Dwell;
    if subject.modes() < 2 || !arbitrary {
        return None;
    }
    let loops = subject.models.switching(&subject.observer.observer)?;
    let measured = subject.control.gamma.as_ref()?;
    let largest = measured.iter().copied().fold(0.0, f64::max) * (1.0 + tolerance);
    let kinds: &[bool] = match subject.control.spec.lyapunov {
        Lyapunov::Switched => &[false, true],
        Lyapunov::Common | Lyapunov::Dwell => &[false],
    };
    kinds
        .iter()
        .find_map(|&each| attempt(subject, &loops, each).filter(|found| found.gamma <= largest))
}

/// With one matrix for each mode, or one for all.
fn attempt(subject: &Subject, loops: &[(usize, usize, Loop)], each: bool) -> Option<SwitchingGain> {
    let claim = Claim::Disturbance;
    let scaled: Vec<(usize, usize, Scaled)> = loops
        .iter()
        .map(|(i, j, model)| (*i, *j, subject.scaled(model, &claim)))
        .collect();
    let size = loops.first()?.2.a.shape().0;
    let count = if each { subject.modes() } else { 1 };
    if count * size * (size + 1) / 2 > MOST_UNKNOWNS {
        return None;
    }
    let own = scaled.iter().filter(|(i, j, _)| i == j);
    let normal = Normalisation::of(own.map(|(.., scaled)| scaled.channel()))?;
    let (level, functions) = least(subject.modes(), &scaled, &normal, each)?;
    let unit = scaled.first()?.2.unit;
    let lyapunov: Vec<FactoredLyapunov> = functions
        .iter()
        .map(|function| normal.restore(function))
        .collect::<Option<_>>()?;
    ALLOWANCES.iter().find_map(|allowance| {
        let candidate = SwitchingGain {
            gamma: level * (1.0 + allowance) * unit,
            lyapunov: lyapunov.clone(),
        };
        prove_switching(subject, &candidate)
            .is_ok()
            .then_some(candidate)
    })
}

/// Coordinates in which the mean storage function of the modes is the identity, and a unit of the
/// disturbance in which the gain is near one.
struct Normalisation {
    /// `T`: `x = T xi`.
    basis: DMatrix<f64>,
    inverse: DMatrix<f64>,
    level: f64,
}

impl Normalisation {
    fn of<'a>(channels: impl Iterator<Item = Channel<'a>>) -> Option<Self> {
        let channels: Vec<Channel> = channels.collect();
        let norms = channels.iter().map(Channel::norm);
        let level = norms.fold(0.0, f64::max).max(1e-9) * 1.05;
        let mut mean: Option<DMatrix<f64>> = None;
        for channel in &channels {
            let inverse = channel.storage(level, 1e-3)?.try_inverse()?;
            let function = inverse.tr_mul(&inverse) / channels.len() as f64;
            mean = Some(mean.map_or(function.clone(), |sum| sum + function));
        }
        let inverse = riccati::symmetric(mean?).cholesky()?.unpack().transpose();
        Some(Self {
            basis: inverse.clone().try_inverse()?,
            inverse,
            level,
        })
    }

    /// `S` of a function found in these coordinates.
    fn restore(&self, function: &DMatrix<f64>) -> Option<FactoredLyapunov> {
        let root = function.clone().cholesky()?.unpack();
        let size = root.nrows();
        Some(FactoredLyapunov {
            basis: &self.basis * root.transpose().try_inverse()?,
            core: DMatrix::identity(size, size),
        })
    }
}

/// The least level and the functions that reach it, in the coordinates of the normal.
fn least(
    modes: usize,
    loops: &[(usize, usize, Scaled)],
    normal: &Normalisation,
    each: bool,
) -> Option<(f64, Vec<DMatrix<f64>>)> {
    let demands = demands(modes, loops, normal, each);
    let count = if each { modes } else { 1 };
    let found = by_structure(count, &demands).or_else(|| by_general_solver(count, &demands));
    found.map(|(level, functions)| (level.max(0.0).sqrt() * normal.level, functions))
}

/// `P_own - [A B]'P_next[A B] - [C D]'[C D] - strictness` with the level on the disturbance's diagonal.
struct Demand {
    own: usize,
    next: usize,
    name: BlockName,
    /// `[A B]`.
    step: DMatrix<f64>,
    /// `[C D]'[C D]` and the strictness.
    signal: DMatrix<f64>,
}

/// What every pair of modes demands.
fn demands(
    modes: usize,
    loops: &[(usize, usize, Scaled)],
    normal: &Normalisation,
    each: bool,
) -> Vec<Demand> {
    let size = normal.basis.nrows();
    let beside = |left: &DMatrix<f64>, right: &DMatrix<f64>| {
        DMatrix::from_fn(
            left.nrows(),
            left.ncols() + right.ncols(),
            |row, column| match column.checked_sub(left.ncols()) {
                None => left[(row, column)],
                Some(column) => right[(row, column)],
            },
        )
    };
    let mut demands = Vec::new();
    for (i, j, scaled) in loops {
        let channel = scaled.channel();
        let a = &normal.inverse * channel.a.midpoint() * &normal.basis;
        let b = &normal.inverse * channel.b.midpoint() / normal.level;
        let both = beside(
            &(channel.c.midpoint() * &normal.basis),
            &(channel.d.midpoint() / normal.level),
        );
        let mut signal = both.tr_mul(&both);
        for k in 0..size {
            signal[(k, k)] += STRICTNESS;
        }
        let step = beside(&a, &b);
        let followers: Vec<usize> = match each && i == j {
            true => (0..modes).collect(),
            false => vec![*j],
        };
        let index = |mode: usize| if each { mode } else { 0 };
        demands.extend(followers.into_iter().map(|next| Demand {
            own: index(*i),
            next: index(next),
            name: BlockName::new(BlockKind::RunningLoop, *i, next),
            step: step.clone(),
            signal: signal.clone(),
        }));
    }
    demands
}

/// By the method that uses the structure: the level is minus the scalar unknown.
fn by_structure(count: usize, demands: &[Demand]) -> Option<(f64, Vec<DMatrix<f64>>)> {
    let size = demands.first()?.step.nrows();
    let block = |demand: &Demand| {
        let rows = demand.step.ncols();
        let congruence = |unknown, sign, map| Congruence { unknown, sign, map };
        let disturbance = |row: usize, column: usize| match row == column && row >= size {
            true => -1.0,
            false => 0.0,
        };
        Block {
            constant: -&demand.signal,
            congruences: vec![
                congruence(demand.own, 1.0, DMatrix::identity(rows, size)),
                congruence(demand.next, -1.0, demand.step.transpose()),
            ],
            product: None,
            scalar: Some(DMatrix::from_fn(rows, rows, disturbance)),
        }
    };
    let problem = Structured {
        order: size,
        symmetric: count,
        full: Vec::new(),
        blocks: demands.iter().map(block).collect(),
        bounds: Vec::new(),
        total: None,
    };
    let found = maximise(&problem, SETTINGS, &mut |_| ())?;
    let solved = found.converged && found.feasible;
    solved.then(|| (-found.value, found.point.symmetric))
}

/// By the general solver.
fn by_general_solver(count: usize, demands: &[Demand]) -> Option<(f64, Vec<DMatrix<f64>>)> {
    let size = demands.first()?.step.nrows();
    let mut problem = Problem::new();
    let functions: Vec<Variable> = (0..count).map(|_| problem.symmetric(size)).collect();
    let level = problem.scalar();
    for demand in demands {
        let [own, next] = [demand.own, demand.next].map(|index| functions[index].expression());
        let rows = demand.step.ncols();
        let before = DMatrix::identity(rows, size);
        let last = |row: usize, column: usize| f64::from(u8::from(row == size + column));
        let disturbance = DMatrix::from_fn(rows, rows - size, last);
        let levels = level.times_identity(rows - size);
        let whole = &before * own * &before.transpose()
            - &demand.step.transpose() * next * &demand.step
            - demand.signal.clone().into()
            + &disturbance * levels * &disturbance.transpose();
        problem.require(Inequality::new(
            demand.name.clone(),
            vec![vec![Some(whole)]],
        ));
    }
    let found = problem.minimise(&level).ok()?;
    let reached = level.value(&found.scalars)[(0, 0)];
    let values = functions.iter();
    let values = values.map(|function| riccati::symmetric(function.value(&found.scalars)));
    Some((reached, values.collect()))
}
