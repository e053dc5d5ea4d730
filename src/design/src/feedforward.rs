//! Reference feedforward: what a new reference does to the command before the integrators know.
//!
//! With the gains of T1 or T2 closed, a mode follows `x~(k+1) = A x~(k) + (B N + R) y_ref`. After a
//! step of the reference it comes to rest at `(I - A)^-1 (B N + R) y_ref`, and its distance from
//! there shrinks by `A`. What the step costs,
//!
//! ```text
//! J(N) = sum over k of |W_y S (y_ref - y(k))|^2 + |W_u (u(k) - u(infinity))|^2,
//! ```
//!
//! is then a quadratic form of `N`, and has its least value in closed form. The weights are those
//! of the performance signal; the integrals are left out, as `N` moves their final value. `N` stands
//! outside the loop: whatever it is, every proof about the loop holds unchanged.

use super::StateFeedback;
use super::augmented::{AugmentedMode, augment};
use super::state_feedback::scaled_gain;
use crate::pseudo_inverse::pseudo_inverse;
use ftc_plant::SwitchedPlant;
use nalgebra::DMatrix;

/// Squarings of `A` after which nothing of a stable loop is left in double precision.
const MOST_SQUARINGS: usize = 60;

/// Directions of the command that matter less than this share of the strongest stay unused.
const TOLERANCE: f64 = 1e-12;

/// `N_i` (m x r) of each mode, in physical units. Where weights of zero leave it open it is zero.
pub fn feedforward(plant: &SwitchedPlant, control: &StateFeedback) -> Vec<DMatrix<f64>> {
    let units = &control.certificate.units;
    let mut spec = control.spec.clone();
    spec.integral_weight.fill(0.0);
    let modes = augment(plant, &spec, units).into_iter().zip(&control.modes);
    modes
        .map(|(model, gains)| {
            let mut gain = optimum(&model, &scaled_gain(gains, units, &spec));
            for (mut row, unit) in gain.row_iter_mut().zip(&units.inputs) {
                row *= *unit;
            }
            gain
        })
        .collect()
}

/// The `N` of least `J` for one mode under `gain`, both in the model's units.
fn optimum(model: &AugmentedMode, gain: &DMatrix<f64>) -> DMatrix<f64> {
    let closed = &model.a + &model.b * gain;
    let signal = &model.h + &model.d * gain;
    let cost = cost_to_go(&closed, &signal);
    let rest = (DMatrix::identity(closed.nrows(), closed.nrows()) - closed).lu();
    let none = DMatrix::zeros(model.b.ncols(), model.r.ncols());
    let (Some(moved), Some(asked)) = (rest.solve(&model.b), rest.solve(&model.r)) else {
        return none;
    };
    let weighted = moved.transpose() * cost;
    -pseudo_inverse(&(&weighted * moved), TOLERANCE) * (weighted * asked)
}

/// `P = sum over k of A'^k H'H A^k`: what a distance from rest costs, by doubling the sum's length.
fn cost_to_go(a: &DMatrix<f64>, h: &DMatrix<f64>) -> DMatrix<f64> {
    let mut power = a.clone();
    let mut sum = h.transpose() * h;
    for _ in 0..MOST_SQUARINGS {
        let later = power.transpose() * &sum * &power;
        if later.amax() <= f64::EPSILON * sum.amax() {
            break;
        }
        sum += later;
        power = &power * &power;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// `P = H'H + A'PA` for every stable `A`, slow ones included.
        #[test]
        fn the_cost_solves_its_equation(
            entries in prop::collection::vec(-1.0..1.0f64, 16),
            weights in prop::collection::vec(-1.0..1.0f64, 8),
            decay in 0.01..0.9999f64,
        ) {
            let raw = DMatrix::from_vec(4, 4, entries);
            let a = &raw * (decay / raw.singular_values().max());
            let h = DMatrix::from_vec(2, 4, weights);
            let cost = cost_to_go(&a, &h);
            let error = (h.transpose() * &h + a.transpose() * &cost * &a - &cost).amax();
            prop_assert!(error <= 1e-12 * cost.amax(), "{error:e} of {:e}", cost.amax());
        }
    }
}
