//! A gain under arbitrary switching: one Lyapunov function of the whole loop, its gains fixed.

use super::gain::Channel;
use super::model::Loop;
use super::{Claim, Scaled, Subject, SwitchingGain, prove_switching};
use crate::Lyapunov;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::FactoredLyapunov;
use crate::lmi::{Inequality, Problem, Variable};
use crate::riccati;
use nalgebra::DMatrix;

/// The most unknowns for which the inequality is solved; beyond it only the gain of each mode is
/// claimed.
const MOST_UNKNOWNS: usize = 400;

/// What the storage function must lose beside the signal, in coordinates in which it is near one.
const STRICTNESS: f64 = 1e-6;

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
    let frame = Frame::of(own.map(|(.., scaled)| scaled.channel()))?;
    let (level, functions) = least(subject.modes(), &scaled, &frame, each)?;
    let unit = scaled.first()?.2.unit;
    let lyapunov: Vec<FactoredLyapunov> = functions
        .iter()
        .map(|function| frame.restore(function))
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
struct Frame {
    /// `T`: `x = T xi`.
    basis: DMatrix<f64>,
    inverse: DMatrix<f64>,
    level: f64,
}

impl Frame {
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

/// The least level and the functions that reach it, in the coordinates of the frame.
fn least(
    modes: usize,
    loops: &[(usize, usize, Scaled)],
    frame: &Frame,
    each: bool,
) -> Option<(f64, Vec<DMatrix<f64>>)> {
    let size = frame.basis.nrows();
    let mut problem = Problem::new();
    let functions: Vec<Variable> = (0..if each { modes } else { 1 })
        .map(|_| problem.symmetric(size))
        .collect();
    let level = problem.scalar();
    let function = |mode: usize| functions[if each { mode } else { 0 }].expression();
    let strict = DMatrix::identity(size, size) * STRICTNESS;
    for (i, j, scaled) in loops {
        let channel = scaled.channel();
        let a = &frame.inverse * channel.a.midpoint() * &frame.basis;
        let b = &frame.inverse * channel.b.midpoint() / frame.level;
        let c = channel.c.midpoint() * &frame.basis;
        let d = channel.d.midpoint() / frame.level;
        let followers: Vec<usize> = match each && i == j {
            true => (0..modes).collect(),
            false => vec![*j],
        };
        for next in followers {
            let after = function(next);
            let state = function(*i)
                - &a.transpose() * after.clone() * &a
                - (c.tr_mul(&c) + &strict).into();
            let cross = -(&b.transpose() * after.clone() * &a) - d.tr_mul(&c).into();
            let input =
                level.times_identity(b.ncols()) - &b.transpose() * after * &b - d.tr_mul(&d).into();
            problem.require(Inequality::new(
                BlockName::new(BlockKind::RunningLoop, *i, next),
                vec![vec![Some(state)], vec![Some(cross), Some(input)]],
            ));
        }
    }
    let found = problem.minimise(&level).ok()?;
    let reached = level.value(&found.scalars)[(0, 0)].max(0.0).sqrt();
    let values = functions.iter();
    let values = values.map(|function| riccati::symmetric(function.value(&found.scalars)));
    Some((reached * frame.level, values.collect()))
}
