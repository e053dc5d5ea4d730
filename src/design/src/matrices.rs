//! Between the matrices that are computed with off line and those that run on line: entry by entry,
//! nothing is rounded.

use crate::augmented::scaled;
use ftc_control::Matrix;
use ftc_control::parameters::ModeModel;
use ftc_plant::SwitchedPlant;
use nalgebra::DMatrix;

/// The matrix as the on-line controller holds it.
pub fn plain(matrix: &DMatrix<f64>) -> Matrix {
    Matrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
        matrix[(row, column)]
    })
}

/// The matrix as it is computed with off line.
pub fn dense(matrix: &Matrix) -> DMatrix<f64> {
    DMatrix::from_column_slice(matrix.nrows(), matrix.ncols(), matrix.as_slice())
}

/// The modes of a plant as the on-line controller holds them.
pub fn mode_models(plant: &SwitchedPlant) -> Vec<ModeModel> {
    let modes = plant.modes.iter().map(|mode| {
        let mut model = ModeModel::new(plain(&mode.a), plain(&mode.b), plain(&mode.c));
        model.e = plain(&mode.e);
        model.f = plain(&mode.f);
        model.x0.clone_from(&mode.operating_point.x);
        model.u0.clone_from(&mode.operating_point.u);
        model.y0.clone_from(&mode.operating_point.y);
        model
    });
    modes.collect()
}

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
