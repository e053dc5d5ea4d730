//! What the simulated plant really is, as opposed to what the controller was designed for.

use crate::SwitchedPlant;
use crate::rectifier::Rectifier;
use serde::{Deserialize, Serialize};

/// The plant behind the sensors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Truth {
    /// Exactly the design model.
    #[default]
    AsDesigned,
    /// Other matrices of the same sizes: a plant the model describes imperfectly.
    Linear {
        /// The true plant.
        plant: SwitchedPlant,
    },
    /// The nonlinear averaged rectifier.
    Rectifier(Rectifier),
}

impl Truth {
    /// The linear matrices that describe the outputs, and the motion where it is linear.
    pub fn linear<'a>(&'a self, designed: &'a SwitchedPlant) -> &'a SwitchedPlant {
        match self {
            Self::Linear { plant } => plant,
            Self::AsDesigned | Self::Rectifier(_) => designed,
        }
    }
}
