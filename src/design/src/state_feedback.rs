//! State feedback with integral action: theorems T1 (stability) and T2 (attenuation).
//!
//! The command is `u = K x + K_u u_prev + G Z`, with one set of gains per mode.

mod advice;
mod direct;
mod proof;
mod riccati;
mod structured;
mod synthesis;
mod theorem;
mod transformation;

pub use synthesis::{synthesise, synthesise_with};

pub(crate) use proof::scaled_gain;

use super::certificate::ControlCertificate;
use super::{ControlSpec, DwellTime, Units};
use crate::pseudo_inverse::pseudo_inverse_in;
use ftc_control::parameters::{self, FeedbackGains};
use ftc_plant::SwitchedPlant;
use ftc_plant::rows;
use ftc_record::plain;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// The gains of one mode, in physical units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ModeGains {
    /// `K_i` (m x n), multiplies the deviation of the state from the operating point.
    #[serde(with = "rows")]
    pub state_feedback: DMatrix<f64>,
    /// `G_i` (m x q), multiplies the integral part: the integrals of the tracking error, then the
    /// resonators (`q = r` without an internal model).
    #[serde(with = "rows")]
    pub integral: DMatrix<f64>,
    /// Multiplies the command that is acting now (m x m); no columns without latency.
    #[serde(with = "rows")]
    pub previous_input: DMatrix<f64>,
}

/// A certified state feedback.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StateFeedback {
    /// What was asked for.
    pub spec: ControlSpec,
    /// The gains of each mode.
    pub modes: Vec<ModeGains>,
    /// Proved bound of the l2 gain from the disturbance to the performance signal while the mode
    /// is active (one number per mode, equal under `common` and `switched`); absent when only
    /// decay was asked for or the plant has no disturbance.
    pub gamma: Option<Vec<f64>>,
    /// Below this, per mode, no gains reach under the same guarantee, as far as the solver can tell
    /// (its dual bound, not proved); zero where it cannot tell.
    pub optimum: Option<Vec<f64>>,
    /// Spectral radius of each mode's closed loop (floating point; the certificate proves the
    /// decay).
    pub spectral_radius: Vec<f64>,
    /// How long modes must last, under [`Lyapunov::Dwell`](super::Lyapunov::Dwell).
    pub dwell: Option<DwellTime>,
    /// What proves it.
    pub certificate: ControlCertificate,
}

/// A `gamma` below this, in the certificate's units (in which disturbance and performance signal are
/// near one), counts as complete rejection: nothing smaller is sought.
pub const REJECTION: f64 = 1e-4;

/// [`REJECTION`] in physical units.
pub(crate) fn rejection(units: &Units) -> f64 {
    REJECTION * units.performance / units.disturbance
}

/// How far above its optimum, relatively, a `gamma` may lie and be called the optimum.
const OPTIMALITY: f64 = 1e-3;

impl StateFeedback {
    /// Whether `gamma` of a mode (from 0) is its optimum to one part in a thousand, or the disturbance
    /// is rejected completely ([`REJECTION`]); `None` where no `gamma` was asked for.
    pub fn is_optimal(&self, mode: usize) -> Option<bool> {
        let (gamma, optimum) = (self.gamma.as_ref()?[mode], self.optimum.as_ref()?[mode]);
        let rejection = rejection(&self.certificate.units);
        Some(gamma <= (1.0 + OPTIMALITY) * optimum.max(rejection))
    }

    /// What the on-line controller needs of it on this plant. Every inverse is taken here, so that
    /// an FMU only multiplies and adds and gives the same bits on every machine. The anti-windup
    /// gain is `G^+`: the integral is pulled back to where the clamped command would have come from.
    pub fn for_controller(&self, plant: &SwitchedPlant) -> parameters::StateFeedback {
        let units = &self.certificate.units;
        let integrals = units.integral_part(&self.spec);
        let modes = self.modes.iter().zip(&plant.modes);
        let modes = modes.map(|(gains, mode)| {
            let inverse = pseudo_inverse_in(&mode.c, &units.outputs, &units.states, 1e-12);
            let mut running = FeedbackGains::new(
                plain(&gains.state_feedback),
                plain(&gains.integral),
                plain(&(&gains.state_feedback * inverse)),
            );
            running.previous_input = plain(&gains.previous_input);
            running.anti_windup = plain(&pseudo_inverse_in(
                &gains.integral,
                &units.inputs,
                &integrals,
                1e-12,
            ));
            running
        });
        let mut feedback =
            parameters::StateFeedback::new(self.spec.tracked.clone(), modes.collect());
        feedback.latency = self.spec.latency;
        feedback.resonators.clone_from(&self.spec.resonators);
        feedback
    }
}
