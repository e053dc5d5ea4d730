//! The baselines of one design, in the scenario of that design.

use super::predictive::{Predictive, PredictiveError, PredictiveSpec};
use super::{additive, deadbeat_bound, response_delay};
use crate::{PlantSimulator, Trajectory, Variant, run, run_with};
use ftc_control::{Controller, ControllerError};
use ftc_design::{Design, DesignError};

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
///
/// # Errors
/// Where one of them cannot be designed for this plant.
pub fn trajectories(
    design: &Design,
    plant: &PlantSimulator,
) -> Result<Vec<Trajectory>, BaselineError> {
    let parameters = additive(design)?;
    let printed = run(plant, &Controller::new(parameters)?, Variant::Additive);
    let delayed = design.controller.feedback.latency > 0;
    let spec = predictive(design, &printed)?;
    let mode = plant.initial_state().mode;
    let mut controller = Predictive::new(&design.plant, &spec, mode)?;
    if delayed {
        controller = controller.one_sample_late();
    }
    let predicted = run_with(plant, &mut controller, Variant::Predictive, delayed);
    Ok(vec![printed, predicted])
}

/// The predictive controller with the design's weights and limits. Its filter is told the noise
/// and the mean power of the scenario's disturbance.
fn predictive(design: &Design, played: &Trajectory) -> Result<PredictiveSpec, BaselineError> {
    let proof = design.proof.as_ref().ok_or(BaselineError::NoWeights)?;
    let asked = &proof.state_feedback;
    let outputs = design.signals.outputs.iter();
    let noise = outputs.zip(&design.scenario.noise);
    let channels = design.plant.dimensions().disturbances;
    let power = |channel: usize| {
        let records = &played.records;
        let sum: f64 = records.iter().map(|r| r.disturbance[channel].powi(2)).sum();
        (sum / records.len().max(1) as f64).sqrt()
    };
    let noise = noise.map(|(output, noise)| noise.max(LEAST_NOISE * output.nominal));
    let tracked = design.controller.feedback.tracked.clone();
    let mut spec = PredictiveSpec::new(&design.plant, tracked, noise.collect());
    spec.output_weight.clone_from(&asked.output_weight);
    spec.input_weight.clone_from(&asked.input_weight);
    spec.limits = design.signals.input_limits();
    spec.disturbance = (0..channels).map(power).collect();
    spec.horizon = HORIZON;
    Ok(spec)
}

/// Per tracked output, the deadbeat bound of the scenario's reference: the output follows as many samples late as the plant and the latency need.
pub fn bound(design: &Design, played: &Trajectory) -> Vec<f64> {
    let feedback = &design.controller.feedback;
    let tracked = feedback.tracked.iter().enumerate();
    tracked
        .map(|(index, &output)| {
            let reference: Vec<f64> = played.records.iter().map(|r| r.reference[index]).collect();
            let start = played.records.first().map_or(0.0, |r| r.y_true[output]);
            let delay = response_delay(&design.plant, output) + feedback.latency;
            deadbeat_bound(&reference, start, delay)
        })
        .collect()
}
