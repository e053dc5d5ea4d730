//! The record of a design: plain data, everything the exporter ships and the FMUs read.

use crate::matrices::mode_models;
use ftc_control::parameters::{
    Compensation, Estimator, EstimatorMethod, Limits, Observer, StateFeedback,
};
use ftc_control::{ControllerError, ControllerParameters};
use ftc_plant::SwitchedPlant;
use ftc_plant::deviation::DeviationError;
use ftc_plant::scaling::Scaling;
use ftc_plant::{Dimensions, PlantError};
use ftc_plant::{Scenario, ScenarioError, TruePlant};
use serde::{Deserialize, Serialize};

/// Version of the record's layout; an FMU refuses a record of another.
pub const FORMAT: u32 = 6;

/// What of a finished design an FMU holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DesignRecord {
    /// Layout version, [`FORMAT`].
    pub format: u32,
    /// Name of the design.
    pub name: String,
    /// What the signals are called and measured in.
    pub signals: Signals,
    /// The plant as it was designed for (physical units).
    pub plant: SwitchedPlant,
    /// The controller.
    pub controller: ControllerDesign,
    /// What the simulated plant really is.
    #[serde(default)]
    pub true_plant: TruePlant,
    /// The experiment the plant FMU runs.
    pub scenario: Scenario,
}

impl Signal {
    /// A dimensionless signal without limits, of nominal value 1.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.into(),
            unit: None,
            nominal: 1.0,
            min: None,
            max: None,
        }
    }
}

/// What of a controller is neither the plant's nor the signals'.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ControllerDesign {
    /// State feedback with integral action.
    pub feedback: StateFeedback,
    /// State observer.
    pub observer: Observer,
    /// Fault estimator.
    pub estimator: Estimator,
    /// How an estimated fault is taken out of the loop.
    pub compensation: Compensation,
}

/// Descriptions of the plant's signals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Signals {
    /// Inputs (m).
    pub inputs: Vec<Signal>,
    /// Outputs (p).
    pub outputs: Vec<Signal>,
    /// States (n).
    pub states: Vec<Signal>,
    /// Disturbances (s), or none where they are not described.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disturbances: Vec<Signal>,
}

impl ControllerDesign {
    /// A controller of these parts.
    pub fn new(
        feedback: StateFeedback,
        observer: Observer,
        estimator: Estimator,
        compensation: Compensation,
    ) -> Self {
        Self {
            feedback,
            observer,
            estimator,
            compensation,
        }
    }
}

impl Signals {
    /// These inputs, outputs and states; disturbances are not described.
    pub fn new(inputs: Vec<Signal>, outputs: Vec<Signal>, states: Vec<Signal>) -> Self {
        Self {
            inputs,
            outputs,
            states,
            disturbances: Vec::new(),
        }
    }

    /// `u[1]`, `y[1]`, `x[1]` and so on, each as [`Signal::new`]; disturbances are not described.
    pub fn numbered(dims: Dimensions) -> Self {
        let numbered = |letter: &str, count: usize| {
            let numbers = 1..=count;
            numbers
                .map(|number| Signal::new(&format!("{letter}[{number}]")))
                .collect()
        };
        Self {
            inputs: numbered("u", dims.inputs),
            outputs: numbered("y", dims.outputs),
            states: numbered("x", dims.states),
            disturbances: Vec::new(),
        }
    }

    /// The ends of each input's range (m), to which the command is clamped.
    pub fn input_limits(&self) -> Vec<Limits> {
        let of = |input: &Signal| Limits {
            min: input.min,
            max: input.max,
        };
        self.inputs.iter().map(of).collect()
    }

    /// The nominal values of inputs, outputs and states.
    pub fn scaling(&self) -> Scaling {
        let nominal = |signals: &[Signal]| signals.iter().map(|s| s.nominal).collect();
        Scaling {
            states: nominal(&self.states),
            inputs: nominal(&self.inputs),
            outputs: nominal(&self.outputs),
        }
    }
}

/// One signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
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

