//! State feedback, observer and the loop of both: one request, one verdict.

use super::certificate::CertificateError;
use super::observer;
use super::observer::ObserverDesign;
use super::running_loop;
use super::running_loop::RunningLoop;
use super::state_feedback;
use super::state_feedback::StateFeedback;
use super::verdict::DesignError;
use super::{ControlSpec, ObserverSpec, Run, units};
use ftc_plant::SwitchedPlant;
use ftc_plant::scaling::Scaling;
use serde::{Deserialize, Serialize};

/// A certified state feedback and a certified observer for one plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Synthesis {
    /// The gains of theorem T1 or T2.
    pub state_feedback: StateFeedback,
    /// The observer (11)-(17).
    pub observer: ObserverDesign,
    /// What is proved of both together, as the controller runs them.
    pub running_loop: RunningLoop,
}

impl Synthesis {
    /// Proves again everything it claims on this plant, without solving anything.
    ///
    /// # Errors
    /// The first inequality that cannot be proved, or what does not fit.
    pub fn verify(&self, plant: &SwitchedPlant) -> Result<(), CertificateError> {
        self.state_feedback.verify(plant)?;
        self.observer.verify(plant)?;
        let (control, observer) = (&self.state_feedback, &self.observer);
        self.running_loop.verify(plant, control, observer)
    }

    /// Proves bumpless transfer of the loop as well; `false` where no proof is found.
    pub fn certify_transfer(&mut self, plant: &SwitchedPlant) -> bool {
        let (control, observer) = (&self.state_feedback, &self.observer);
        self.running_loop.certify_transfer(plant, control, observer)
    }
}

/// Designs and certifies state feedback and observer; `scaling` holds the nominal values of the
/// signals (see [`Scaling::automatic`]).
///
/// # Errors
/// As [`state_feedback::synthesise`] and [`observer::synthesise`].
pub fn synthesise(
    plant: &SwitchedPlant,
    control: &ControlSpec,
    observer: &ObserverSpec,
    scaling: &Scaling,
) -> Result<Synthesis, DesignError> {
    Ok(synthesise_with(
        plant,
        control,
        observer,
        scaling,
        &Run::default(),
    )?)
}

/// [`synthesise`] with a chosen solver, its progress reported. That there is no observer is said only
/// after another scaling has confirmed it.
///
/// # Errors
/// As [`synthesise`], with the part that was found.
pub fn synthesise_with(
    plant: &SwitchedPlant,
    control: &ControlSpec,
    observer: &ObserverSpec,
    scaling: &Scaling,
    run: &Run,
) -> Result<Synthesis, Failure> {
    let state_feedback = match state_feedback::synthesise_with(plant, control, scaling, run) {
        Ok(found) => found,
        Err(error @ DesignError::Request(_)) => return Err(error.into()),
        Err(error) => {
            let observer = observer::synthesise(plant, observer, scaling);
            return Err(Failure {
                error,
                state_feedback: None,
                observer: observer.ok().map(Box::new),
            });
        }
    };
    let choose =
        |scaling: &Scaling| running_loop::choose(plant, &state_feedback, observer, scaling);
    let chosen = choose(scaling);
    match chosen.or_else(|error| choose(&units::other_scaling(plant, scaling)).or(Err(error))) {
        Ok((observer, running_loop)) => Ok(Synthesis {
            state_feedback,
            observer,
            running_loop,
        }),
        Err(error @ DesignError::Request(_)) => Err(error.into()),
        Err(error) => Err(Failure {
            error,
            state_feedback: Some(Box::new(state_feedback)),
            observer: None,
        }),
    }
}

/// Why there is no design, and what of it was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{error}")]
#[non_exhaustive]
pub struct Failure {
    /// Why there is no design.
    pub error: DesignError,
    /// The certified state feedback, if that was found.
    pub state_feedback: Option<Box<StateFeedback>>,
    /// The certified observer, if that was found.
    pub observer: Option<Box<ObserverDesign>>,
}

impl From<DesignError> for Failure {
    fn from(error: DesignError) -> Self {
        Self {
            error,
            state_feedback: None,
            observer: None,
        }
    }
}

impl From<Failure> for DesignError {
    fn from(failure: Failure) -> Self {
        failure.error
    }
}
