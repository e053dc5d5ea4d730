//! Dormand-Prince 5(4) with error control, on the stack: a nonlinear plant's own integrator.
//!
//! The step is chosen from the embedded error estimate alone, so the same inputs give the same
//! bits; nothing is allocated. What cannot be integrated that accurately is refused, not guessed.

/// Relative and absolute error allowed per step.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tolerance {
    /// Relative to the state.
    pub relative: f64,
    /// Per state.
    pub absolute: f64,
}

impl Tolerance {
    /// The error of a state may be `absolute + relative |x|`.
    pub const fn new(relative: f64, absolute: f64) -> Self {
        Self { relative, absolute }
    }
}

/// A stage: weights of the slopes before it. Stage times of the Dormand-Prince tableau are not needed: the
/// systems here do not depend on time explicitly.
type Stage<const K: usize> = [f64; K];

const SECOND: Stage<1> = [1.0 / 5.0];
const THIRD: Stage<2> = [3.0 / 40.0, 9.0 / 40.0];
const FOURTH: Stage<3> = [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0];
const FIFTH: Stage<4> = [
    19372.0 / 6561.0,
    -25360.0 / 2187.0,
    64448.0 / 6561.0,
    -212.0 / 729.0,
];
const SIXTH: Stage<5> = [
    9017.0 / 3168.0,
    -355.0 / 33.0,
    46732.0 / 5247.0,
    49.0 / 176.0,
    -5103.0 / 18656.0,
];
/// The last stage is the result.
const RESULT: Stage<6> = [
    35.0 / 384.0,
    0.0,
    500.0 / 1113.0,
    125.0 / 192.0,
    -2187.0 / 6784.0,
    11.0 / 84.0,
];

/// Difference between the fifth- and the fourth-order weights.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// The most steps one call may try.
const MOST_STEPS: usize = 10_000;

/// The tolerance was not met in as many steps as are allowed: the equations have no solution there
/// (a singularity), or change faster than anything meant to be simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::exhaustive_structs, reason = "it has nothing to add")]
pub struct Stalled;

/// Advances `state` under `derivative` by `duration` seconds.
///
/// # Errors
/// [`Stalled`] where the tolerance cannot be met; `state` is then where it was met last.
pub fn advance<const N: usize>(
    state: &mut [f64; N],
    duration: f64,
    tolerance: Tolerance,
    derivative: impl Fn(&[f64; N]) -> [f64; N],
) -> Result<(), Stalled> {
    let mut left = duration;
    let mut step = duration / 8.0;
    let mut slope = derivative(state);
    for _ in 0..MOST_STEPS {
        step = step.min(left);
        let tried = attempt(state, slope, step, tolerance, &derivative);
        if tried.error <= 1.0 {
            *state = tried.state;
            slope = tried.slope;
            left -= step;
            if left <= 1e-12 * duration {
                return Ok(());
            }
        }
        step *= factor(tried.error);
    }
    Err(Stalled)
}

/// By what the next step is longer, after one with this error in units of the tolerance.
fn factor(error: f64) -> f64 {
    // `0.9 error^-0.2` is well beyond the limit of 5 here.
    const TINY: f64 = 1e-4;
    if error > TINY {
        (0.9 * libm::pow(error, -0.2)).clamp(0.2, 5.0)
    } else {
        5.0
    }
}

/// What a step leads to.
struct Tried<const N: usize> {
    /// The fifth-order result.
    state: [f64; N],
    /// The derivative there.
    slope: [f64; N],
    /// The error in units of the tolerance, infinite where the result is no number.
    error: f64,
}

