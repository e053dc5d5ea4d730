//! Which numbers of the modes' matrices are fitted, and how far each may be from the design model.

use crate::augmented::scaled;
use ftc_plant::Mode;
use ftc_plant::scaling::Scaling;
use nalgebra::DMatrix;

/// Error of an entry that is none in the model, relative to that of the largest entry of its row, or of its column
/// where that is what a disturbance does.
const OF_LARGEST: f64 = 0.1;

/// The matrices of a mode.
#[derive(Clone)]
pub(super) struct Matrices {
    pub(super) a: DMatrix<f64>,
    pub(super) b: DMatrix<f64>,
    pub(super) e: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
    pub(super) f: DMatrix<f64>,
}

impl Matrices {
    pub(super) fn of(mode: &Mode) -> Self {
        Self {
            a: mode.a.clone(),
            b: mode.b.clone(),
            e: mode.e.clone(),
            c: mode.c.clone(),
            f: mode.f.clone(),
        }
    }

    pub(super) fn get(&self, name: MatrixName) -> &DMatrix<f64> {
        match name {
            MatrixName::A => &self.a,
            MatrixName::B => &self.b,
            MatrixName::E => &self.e,
            MatrixName::C => &self.c,
            MatrixName::F => &self.f,
        }
    }

    pub(super) fn get_mut(&mut self, name: MatrixName) -> &mut DMatrix<f64> {
        match name {
            MatrixName::A => &mut self.a,
            MatrixName::B => &mut self.b,
            MatrixName::E => &mut self.e,
            MatrixName::C => &mut self.c,
            MatrixName::F => &mut self.f,
        }
    }
}

/// One of the matrices of a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MatrixName {
    A,
    B,
    E,
    C,
    F,
}

impl MatrixName {
    const ALL: [Self; 5] = [Self::A, Self::B, Self::E, Self::C, Self::F];
    /// Those that a disturbance acts through.
    pub(super) const OF_DISTURBANCE: [Self; 2] = [Self::E, Self::F];
}

/// Where an entry of a mode's matrices stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Entry {
    pub(super) matrix: MatrixName,
    pub(super) row: usize,
    pub(super) column: usize,
}

/// A number that is fitted.
pub(super) struct Parameter {
    pub(super) entry: Entry,
    /// The modes that share it.
    pub(super) modes: Vec<usize>,
    /// In the design model.
    pub(super) design: f64,
    /// Standard deviation about it.
    pub(super) prior: f64,
}

/// What is fitted: every entry of `A`, `B` and `C`, those of `E` and `F` where the `disturbance` is known.
pub(super) fn parameters(
    modes: &[Mode],
    disturbance: bool,
    model_error: f64,
    scaling: &Scaling,
) -> Vec<Parameter> {
    let mut parameters: Vec<Parameter> = Vec::new();
    for (index, mode) in modes.iter().enumerate() {
        let matrices = Matrices::of(mode);
        let sizes = sizes(&matrices, scaling);
        for matrix in MatrixName::ALL {
            let (values, sizes) = (matrices.get(matrix), sizes.get(matrix));
            if MatrixName::OF_DISTURBANCE.contains(&matrix) && !disturbance {
                continue;
            }
            for row in 0..values.nrows() {
                let same = |of: &Mode| matrix == MatrixName::C && of.c.row(row) == mode.c.row(row);
                let first = modes[..index].iter().position(same);
                for column in 0..values.ncols() {
                    let entry = Entry {
                        matrix,
                        row,
                        column,
                    };
                    let shared = first.and_then(|first| {
                        let mut known = parameters.iter_mut();
                        known.find(|of| of.entry == entry && of.modes.contains(&first))
                    });
                    let size = sizes[(row, column)];
                    match shared {
                        Some(parameter) => parameter.modes.push(index),
                        None if size > 0.0 => parameters.push(Parameter {
                            entry,
                            modes: vec![index],
                            design: values[(row, column)],
                            prior: model_error * size,
                        }),
                        None => {}
                    }
                }
            }
        }
    }
    parameters
}

/// The size that the error of each entry is relative to.
fn sizes(mode: &Matrices, scaling: &Scaling) -> Matrices {
    let (x, u, y) = (&scaling.states, &scaling.inputs, &scaling.outputs);
    let w = vec![1.0; mode.e.ncols()];
    let [a, b, c] = [(&mode.a, x, x), (&mode.b, x, u), (&mode.c, y, x)]
        .map(|(matrix, to, from)| scaled(matrix, to, from));
    let size =
        |matrix: &DMatrix<f64>, to: &[f64], from: &[f64], largest: &dyn Fn(usize, usize) -> f64| {
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
                matrix[(i, j)]
                    .abs()
                    .max(OF_LARGEST * largest(i, j) * to[i] / from[j])
            })
        };
    let motion = |i: usize, _: usize| {
        a.row(i)
            .amax()
            .max(b.row(i).amax())
            .max(f64::MIN_POSITIVE.sqrt())
    };
    let output = |i: usize, _: usize| c.row(i).amax();
    let [e, f] = [(&mode.e, x), (&mode.f, y)].map(|(matrix, to)| scaled(matrix, to, &w));
    Matrices {
        a: size(&mode.a, x, x, &motion),
        b: size(&mode.b, x, u, &motion),
        e: size(&mode.e, x, &w, &|_, j| e.column(j).amax()),
        c: size(&mode.c, y, x, &output),
        f: size(&mode.f, y, &w, &|_, j| f.column(j).amax()),
    }
}
