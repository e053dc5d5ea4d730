//! Per-unit scaling: the numbers a solver sees should be near one.

use super::{Mode, SwitchedPlant};
use nalgebra::{DMatrix, DVector};

/// Nominal magnitudes by which each signal is divided (all positive).
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::exhaustive_structs,
    reason = "a magnitude of each signal of the model"
)]
pub struct Scaling {
    /// States (n).
    pub states: Vec<f64>,
    /// Inputs (m).
    pub inputs: Vec<f64>,
    /// Outputs (p).
    pub outputs: Vec<f64>,
}

/// Magnitudes that are known of some signals; lists may be shorter than there are signals.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(clippy::exhaustive_structs, reason = "as Scaling")]
pub struct Known {
    /// States (n).
    pub states: Vec<Option<f64>>,
    /// Inputs (m).
    pub inputs: Vec<Option<f64>>,
    /// Outputs (p).
    pub outputs: Vec<Option<f64>>,
}

impl Known {
    /// Logarithms of states, inputs and outputs.
    fn logarithms(&self, n: usize, m: usize, p: usize) -> Vec<Option<f64>> {
        let parts = [(&self.states, n), (&self.inputs, m), (&self.outputs, p)];
        let part = |(values, size): (&Vec<Option<f64>>, usize)| {
            let value = move |k: usize| values.get(k).copied().flatten().map(f64::ln);
            (0..size).map(value).collect::<Vec<_>>()
        };
        parts.into_iter().flat_map(part).collect()
    }
}

impl Scaling {
    /// No scaling at all.
    pub fn unit(states: usize, inputs: usize, outputs: usize) -> Self {
        Self {
            states: vec![1.0; states],
            inputs: vec![1.0; inputs],
            outputs: vec![1.0; outputs],
        }
    }

    /// Finds nominal magnitudes from the plant alone: those that bring the logarithms of all
    /// non-zero entries of `A` (off the diagonal), `B`, `C`, `E` and `F` nearest to zero in the
    /// least-squares sense, the disturbances' own magnitudes being free.
    pub fn automatic(plant: &SwitchedPlant) -> Self {
        Self::completed(plant, &Known::default())
    }

    /// [`Scaling::automatic`] about the magnitudes that are known, which stay as they are. Where none is
    /// known of any signal, the outputs' are near one.
    pub fn completed(plant: &SwitchedPlant, known: &Known) -> Self {
        let dims = plant.dimensions();
        let (n, m, p) = (dims.states, dims.inputs, dims.outputs);
        let [state, input, output, disturbance] = [0, n, n + m, n + m + p];
        let mut entries = Vec::new();
        for mode in &plant.modes {
            for (matrix, row, column) in [
                (&mode.a, state, state),
                (&mode.b, state, input),
                (&mode.c, output, state),
                (&mode.e, state, disturbance),
                (&mode.f, output, disturbance),
            ] {
                for c in 0..matrix.ncols() {
                    for r in 0..matrix.nrows() {
                        let value = matrix[(r, c)].abs();
                        if value.is_normal() && row + r != column + c {
                            entries.push((row + r, column + c, value.ln()));
                        }
                    }
                }
            }
        }
        let unknowns = disturbance + dims.disturbances;
        let given = known.logarithms(dims.states, dims.inputs, dims.outputs);
        let mut logarithms = balance(&entries, &given, unknowns);
        if given.iter().all(Option::is_none) {
            // All signals may be scaled alike.
            let shift = logarithms.rows(output, p).mean();
            logarithms.add_scalar_mut(-shift);
        }
        let magnitudes = |first: usize, count: usize| -> Vec<f64> {
            logarithms
                .rows(first, count)
                .iter()
                .map(|l| l.exp())
                .collect()
        };
        let filled = |known: &[Option<f64>], found: Vec<f64>| {
            let known = known.iter().copied().chain(core::iter::repeat(None));
            found
                .into_iter()
                .zip(known)
                .map(|(found, known)| known.unwrap_or(found))
                .collect()
        };
        Self {
            states: filled(&known.states, magnitudes(state, n)),
            inputs: filled(&known.inputs, magnitudes(input, m)),
            outputs: filled(&known.outputs, magnitudes(output, p)),
        }
    }

    /// The plant in per-unit: `A <- X^-1 A X`, `B <- X^-1 B U`, `C <- Y^-1 C X`, `E <- X^-1 E`, `F <- Y^-1 F`.
    pub fn apply(&self, plant: &SwitchedPlant) -> SwitchedPlant {
        let over = |values: &[f64], reference: &[f64]| -> Vec<f64> {
            values.iter().zip(reference).map(|(v, r)| v / r).collect()
        };
        let modes = plant
            .modes
            .iter()
            .map(|mode| Mode {
                name: mode.name.clone(),
                a: scale(&mode.a, &self.states, Some(&self.states)),
                b: scale(&mode.b, &self.states, Some(&self.inputs)),
                c: scale(&mode.c, &self.outputs, Some(&self.states)),
                e: scale(&mode.e, &self.states, None),
                f: scale(&mode.f, &self.outputs, None),
                operating_point: super::OperatingPoint {
                    x: over(&mode.operating_point.x, &self.states),
                    u: over(&mode.operating_point.u, &self.inputs),
                    y: over(&mode.operating_point.y, &self.outputs),
                },
            })
            .collect();
        SwitchedPlant {
            sample_time: plant.sample_time,
            modes,
        }
    }
}

/// The shortest vector `l` that minimises the sum of `(value - l[row] + l[column])^2`, held near the
/// values that are given.
fn balance(
    entries: &[(usize, usize, f64)],
    given: &[Option<f64>],
    unknowns: usize,
) -> DVector<f64> {
    /// How much more a given value weighs than an entry.
    const HOLD: f64 = 1e4;
    let mut normal = DMatrix::<f64>::zeros(unknowns, unknowns);
    let mut right = DVector::<f64>::zeros(unknowns);
    for &(row, column, value) in entries {
        normal[(row, row)] += 1.0;
        normal[(column, column)] += 1.0;
        normal[(row, column)] -= 1.0;
        normal[(column, row)] -= 1.0;
        right[row] += value;
        right[column] -= value;
    }
    for (index, value) in given.iter().enumerate() {
        if let Some(value) = value {
            normal[(index, index)] += HOLD;
            right[index] += HOLD * value;
        }
    }
    // The normal matrix is a graph's Laplacian, held at the given values: its eigenvalues are zero or
    // not small.
    let eigen = normal.symmetric_eigen();
    let threshold = 1e-10 * unknowns as f64;
    let coordinates = eigen.eigenvectors.tr_mul(&right);
    let filtered = coordinates.zip_map(&eigen.eigenvalues, |coordinate, value| {
        if value > threshold {
            coordinate / value
        } else {
            0.0
        }
    });
    eigen.eigenvectors * filtered
}

/// Divides each row by `rows` and multiplies each column by `columns`.
fn scale(matrix: &DMatrix<f64>, rows: &[f64], columns: Option<&[f64]>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |r, c| {
        matrix[(r, c)] / rows[r] * columns.map_or(1.0, |columns| columns[c])
    })
}
