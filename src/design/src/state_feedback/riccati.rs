//! The least level of one mode without the decay inequality, and a level near it with it, by
//! game Riccati equations.
//!
//! With no weight between state and input (`H'D = 0`) and a weight on every input, `g` is reached
//! when `X = H'H + A'X (I + G X)^-1 A`, `G = B (D'D)^-1 B' - E E'/g`, has a stabilising solution `X >= 0`
//! with `g I - E'XE > 0`; `K = -(D'D)^-1 B'X (I + G X)^-1 A` and `S = X^-1`. On `A/a`, `B/a` with `a < 1`
//! the same `X` proves the decay rate `a` as well, at a larger `g`.

use super::transformation::Part;
use crate::augmented::AugmentedMode;
use crate::certificate::FactoredLyapunov;
use crate::riccati::solve;
use nalgebra::DMatrix;

/// Relative accuracy of a level that is proved, and of one that is only compared.
const ACCURACY: f64 = 1e-5;
const COARSE: f64 = 1e-3;

/// Steps between the asked rate and 1 in the search for the slowest rate that proves the asked one.
const HALVINGS: usize = 4;

/// Relative addition to the cost `H'H`, which makes the inequalities strict in every direction.
const COST_ADDITION: f64 = 1e-6;

/// A level and what proves it.
pub(super) struct Game {
    /// `g` that is proved.
    pub level: f64,
    /// No `g` is below this, with or without decay.
    pub bound: f64,
    /// Gain and Lyapunov matrix.
    pub part: Part,
}

/// One mode's matrices.
struct Data<'a> {
    model: &'a AugmentedMode,
    /// `B (D'D)^-1`.
    acting: DMatrix<f64>,
    /// `H'H`.
    cost: DMatrix<f64>,
}

/// A solution at one level.
struct Solved {
    value: DMatrix<f64>,
    gain: DMatrix<f64>,
}

/// A level near the least one at which `decay` is proved as well; `None` where the equations do not apply
/// or have no solution.
pub(super) fn game(model: &AugmentedMode, mode: usize, decay: f64) -> Option<Game> {
    let data = Data::of(model)?;
    let (bound, _) = data.least(1.0, 0.0, None, ACCURACY)?;
    let level_at =
        |rate: f64, accuracy: f64| data.least(rate, COST_ADDITION, Some(bound), accuracy);
    let (level, free) = level_at(1.0, ACCURACY)?;
    if data.decays(&free, decay) {
        return data.finish(level, bound, free, mode);
    }
    let (mut proved, mut failed) = (decay, 1.0);
    for _ in 0..HALVINGS {
        let rate = 0.5 * (proved + failed);
        match level_at(rate, COARSE) {
            Some((_, solved)) if data.decays(&solved, decay) => proved = rate,
            _ => failed = rate,
        }
    }
    let (level, solved) = level_at(proved, ACCURACY)?;
    let (level, solved) = match data.decays(&solved, decay) {
        true => (level, solved),
        false => level_at(decay, ACCURACY)?,
    };
    data.finish(level, bound, solved, mode)
}

/// A level below which no gains of this mode reach, with or without decay; `None` where the equations
/// do not apply or have no solution.
pub(super) fn bound(model: &AugmentedMode) -> Option<f64> {
    let (least, _) = Data::of(model)?.least(1.0, 0.0, None, ACCURACY)?;
    Some(least / (1.0 + ACCURACY))
}

impl<'a> Data<'a> {
    /// `None` where inputs have no weight, or one together with states.
    fn of(model: &'a AugmentedMode) -> Option<Self> {
        let weight = model.d.tr_mul(&model.d);
        let crossed = model.h.tr_mul(&model.d).amax() > 0.0;
        let inverse = weight.cholesky().filter(|_| !crossed)?.inverse();
        Some(Self {
            model,
            acting: &model.b * inverse,
            cost: model.h.tr_mul(&model.h),
        })
    }