/// One step from `state`, where the derivative is `slope`.
fn attempt<const N: usize>(
    state: &[f64; N],
    slope: [f64; N],
    step: f64,
    tolerance: Tolerance,
    derivative: &impl Fn(&[f64; N]) -> [f64; N],
) -> Tried<N> {
    let first = slope;
    let second = derivative(&moved(state, step, &SECOND, [&first]));
    let third = derivative(&moved(state, step, &THIRD, [&first, &second]));
    let fourth = derivative(&moved(state, step, &FOURTH, [&first, &second, &third]));
    let slopes = [&first, &second, &third, &fourth];
    let fifth = derivative(&moved(state, step, &FIFTH, slopes));
    let slopes = [&first, &second, &third, &fourth, &fifth];
    let sixth = derivative(&moved(state, step, &SIXTH, slopes));
    let slopes = [&first, &second, &third, &fourth, &fifth, &sixth];
    let result = moved(state, step, &RESULT, slopes);
    let last = derivative(&result);
    let mut estimates = [0.0; N];
    let slopes = [&first, &second, &third, &fourth, &fifth, &sixth, &last];
    for (slope, weight) in slopes.into_iter().zip(&ERROR) {
        for (estimate, rate) in estimates.iter_mut().zip(slope) {
            *estimate += weight * rate;
        }
    }
    let mut worst: f64 = 0.0;
    for ((&old, &new), estimate) in state.iter().zip(&result).zip(estimates) {
        let allowed = tolerance.absolute + tolerance.relative * old.abs().max(new.abs());
        let error = (step * estimate).abs() / allowed;
        worst = worst.max(if error.is_nan() { f64::INFINITY } else { error });
    }
    Tried {
        state: result,
        slope: last,
        error: worst,
    }
}

/// `state + step * sum of weight * slope`.
#[inline(always)]
fn moved<const N: usize, const K: usize>(
    state: &[f64; N],
    step: f64,
    weights: &Stage<K>,
    slopes: [&[f64; N]; K],
) -> [f64; N] {
    let mut point = *state;
    for (slope, weight) in slopes.into_iter().zip(weights) {
        for (value, rate) in point.iter_mut().zip(slope) {
            *value += step * weight * rate;
        }
    }
    point
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillator_keeps_its_phase() {
        let tolerance = Tolerance::new(1e-9, 1e-12);
        let mut state = [1.0, 0.0];
        for _ in 0..100 {
            advance(&mut state, 0.1, tolerance, |s| [s[1], -s[0]]).unwrap();
        }
        assert!((state[0] - 10f64.cos()).abs() < 1e-7 && (state[1] + 10f64.sin()).abs() < 1e-7);
    }

    #[test]
    fn a_tighter_tolerance_gives_a_smaller_error() {
        let error = |relative| {
            let mut state = [2.0, 0.0];
            let van_der_pol = |s: &[f64; 2]| [s[1], (1.0 - s[0] * s[0]) * s[1] - s[0]];
            advance(
                &mut state,
                5.0,
                Tolerance::new(relative, relative),
                van_der_pol,
            )
            .unwrap();
            let mut exact = [2.0, 0.0];
            advance(&mut exact, 5.0, Tolerance::new(1e-12, 1e-12), van_der_pol).unwrap();
            (state[0] - exact[0]).abs()
        };
        assert!(error(1e-6) < 1e-4);
        assert!(error(1e-9) < 1e-7);
    }

    #[test]
    fn a_step_grows_as_its_error_allows() {
        for error in [1e-3, 0.1, 1.0, 1.9, 1e3, 1e9, f64::INFINITY] {
            let wanted = (0.9 * libm::pow(error, -0.2)).clamp(0.2, 5.0);
            assert_eq!(factor(error), wanted);
        }
        // Where nothing is computed the limit is reached, whatever the rounding.
        assert!(0.9 * libm::pow(1e-4, -0.2) > 5.5);
        assert_eq!([factor(0.0), factor(1e-300), factor(1e-4)], [5.0; 3]);
    }

    /// `x' = x^2` from 1 is `1 / (1 - t)`: there is nothing after t = 1.
    #[test]
    fn nothing_is_integrated_through_a_singularity() {
        let tolerance = Tolerance::new(1e-9, 1e-9);
        let square = |s: &[f64; 1]| [s[0] * s[0]];
        let mut state = [1.0];
        advance(&mut state, 0.5, tolerance, square).unwrap();
        assert!((state[0] - 2.0).abs() < 1e-7);
        assert_eq!(advance(&mut state, 1.0, tolerance, square), Err(Stalled));
        assert!(state[0] >= 2.0);
    }

    #[test]
    fn what_is_no_number_is_not_accepted() {
        let tolerance = Tolerance::new(1e-9, 1e-9);
        let mut state = [1.0, 2.0];
        let result = advance(&mut state, 1.0, tolerance, |s| [f64::NAN, s[0]]);
        assert_eq!((result, state), (Err(Stalled), [1.0, 2.0]));
    }
}
