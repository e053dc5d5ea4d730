//! What the simulated plant really is, as opposed to what the controller was designed for.

use super::integrate::{self, Tolerance};
use crate::plant::SwitchedPlant;
use crate::plant::rectifier::Rectifier;
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

/// Accuracy of the nonlinear plant, far below any sensor's.
const ACCURACY: Tolerance = Tolerance {
    relative: 1e-9,
    absolute: 1e-9,
};

impl Truth {
    /// The linear matrices that describe the outputs, and the motion where it is linear.
    pub fn linear<'a>(&'a self, designed: &'a SwitchedPlant) -> &'a SwitchedPlant {
        match self {
            Self::Linear { plant } => plant,
            Self::AsDesigned | Self::Rectifier(_) => designed,
        }
    }
}

/// Moves the rectifier's state `x` over one sample under held `u` and `w`.
pub(super) fn advance_rectifier(
    rectifier: &Rectifier,
    mode: usize,
    x: &mut [f64],
    u: &[f64],
    w: &[f64],
    sample_time: f64,
) {
    let (&[i_d, i_q, v], &[u_d, u_q]) = (&*x, u) else {
        return;
    };
    let load_current = w.first().copied().unwrap_or(0.0);
    let mut state = [i_d, i_q, v];
    integrate::advance(&mut state, sample_time, ACCURACY, |x| {
        rectifier.derivative(mode, x, [u_d, u_q], load_current)
    });
    x.copy_from_slice(&state);
}
