//! What the simulated plant really is, as opposed to what the controller was designed for.

use crate::rectifier::Rectifier;
use crate::{Deviation, SwitchedPlant};
use serde::{Deserialize, Serialize};

/// The plant behind the sensors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new plant must be simulated everywhere: the compiler says where"
)]
pub enum TruePlant {
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
    /// One of these, with other departures.
    Deviating {
        /// Its motion.
        plant: Box<TruePlant>,
        /// The rest.
        deviation: Deviation,
    },
}

impl TruePlant {
    /// The linear matrices that describe the outputs, and the motion where it is linear.
    pub fn linear<'a>(&'a self, designed: &'a SwitchedPlant) -> &'a SwitchedPlant {
        match self {
            Self::Linear { plant } => plant,
            Self::AsDesigned | Self::Rectifier(_) => designed,
            Self::Deviating { plant, .. } => plant.linear(designed),
        }
    }

    /// Its motion, and what else departs from the model.
    pub fn into_parts(self) -> (Self, Deviation) {
        match self {
            Self::Deviating { plant, deviation } => (*plant, deviation),
            motion => (motion, Deviation::default()),
        }
    }

    /// The motion of this plant with these departures.
    pub fn with_deviation(self, deviation: Deviation) -> Self {
        let (motion, _) = self.into_parts();
        if deviation == Deviation::default() {
            return motion;
        }
        Self::Deviating {
            plant: Box::new(motion),
            deviation,
        }
    }
}