    /// The least level on `A/rate`, `B/rate` with so much `room` in the cost, from above, and the solution
    /// there.
    fn least(
        &self,
        rate: f64,
        room: f64,
        above: Option<f64>,
        accuracy: f64,
    ) -> Option<(f64, Solved)> {
        const WIDEST: f64 = 1e24;
        let (mut low, mut high) = match above {
            Some(level) => (level, level * 1.1),
            None => (0.0, 1.0),
        };
        let mut solved = self.solve(rate, room, high);
        while solved.is_none() {
            low = high;
            high *= 4.0;
            if high > WIDEST {
                return None;
            }
            solved = self.solve(rate, room, high);
        }
        while low == 0.0 || high > low * (1.0 + accuracy) {
            let middle = match low {
                0.0 => high / 4.0,
                _ => (low * high).sqrt(),
            };
            if middle < 1e-12 {
                break;
            }
            match self.solve(rate, room, middle) {
                Some(better) => (high, solved) = (middle, Some(better)),
                None => low = middle,
            }
        }
        Some((high, solved?))
    }

    /// The stabilising solution at a level.
    fn solve(&self, rate: f64, room: f64, level: f64) -> Option<Solved> {
        let model = self.model;
        let identity = DMatrix::<f64>::identity(model.a.nrows(), model.a.nrows());
        let a = &model.a / rate;
        let game = &self.acting * model.b.transpose() / rate.powi(2)
            - &model.e * model.e.transpose() / level;
        let size = a.nrows();
        let added = DMatrix::from_diagonal_element(size, size, room * self.cost.norm());
        let value = solve(&a, &game, &(&self.cost + added))?;
        let left = DMatrix::identity(model.e.ncols(), model.e.ncols()) * level
            - model.e.tr_mul(&(&value * &model.e));
        left.cholesky()?;
        value.clone().cholesky()?;
        let ahead = &value * (&identity + &game * &value).lu().solve(&a)?;
        let gain = -self.acting.tr_mul(&ahead) / rate;
        Some(Solved { value, gain })
    }

    /// Whether the closed loop shrinks by `decay` in the norm of this solution, with room for rounding.
    fn decays(&self, solved: &Solved, decay: f64) -> bool {
        let closed = &self.model.a + &self.model.b * &solved.gain;
        let left = decay.powi(2) * (1.0 - 1e-9) * &solved.value
            - closed.tr_mul(&(&solved.value * &closed));
        left.cholesky().is_some()
    }

    fn finish(&self, level: f64, bound: f64, solved: Solved, mode: usize) -> Option<Game> {
        // S = X^-1 = L^-T L^-1.
        let lower = solved.value.cholesky()?.unpack();
        let basis = lower.transpose().try_inverse()?;
        let size = basis.nrows();
        Some(Game {
            level,
            bound: bound / (1.0 + ACCURACY),
            part: Part {
                mode,
                gain: solved.gain,
                lyapunov: FactoredLyapunov {
                    basis,
                    core: DMatrix::identity(size, size),
                },
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two states, one input, performance signal [x; 0.3 u].
    fn model() -> AugmentedMode {
        AugmentedMode {
            a: DMatrix::from_row_slice(2, 2, &[1.1, 0.4, -0.2, 0.9]),
            b: DMatrix::from_row_slice(2, 1, &[0.3, 1.0]),
            e: DMatrix::from_row_slice(2, 1, &[1.0, 0.2]),
            r: DMatrix::zeros(2, 1),
            h: DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
            d: DMatrix::from_row_slice(3, 1, &[0.0, 0.0, 0.3]),
        }
    }

    /// The inequalities of (T2) hold strictly at the level, with gain and matrix as returned, whether the
    /// decay inequality binds or not; the bound is below the level.
    #[test]
    fn what_comes_back_satisfies_both_inequalities() {
        let model = model();
        for decay in [0.999, 0.9, 0.5] {
            let found = game(&model, 0, decay).unwrap();
            assert!(found.bound <= found.level);
            let basis = &found.part.lyapunov.basis;
            let s = basis * &found.part.lyapunov.core * basis.transpose();
            let x = s.try_inverse().unwrap();
            let closed = &model.a + &model.b * &found.part.gain;
            let seen = &model.h + &model.d * &found.part.gain;
            let shrunk = decay.powi(2) * &x - closed.transpose() * &x * &closed;
            assert!(shrunk.cholesky().is_some(), "decay {decay}");
            let carried = &x * &model.e;
            let left = found.level - model.e.dot(&carried);
            assert!(left > 0.0);
            let gained = closed.transpose() * carried;
            let rest = &x
                - closed.transpose() * &x * &closed
                - seen.transpose() * &seen
                - &gained * gained.transpose() / left;
            assert!(rest.cholesky().is_some(), "attenuation at decay {decay}");
        }
    }
}
