//! The switched plant: known linear modes, one active at a time.
//!
//! Mode `i` obeys, with sample time `Te`,
//!
//! ```text
//! x(k+1) = x0 + A (x(k) - x0) + B (u(k) - u0) + E w(k)
//! y(k)   = y0 + C (x(k) - x0) + f(k) + F w(k)
//! ```
//!
//! where `(x0, u0, y0)` is the mode's operating point (zero when absent), `w` the periodic
//! disturbance and `f` the additive sensor fault. Everything is in the user's physical units.
//!
//! ```
//! use ftc_plant::{Dimensions, Mode, PlantError, SwitchedPlant};
//! use nalgebra::dmatrix;
//!
//! let mode = |pole: f64| {
//!     Mode::new(dmatrix![pole], dmatrix![0.5], dmatrix![1.0]) // A, B, C
//!         .named(format!("pole {pole}"))
//!         .with_disturbance(dmatrix![0.1], dmatrix![0.0]) // E, F
//! };
//! let mut plant = SwitchedPlant::new(0.1, vec![mode(0.9), mode(0.8)]);
//! assert_eq!(Dimensions::check(&plant)?.states, 1);
//! plant.modes[1].b = dmatrix![0.5, 0.5];
//! let error = Dimensions::check(&plant).unwrap_err();
//! assert!(matches!(error, PlantError::OtherShape { mode: 2, matrix: "B", .. }));
//! # Ok::<(), PlantError>(())
//! ```

mod continuous;
pub mod deviation;
mod dimensions;
mod eigenvalues;
mod error;
pub mod noise;
pub mod number;
pub mod rectifier;
pub mod rows;
pub mod scaling;
pub mod scenario;
mod true_plant;

pub use deviation::Deviation;
pub use dimensions::Dimensions;
pub use eigenvalues::{eigenvalues, spectral_radius};
pub use error::PlantError;
pub use scenario::{Scenario, ScenarioError};
pub use true_plant::TruePlant;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A point around which a mode was linearised; a steady state of that mode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "a steady state is x0, u0, y0")]
pub struct OperatingPoint {
    /// State `x0` (n).
    pub x: Vec<f64>,
    /// Input `u0` (m).
    pub u: Vec<f64>,
    /// Output `y0` (p).
    pub y: Vec<f64>,
}

/// One linear mode; the paper's `(A_i, B_i, C_i, E_i)` of (1) with both disturbance channels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Mode {
    /// What the user calls it.
    pub name: String,
    /// State matrix `A` (n x n).
    #[serde(with = "rows")]
    pub a: DMatrix<f64>,
    /// Input matrix `B` (n x m).
    #[serde(with = "rows")]
    pub b: DMatrix<f64>,
    /// Output matrix `C` (p x n).
    #[serde(with = "rows")]
    pub c: DMatrix<f64>,
    /// Disturbance to state, `E` (n x s); zero columns when the plant has no disturbance.
    #[serde(with = "rows")]
    pub e: DMatrix<f64>,
    /// Disturbance to output, `F` (p x s).
    #[serde(with = "rows")]
    pub f: DMatrix<f64>,
    /// Where the mode was linearised.
    pub operating_point: OperatingPoint,
}

/// A plant that switches between known modes by a known signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SwitchedPlant {
    /// Sample time `Te` in seconds.
    pub sample_time: f64,
    /// The modes; mode number `i` of the user is `modes[i - 1]`.
    pub modes: Vec<Mode>,
}

impl OperatingPoint {
    /// The origin.
    pub fn zero(states: usize, inputs: usize, outputs: usize) -> Self {
        Self {
            x: vec![0.0; states],
            u: vec![0.0; inputs],
            y: vec![0.0; outputs],
        }
    }
}

impl Mode {
    /// A mode of these `A`, `B` and `C`, about the origin, without a name and without a known disturbance;
    /// [`Dimensions::check`] says whether the matrices fit together.
    pub fn new(a: DMatrix<f64>, b: DMatrix<f64>, c: DMatrix<f64>) -> Self {
        let (states, inputs, outputs) = (a.nrows(), b.ncols(), c.nrows());
        Self {
            name: String::new(),
            a,
            b,
            c,
            e: DMatrix::zeros(states, 0),
            f: DMatrix::zeros(outputs, 0),
            operating_point: OperatingPoint::zero(states, inputs, outputs),
        }
    }

    /// The same mode with a name.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..self
        }
    }

    /// The same mode under a disturbance: to the state by `E` (n x s), to the output by `F` (p x s).
    pub fn with_disturbance(self, e: DMatrix<f64>, f: DMatrix<f64>) -> Self {
        Self { e, f, ..self }
    }

    /// The same mode about another operating point.
    pub fn about(self, operating_point: OperatingPoint) -> Self {
        Self {
            operating_point,
            ..self
        }
    }

    /// The affine term of the state equation, `x0 - A x0 - B u0` (n).
    pub fn state_offset(&self) -> DVector<f64> {
        let x0 = DVector::from_column_slice(&self.operating_point.x);
        let u0 = DVector::from_column_slice(&self.operating_point.u);
        &x0 - &self.a * &x0 - &self.b * u0
    }

    /// The affine term of the output equation, `y0 - C x0` (p).
    pub fn output_offset(&self) -> DVector<f64> {
        let x0 = DVector::from_column_slice(&self.operating_point.x);
        DVector::from_column_slice(&self.operating_point.y) - &self.c * x0
    }

    /// The largest magnitude of an eigenvalue of `A`.
    pub fn spectral_radius(&self) -> f64 {
        spectral_radius(&self.a)
    }
}

impl SwitchedPlant {
    /// A plant with this sample time in seconds and these modes.
    pub fn new(sample_time: f64, modes: Vec<Mode>) -> Self {
        Self { sample_time, modes }
    }

    /// Sizes; every mode has the same (see [`Dimensions::check`]).
    pub fn dimensions(&self) -> Dimensions {
        let mode = &self.modes[0];
        Dimensions {
            states: mode.a.nrows(),
            inputs: mode.b.ncols(),
            outputs: mode.c.nrows(),
            disturbances: mode.e.ncols(),
        }
    }
}
