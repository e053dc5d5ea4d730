//! The nonlinear rectifier's motion over one sample, and how that changes.

use super::energy::Sampled;
use crate::integrate::{self, Stalled, Tolerance};
use ftc_control::kernel;
use ftc_plant::rectifier::Rectifier;

/// Accuracy of the nonlinear plant, far below any sensor's.
const ACCURACY: Tolerance = Tolerance::new(1e-9, 1e-9);

/// Moves the rectifier's state `x` over one sample under held `u` and `w`: by its energy, and else by
/// its equations of motion.
///
/// # Errors
/// [`Stalled`]; `x` is then as far as it came.
pub(super) fn advance_rectifier(
    (rectifier, sampled): (&Rectifier, Option<&Sampled>),
    mode: usize,
    x: &mut [f64],
    u: &[f64],
    w: &[f64],
    sample_time: f64,
) -> Result<(), Stalled> {
    let (&[i_d, i_q, v], &[u_d, u_q]) = (&*x, u) else {
        return Ok(());
    };
    let load_current = w.first().copied().unwrap_or(0.0);
    let mut state = [i_d, i_q, v];
    if let Some(next) = sampled.and_then(|it| it.advance(mode, state, [u_d, u_q], load_current)) {
        kernel::copy(x, &next);
        return Ok(());
    }
    let result = integrate::advance(&mut state, sample_time, ACCURACY, |x| {
        rectifier.derivative(mode, x, [u_d, u_q], load_current)
    });
    kernel::copy(x, &state);
    result
}

/// A signal held over a sample, and its change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held<'a> {
    /// Input `u` (m) and `du`.
    pub input: [&'a [f64]; 2],
    /// Disturbance `w` (s) and `dw`.
    pub disturbance: [&'a [f64]; 2],
}

/// The change of the rectifier's state after one sample from `x`, by its variational equation
/// `d(dx)/dt = J(x, u, w) (dx, du, dw)`, integrated together with the state; where that stalls, as
/// far as it came.
pub(super) fn differentiate_rectifier(
    rectifier: &Rectifier,
    mode: usize,
    x: &[f64],
    held: &Held<'_>,
    sample_time: f64,
    change: &mut [f64],
) {
    let (&[i_d, i_q, v], [&[u_d, u_q], &[du_d, du_q]]) = (x, held.input) else {
        return;
    };
    let [w, dw] = held.disturbance.map(|w| w.first().copied().unwrap_or(0.0));
    let mut both = [i_d, i_q, v, 0.0, 0.0, 0.0];
    let _ = integrate::advance(
        &mut both,
        sample_time,
        ACCURACY,
        |&[i_d, i_q, v, di_d, di_q, dv]| {
            let (x, dx) = ([i_d, i_q, v], [di_d, di_q, dv]);
            let rate = rectifier.derivative(mode, &x, [u_d, u_q], w);
            let change = rectifier.differential(mode, (&x, [u_d, u_q]), (&dx, [du_d, du_q], dw));
            [rate[0], rate[1], rate[2], change[0], change[1], change[2]]
        },
    );
    let [_, _, _, moved @ ..] = both;
    kernel::copy(change, &moved);
}
