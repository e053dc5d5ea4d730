//! The additive fault-tolerant control of the paper's section III.

use ftc_control::ControllerParameters;
use ftc_control::parameters::Compensation;
use ftc_design::derived::feedback;
use ftc_design::{Design, DesignError, Objective, RequestError, state_feedback};

/// The same controller with the gains of T1 (decay only, no attenuation of the disturbance) and
/// the additive control as printed in place of the design's compensation.
///
/// # Errors
/// [`DesignError::Request`] for a design that was not synthesised, else as
/// [`state_feedback::synthesise`].
pub fn additive(design: &Design) -> Result<ControllerParameters, DesignError> {
    let synthesis = design
        .synthesis()
        .ok_or(DesignError::Request(RequestError::NotSynthesised))?;
    let mut spec = synthesis.state_feedback.spec;
    spec.objective = Objective::Decay;
    let ours = &design.controller.feedback;
    let plant = &design.plant;
    let control = state_feedback::synthesise(plant, &spec, &design.signals.scaling())?;
    let mut parameters = design.parameters();
    parameters.compensation = Compensation::Additive;
    parameters.feedback = feedback(
        &control,
        plant,
        synthesis.running_loop.transfer.as_ref(),
        ours.has_feedforward(),
        &parameters.input_limits,
    );
    Ok(parameters)
}