/// What of a design does not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// Another layout than [`FORMAT`].
    #[error("the design has layout {0}, but this program reads layout {FORMAT}: export it again")]
    Format(u32),
    /// The plant is ill-formed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A list has another length than the plant needs.
    #[error("the design has {found} {what}, but its plant needs {needed}")]
    Count {
        /// What is listed.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// The estimator would need more memory than any design that is made here.
    #[error("the design is not one of ours: {0}")]
    Memory(ControllerError),
    /// An output is tracked that does not exist; the number of outputs.
    #[error("the design tracks an output beyond its {0}")]
    Tracked(usize),
    /// The scenario cannot be run on the plant.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The deviation does not fit the plant.
    #[error(transparent)]
    Deviation(#[from] DeviationError),
    /// The true plant does not have the designed plant's sizes.
    #[error("the true plant has other sizes than the designed one")]
    TruePlant,
}

impl DesignRecord {
    /// A controller for a plant that is as it was designed for.
    pub fn new(
        name: &str,
        plant: SwitchedPlant,
        signals: Signals,
        controller: ControllerDesign,
        scenario: Scenario,
    ) -> Self {
        Self {
            format: FORMAT,
            name: name.into(),
            plant,
            signals,
            controller,
            true_plant: TruePlant::default(),
            scenario,
        }
    }

    /// The data of the on-line controller.
    pub fn parameters(&self) -> ControllerParameters {
        let controller = self.controller.clone();
        let mut parameters = ControllerParameters::new(
            self.plant.sample_time,
            mode_models(&self.plant),
            controller.feedback,
            controller.observer,
        );
        parameters.estimator = controller.estimator;
        parameters.compensation = controller.compensation;
        parameters.input_limits = self.signals.input_limits();
        parameters
    }

    /// Whether every part fits the plant, so that nothing on line meets a wrong size.
    ///
    /// # Errors
    /// The first part that does not fit.
    pub fn check(&self) -> Result<(), RecordError> {
        if self.format != FORMAT {
            return Err(RecordError::Format(self.format));
        }
        let plant = &self.plant;
        let dims = Dimensions::check(plant)?;
        self.check_counts(dims)?;
        let modes = plant.modes.len();
        let tracked = &self.controller.feedback.tracked;
        let memory = self.controller.estimator.check_memory(dims.inputs);
        memory.map_err(RecordError::Memory)?;
        if tracked.iter().any(|&row| row >= dims.outputs) {
            return Err(RecordError::Tracked(dims.outputs));
        }
        self.scenario.check(dims, modes, tracked.len())?;
        let (motion, deviation) = self.true_plant.clone().into_parts();
        deviation.check(plant)?;
        if let TruePlant::Linear { plant: truth } = &motion
            && (Dimensions::check(truth)? != dims || truth.modes.len() != modes)
        {
            return Err(RecordError::TruePlant);
        }
        Ok(())
    }

    /// Whether there is one of everything that the plant's sizes ask for.
    fn check_counts(&self, dims: Dimensions) -> Result<(), RecordError> {
        let modes = self.plant.modes.len();
        let predicted = match self.controller.estimator.method {
            EstimatorMethod::Reference => modes,
            EstimatorMethod::Observer | EstimatorMethod::Sliding | EstimatorMethod::None => {
                self.controller.estimator.predictors.len()
            }
        };
        for (what, found, needed) in [
            ("inputs described", self.signals.inputs.len(), dims.inputs),
            (
                "outputs described",
                self.signals.outputs.len(),
                dims.outputs,
            ),
            ("states described", self.signals.states.len(), dims.states),
            (
                "modes with feedback gains",
                self.controller.feedback.modes.len(),
                modes,
            ),
            (
                "modes with observer gains",
                self.controller.observer.gains.len(),
                modes,
            ),
            (
                "modes with a predictor",
                self.controller.estimator.predictors.len(),
                predicted,
            ),
            (
                "thresholds",
                self.controller.estimator.thresholds.len(),
                dims.outputs,
            ),
        ] {
            if found != needed {
                return Err(RecordError::Count {
                    what,
                    found,
                    needed,
                });
            }
        }
        Ok(())
    }
}
