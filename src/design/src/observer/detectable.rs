//! What the outputs show of the state.

use nalgebra::{Complex, DMatrix};

/// Whether every eigenvalue of `a` that does not decay as fast as `decay` shows in `c a^k`, by the
/// rank of `[lambda I - A; C]` (Popov, Belevitch, Hautus).
///
/// # Errors
/// The magnitude of the eigenvalue that no gain can move.
pub(crate) fn check_detectable(a: &DMatrix<f64>, c: &DMatrix<f64>, decay: f64) -> Result<(), f64> {
    let n = a.nrows();
    for lambda in ftc_plant::eigenvalues(a).iter() {
        if !lambda.norm().is_finite() {
            return Err(f64::INFINITY);
        }
        if lambda.norm() < decay {
            continue;
        }
        let pencil = DMatrix::from_fn(n + c.nrows(), n, |r, k| match r < n {
            true => {
                let diagonal = if r == k { *lambda } else { Complex::ZERO };
                diagonal - a[(r, k)]
            }
            false => Complex::from(c[(r - n, k)]),
        });
        // The decomposition panics on what is not a number.
        if !pencil.iter().all(|value| value.norm() < 1e150) {
            return Err(f64::INFINITY);
        }
        let values = pencil.singular_values();
        if values.min() <= 1e-9 * values.max() {
            return Err(lambda.norm());
        }
    }
    Ok(())
}
