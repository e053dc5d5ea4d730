//! Least squares of short, wide problems.

use nalgebra::DMatrix;

/// Singular values below this share of the largest carry nothing but rounding.
const RELATIVE_RANK: f64 = 1e-10;

/// `X` of least `|X Z - Y|`, for regressors `Z` (r x N) and targets `Y` (t x N); of least norm where
/// `Z` lacks rank. `None` where the decomposition fails.
pub fn fit(targets: &DMatrix<f64>, regressors: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // Z' = Q R: what remains is square.
    let qr = regressors.transpose().qr();
    let projected = targets * qr.q();
    solve(&qr.r(), &projected)
}

/// `X` of least `|X R' - P|`.
fn solve(r: &DMatrix<f64>, projected: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let svd = r.clone().try_svd(true, true, f64::EPSILON, 0)?;
    let tolerance = svd.singular_values.max() * RELATIVE_RANK;
    let solution = svd.solve(&projected.transpose(), tolerance).ok()?;
    solution
        .iter()
        .all(|value| value.is_finite())
        .then(|| solution.transpose())
}
