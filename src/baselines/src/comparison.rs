//! The baselines of one design, in the scenario of that design.

use crate::predictive::{Predictive, PredictiveError, PredictiveSpec};
use crate::{DeadbeatSum, additive, response_delay};
use ftc_control::{Controller, ControllerError};
use ftc_design::{Design, DesignError};
use ftc_simulate::closed_loop::{Loop, Record, visit};
use ftc_simulate::{PlantSimulator, Variant};

/// Samples the predictive controller looks ahead.
const HORIZON: usize = 20;
/// Least noise its filter assumes, relative to the nominal value of an output.
const LEAST_NOISE: f64 = 1e-3;

/// Why a design cannot be compared with a baseline.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BaselineError {
    /// There are no gains for the additive control.
    #[error("the additive baseline: {0}")]
    Additive(#[from] DesignError),
    /// The additive control does not fit the plant.
    #[error("the additive baseline: {0}")]
    Controller(#[from] ControllerError),
    /// There is no predictive controller.
    #[error("the predictive baseline: {0}")]
    Predictive(#[from] PredictiveError),
    /// The design was not synthesised, so its weights are unknown.
    #[error("the design carries no weights: design it again")]
    NoWeights,
}

/// The additive FTC of the paper's section III and model predictive control.
pub struct Baselines {
    additive: Controller,
    predictive: Predictive,
    delayed: bool,
}

impl Baselines {
    /// Designs both.
    ///
    /// # Errors
    /// Where one of them cannot be designed for this plant.
    pub fn new(design: &Design, plant: &PlantSimulator) -> Result<Self, BaselineError> {
        let additive = Controller::new(additive(design)?)?;
        let delayed = design.controller.feedback.latency > 0;
        let spec = predictive(design, disturbance_power(plant, &additive))?;
        let mode = plant.initial_state().mode;
        let mut predictive = Predictive::new(&design.plant, &spec, mode)?;
        if delayed {
            predictive = predictive.one_sample_late();
        }
        Ok(Self {
            additive,
            predictive,
            delayed,
        })
    }

    /// Their loops, at rest.
    pub fn loops<'a>(&'a mut self, plant: &'a PlantSimulator) -> [(Variant, Loop<'a>); 2] {
        let predictive = Box::new(&mut self.predictive);
        [
            (
                Variant::Additive,
                Loop::tolerant(plant, &self.additive, Variant::Additive),
            ),
            (
                Variant::Predictive,
                Loop::new(plant, predictive, self.delayed),
            ),
        ]
    }
}

/// Root mean square of each disturbance (s) over the scenario.
fn disturbance_power(plant: &PlantSimulator, controller: &Controller) -> Vec<f64> {
    let mut squares = vec![0.0; plant.initial_state().disturbance.len()];
    visit(plant, controller, Variant::Additive, &mut |seen| {
        for (sum, value) in squares.iter_mut().zip(&seen.plant.disturbance) {
            *sum += value.powi(2);
        }
    });
    let samples = plant.scenario().steps.max(1) as f64;
    squares.iter().map(|sum| (sum / samples).sqrt()).collect()
}

/// The predictive controller with the design's weights and limits. Its filter is told the noise
/// and the mean power of the scenario's disturbance.
fn predictive(design: &Design, disturbance: Vec<f64>) -> Result<PredictiveSpec, BaselineError> {
    let proof = design.proof.as_ref().ok_or(BaselineError::NoWeights)?;
    let asked = &proof.state_feedback;
    let outputs = design.signals.outputs.iter();
    let noise = outputs.zip(&design.scenario.noise);
    let noise = noise.map(|(output, noise)| noise.max(LEAST_NOISE * output.nominal));
    let tracked = design.controller.feedback.tracked.clone();
    let mut spec = PredictiveSpec::new(&design.plant, tracked, noise.collect());
    spec.output_weight.clone_from(&asked.output_weight);
    spec.input_weight.clone_from(&asked.input_weight);
    spec.limits = design.signals.input_limits();
    spec.disturbance = disturbance;
    spec.horizon = HORIZON;
    Ok(spec)
}

/// Per tracked output, the deadbeat bound of the scenario's reference, gathered sample by sample: the
/// output follows as many samples late as the plant and the latency need.
#[derive(Debug)]
pub struct Bound<'a> {
    design: &'a Design,
    sums: Vec<DeadbeatSum>,
}

impl<'a> Bound<'a> {
    /// Nothing seen yet.
    pub fn new(design: &'a Design) -> Self {
        Self {
            design,
            sums: Vec::new(),
        }
    }

    /// Looks at a sample.
    pub fn see(&mut self, record: &Record) {
        let feedback = &self.design.controller.feedback;
        if self.sums.is_empty() {
            let tracked = feedback.tracked.iter();
            let sums = tracked.map(|&output| {
                let delay = response_delay(&self.design.plant, output) + feedback.latency;
                DeadbeatSum::new(record.y_true[output], delay)
            });
            self.sums = sums.collect();
        }
        for (sum, &reference) in self.sums.iter_mut().zip(&record.reference) {
            sum.add(reference);
        }
    }

    /// The bounds.
    pub fn bounds(&self) -> Vec<f64> {
        self.sums.iter().map(DeadbeatSum::bound).collect()
    }
}
