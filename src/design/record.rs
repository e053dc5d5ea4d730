//! The design as a record: plain data, everything the exporter ships and the FMUs read.

use crate::control::ControllerParameters;
use crate::simulate::{Scenario, Truth};
use serde::{Deserialize, Serialize};

/// Version of the record's layout; an FMU refuses a record of another.
pub const FORMAT: u32 = 1;

/// A finished design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Design {
    /// Layout version, [`FORMAT`].
    pub format: u32,
    /// Name of the design.
    pub name: String,
    /// What the signals are called and measured in.
    pub signals: Signals,
    /// The controller, with the plant it was designed for.
    pub controller: ControllerParameters,
    /// What the simulated plant really is.
    #[serde(default)]
    pub truth: Truth,
    /// The experiment the plant FMU plays.
    pub scenario: Scenario,
}

/// Descriptions of the plant's signals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Signals {
    /// Inputs (m).
    pub inputs: Vec<Signal>,
    /// Outputs (p).
    pub outputs: Vec<Signal>,
    /// States (n).
    pub states: Vec<Signal>,
}

/// One signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Signal {
    /// Name, such as `u[1]` or the user's own.
    pub name: String,
    /// Unit, such as `V`; none means dimensionless.
    pub unit: Option<String>,
    /// A typical magnitude, positive.
    pub nominal: f64,
    /// Smallest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
}
