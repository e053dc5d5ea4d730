//! Gains and observer with what proves them.

use super::{CertificateError, StateFeedback};
use crate::plant::SwitchedPlant;
use serde::{Deserialize, Serialize};

/// What was solved for and proved; a record carries it so that anyone can prove it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Synthesis {
    /// The state feedback, its attenuation, its certificate.
    pub control: StateFeedback,
}

impl Synthesis {
    /// Proves every promise again from the shipped doubles.
    ///
    /// # Errors
    /// The first inequality that cannot be proved.
    pub fn verify(&self, plant: &SwitchedPlant) -> Result<(), CertificateError> {
        self.control.verify(plant)
    }
}
