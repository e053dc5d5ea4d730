//! Matrices of complex numbers.

use nalgebra::{Complex, DMatrix, DVector};

/// The Moore-Penrose inverse; singular values below `threshold` count as zero. `None` for a negative threshold. The
/// entries are finite.
pub fn complex_pseudo_inverse(
    matrix: DMatrix<Complex<f64>>,
    threshold: f64,
) -> Option<DMatrix<Complex<f64>>> {
    matrix.pseudo_inverse(threshold).ok()
}

/// The singular values, descending. The entries are finite.
pub fn complex_singular_values(matrix: &DMatrix<Complex<f64>>) -> DVector<f64> {
    matrix.singular_values()
}
