//! The Moore-Penrose inverse.

use crate::augmented::scaled;
use ftc_linalg::pseudo_inverse;
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
