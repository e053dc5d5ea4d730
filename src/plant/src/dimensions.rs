//! The sizes of a plant, and the check that every matrix has them.

use super::error::PlantError;
use super::number::positive;
use super::{Mode, OperatingPoint, SwitchedPlant};

/// Numbers of states `n`, inputs `m`, outputs `p` and disturbances `s`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::exhaustive_structs, reason = "the sizes of A, B, C and E")]
pub struct Dimensions {
    /// `n`
    pub states: usize,
    /// `m`
    pub inputs: usize,
    /// `p`
    pub outputs: usize,
    /// `s`
    pub disturbances: usize,
}

impl Dimensions {
    /// The sizes of a plant whose matrices all fit.
    ///
    /// # Errors
    /// The first matrix of a wrong size or with an entry that is not finite.
    pub fn check(plant: &SwitchedPlant) -> Result<Self, PlantError> {
        if plant.modes.is_empty() {
            return Err(PlantError::NoMode);
        }
        positive(plant.sample_time).map_err(PlantError::SampleTime)?;
        let dims = plant.dimensions();
        for (what, size) in [
            ("states (rows of A)", dims.states),
            ("inputs (columns of B)", dims.inputs),
            ("outputs (rows of C)", dims.outputs),
        ] {
            if size == 0 {
                return Err(PlantError::Empty(what));
            }
        }
        for (index, mode) in plant.modes.iter().enumerate() {
            dims.check_matrices(index, mode)?;
            dims.check_operating_point(index, &mode.operating_point)?;
        }
        Ok(dims)
    }

    fn check_matrices(self, index: usize, mode: &Mode) -> Result<(), PlantError> {
        let Self {
            states: n,
            inputs: m,
            outputs: p,
            disturbances: s,
        } = self;
        for (name, matrix, needed) in [
            ("A", &mode.a, (n, n)),
            ("B", &mode.b, (n, m)),
            ("C", &mode.c, (p, n)),
            ("E", &mode.e, (n, s)),
            ("F", &mode.f, (p, s)),
        ] {
            let found = matrix.shape();
            if found != needed {
                return Err(match index {
                    0 => PlantError::Shape {
                        matrix: name,
                        found,
                        needed,
                        states: n,
                    },
                    _ => PlantError::OtherShape {
                        mode: index + 1,
                        matrix: name,
                        found,
                        needed,
                    },
                });
            }
            if let Some(at) = matrix.iter().position(|value| !value.is_finite()) {
                return Err(PlantError::NotFinite {
                    mode: index + 1,
                    matrix: name,
                    row: at % needed.0 + 1,
                    column: at / needed.0 + 1,
                });
            }
        }
        Ok(())
    }

    fn check_operating_point(self, index: usize, point: &OperatingPoint) -> Result<(), PlantError> {
        let mode = index + 1;
        for (part, vector, needed) in [
            ("x", &point.x, self.states),
            ("u", &point.u, self.inputs),
            ("y", &point.y, self.outputs),
        ] {
            let found = vector.len();
            if found != needed {
                return Err(PlantError::OperatingPointLength {
                    mode,
                    part,
                    found,
                    needed,
                });
            }
            if vector.iter().any(|value| !value.is_finite()) {
                return Err(PlantError::OperatingPointNotFinite { mode, part });
            }
        }
        Ok(())
    }
}
