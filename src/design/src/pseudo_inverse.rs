//! The Moore-Penrose inverse.

use crate::augmented::scaled;
use nalgebra::DMatrix;

/// [`pseudo_inverse`] of a matrix whose rows and columns have units (powers of two): taken where every
/// signal is divided by its own, so that no unit decides what is negligible, or what is small.
pub(crate) fn pseudo_inverse_in(
    matrix: &DMatrix<f64>,
    rows: &[f64],
    columns: &[f64],
    tolerance: f64,
) -> DMatrix<f64> {
    let mut inverse = pseudo_inverse(&scaled(matrix, rows, columns), tolerance);
    for (mut column, unit) in inverse.column_iter_mut().zip(rows) {
        for (value, own) in column.iter_mut().zip(columns) {
            *value *= own / unit;
        }
    }
    inverse
}

/// The Moore-Penrose inverse; singular values below `tolerance` times the largest count as zero.
pub(crate) fn pseudo_inverse(matrix: &DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let zero = DMatrix::zeros(matrix.ncols(), matrix.nrows());
    // The decomposition panics on what is not a number.
    let regular = matrix.iter().all(|value| value.abs() < 1e150);
    if matrix.is_empty() || matrix.amax() == 0.0 || !regular {
        return zero;
    }
    let svd = matrix.clone().svd(true, true);
    let threshold = tolerance * svd.singular_values.max();
    svd.pseudo_inverse(threshold).unwrap_or(zero)
}
