//! Between the matrices that are computed with off line and those that run on line: entry by entry,
//! nothing is rounded.

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
