//! Discrete Riccati and Lyapunov equations by the structure-preserving doubling algorithm.

use nalgebra::DMatrix;

/// Doublings after which nothing of a convergent iteration is left in double precision.
const DOUBLINGS: usize = 60;

/// Relative growth below which the iteration has converged.
const CONVERGED: f64 = 1e-14;

/// The solution `X` of least size of `X = a' X (I + g X)^-1 a + h` for symmetric `g` and `h` (all
/// d x d); `None` where the iteration does not converge.
///
/// With `g = b r^-1 b'` it is the cost of the linear-quadratic regulator, with `a'`, `c' r^-1 c` and
/// the process noise the covariance of the Kalman filter, with a negative semidefinite `g` the
/// storage function of the bounded-real lemma.
pub fn solve(a: &DMatrix<f64>, g: &DMatrix<f64>, h: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let identity = DMatrix::<f64>::identity(a.nrows(), a.nrows());
    let (mut a, mut g) = (a.clone(), g.clone());
    doubling(h, |h| {
        let factor = (&identity + &g * h).lu();
        let inner = factor.solve(&a)?;
        let growth = a.transpose() * h * &inner;
        let reach = &a * factor.solve(&g)? * a.transpose();
        a = &a * inner;
        g = symmetric(&g + reach);
        is_finite(&a).then_some(growth)
    })
}

/// The stationary Kalman filter's gain in correction form, `P c' (c P c' + sensor)^-1` (n x p), with `P` the
/// covariance of the prediction, for the covariances of process (n x n) and sensor (p x p, positive
/// definite) noise; `None` where there is none.
pub fn filter_gain(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    process: &DMatrix<f64>,
    sensor: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let weighted = sensor.clone().cholesky()?.solve(c);
    let reach = symmetric(c.transpose() * weighted);
    let covariance = solve(&a.transpose(), &reach, process)?;
    let innovation = symmetric(c * &covariance * c.transpose() + sensor);
    let gain = innovation.cholesky()?.solve(&(c * covariance));
    Some(gain.transpose())
}

/// `X = a' X a + h` for a stable `a`: the sum of `a'^k h a^k`; `None` where it does not converge.
pub(crate) fn lyapunov(a: &DMatrix<f64>, h: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut a = a.clone();
    doubling(h, |h| {
        let growth = a.transpose() * (h * &a);
        a = &a * &a;
        is_finite(&a).then_some(growth)
    })
}

/// Adds to `h` what each doubling contributes, until that is nothing; `None` where it does not end.
fn doubling(
    h: &DMatrix<f64>,
    mut growth: impl FnMut(&DMatrix<f64>) -> Option<DMatrix<f64>>,
) -> Option<DMatrix<f64>> {
    let mut h = h.clone();
    for _ in 0..DOUBLINGS {
        let growth = growth(&h)?;
        h = symmetric(h + &growth);
        if !is_finite(&h) {
            return None;
        }
        if growth.amax() <= CONVERGED * h.amax() {
            return Some(h);
        }
    }
    None
}

fn is_finite(x: &DMatrix<f64>) -> bool {
    x.iter().all(|value| value.is_finite())
}

/// `(x + x') / 2`.
pub(crate) fn symmetric(x: DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (&x + x.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matrix(entries: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(3, 3, entries)
    }

    proptest! {
        /// The equations hold for what comes back.
        #[test]
        fn solutions_solve(
            a in prop::collection::vec(-1.0..1.0f64, 9),
            b in prop::collection::vec(-1.0..1.0f64, 9),
            radius in 0.1..0.999f64,
        ) {
            let (raw, b) = (matrix(&a), matrix(&b));
            let stable = &raw * (radius / raw.singular_values().max());
            let h = DMatrix::identity(3, 3);
            let cost = lyapunov(&stable, &h).unwrap();
            let error = (stable.transpose() * &cost * &stable + &h - &cost).amax();
            prop_assert!(error <= 1e-10 * cost.amax());

            let g = &b * b.transpose() + 0.1 * DMatrix::<f64>::identity(3, 3);
            let x = solve(&(2.0 * raw.clone()), &g, &h).unwrap();
            let inner = (DMatrix::identity(3, 3) + &g * &x).lu().solve(&(2.0 * &raw)).unwrap();
            let error = ((2.0 * raw.transpose()) * &x * inner + &h - &x).amax();
            prop_assert!(error <= 1e-9 * x.amax(), "{error:e} of {:e}", x.amax());
        }
    }
}
