//! Matrices of real numbers.

use nalgebra::{DMatrix, DVector, Dyn, QR, SVD, SymmetricEigen};

/// The inverse of a square matrix; `None` where it is singular to nalgebra's LU decomposition.
pub fn inverse(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    matrix.try_inverse()
}

/// The Moore-Penrose inverse; singular values below `tolerance` times the largest count as zero. Zero where an
/// entry is not finite or beyond 1e150.
pub fn pseudo_inverse(matrix: &DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let zero = DMatrix::zeros(matrix.ncols(), matrix.nrows());
    // The decomposition panics on what is not a number.
    let regular = matrix.iter().all(|value| value.abs() < 1e150);
    if matrix.is_empty() || matrix.amax() == 0.0 || !regular {
        return zero;
    }
    let svd = svd(matrix.clone());
    let threshold = tolerance * svd.singular_values.max();
    svd.pseudo_inverse(threshold).unwrap_or(zero)
}

/// The QR decomposition.
pub fn qr(matrix: DMatrix<f64>) -> QR<f64, Dyn, Dyn> {
    matrix.qr()
}

/// The singular value decomposition with both sides, singular values descending. The entries are finite.
pub fn svd(matrix: DMatrix<f64>) -> SVD<f64, Dyn, Dyn> {
    matrix.svd(true, true)
}

/// [`svd`] with the right side only.
pub fn right_svd(matrix: DMatrix<f64>) -> SVD<f64, Dyn, Dyn> {
    matrix.svd(false, true)
}

/// [`svd`] of a matrix that may hold what is not finite: `None` where the iteration does not converge.
pub fn try_svd(matrix: DMatrix<f64>) -> Option<SVD<f64, Dyn, Dyn>> {
    matrix.try_svd(true, true, f64::EPSILON, 0)
}

/// The singular values, descending. The entries are finite.
pub fn singular_values(matrix: &DMatrix<f64>) -> DVector<f64> {
    matrix.singular_values()
}

/// Eigenvalues, in no order, and eigenvectors of a symmetric matrix, of which the lower triangle is read.
pub fn symmetric_eigen(matrix: DMatrix<f64>) -> SymmetricEigen<f64, Dyn> {
    matrix.symmetric_eigen()
}

/// [`symmetric_eigen`] with `tolerance` for what counts as zero; `None` after so many iterations.
pub fn try_symmetric_eigen(
    matrix: DMatrix<f64>,
    tolerance: f64,
    iterations: usize,
) -> Option<SymmetricEigen<f64, Dyn>> {
    SymmetricEigen::try_new(matrix, tolerance, iterations)
}

/// The eigenvalues of a symmetric matrix, in no order.
pub fn symmetric_eigenvalues(matrix: &DMatrix<f64>) -> DVector<f64> {
    matrix.symmetric_eigenvalues()
}
