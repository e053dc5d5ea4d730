//! Per-unit scaling: the numbers a solver sees should be near one.

use super::{Mode, SwitchedPlant};
use nalgebra::DMatrix;

/// Nominal magnitudes by which each signal is divided (all positive).
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// States (n).
    pub states: Vec<f64>,
    /// Inputs (m).
    pub inputs: Vec<f64>,
    /// Outputs (p).
    pub outputs: Vec<f64>,
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

/// Divides each row by `rows` and multiplies each column by `columns`.
fn scale(matrix: &DMatrix<f64>, rows: &[f64], columns: Option<&[f64]>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |r, c| {
        matrix[(r, c)] / rows[r] * columns.map_or(1.0, |columns| columns[c])
    })
}
