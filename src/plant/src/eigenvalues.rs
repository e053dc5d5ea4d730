//! Eigenvalues by a QR iteration that ends on every matrix.

use nalgebra::linalg::Schur;
use nalgebra::{Complex, DMatrix, DVector};

/// Iterations of the QR algorithm per row; three are usual.
const ITERATIONS: usize = 100;
/// Entries below the diagonal that count as zero, relative to their neighbours on it: the first that ends is
/// taken. At rounding error alone the iteration may turn for ever, on a multiple of the identity for one.
const NEGLIGIBLE: [f64; 5] = [f64::EPSILON, 2e-15, 1e-14, 1e-13, 1e-11];

/// The eigenvalues of a square matrix (n). Where no iteration ends, as on a matrix that is not finite, all of them
/// are infinite: nothing is then taken for stable.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> DVector<Complex<f64>> {
    let rows = matrix.nrows();
    if rows == 0 {
        return DVector::zeros(0);
    }
    let finite = matrix.iter().all(|entry| entry.is_finite());
    let tried = NEGLIGIBLE.iter().filter(|_| finite);
    tried
        .filter_map(|&size| Schur::try_new(matrix.clone(), size, ITERATIONS * rows))
        .map(|schur| schur.complex_eigenvalues())
        .next()
        .unwrap_or_else(|| DVector::repeat(rows, Complex::new(f64::INFINITY, 0.0)))
}

/// The largest magnitude of an eigenvalue of a square matrix.
pub fn spectral_radius(matrix: &DMatrix<f64>) -> f64 {
    eigenvalues(matrix)
        .iter()
        .map(|lambda| lambda.norm())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Hessenberg;

    fn radius_is(matrix: &DMatrix<f64>, want: f64) {
        let got = spectral_radius(matrix);
        assert!((got - want).abs() < 1e-9 * (1.0 + want), "{got} for {want}");
    }

    /// Each of these kept the iteration turning for ever in some size.
    #[test]
    fn equal_and_ordered_eigenvalues_are_found() {
        for n in 1..=24 {
            for c in [0.8, 0.3, 0.5, 0.95, -0.7, 1.0, 3.0, 1e-6] {
                let scaled = DMatrix::identity(n, n) * c;
                radius_is(&scaled, f64::abs(c));
                let (_, reduced) = Hessenberg::new(scaled).unpack();
                radius_is(&reduced, f64::abs(c));
            }
            for step in [0.013, 1e-3, 0.0331] {
                let values = DVector::from_fn(n, |i, _| 0.7 + step * i as f64);
                let most = values.max();
                let diagonal = DMatrix::from_diagonal(&values);
                radius_is(&diagonal, most);
                radius_is(&Hessenberg::new(diagonal).unpack().1, most);
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_not_stable() {
        for entry in [f64::NAN, f64::INFINITY] {
            let matrix = DMatrix::from_element(3, 3, entry);
            assert!(spectral_radius(&matrix).is_infinite());
        }
        assert!(eigenvalues(&DMatrix::zeros(0, 0)).is_empty());
    }
}
