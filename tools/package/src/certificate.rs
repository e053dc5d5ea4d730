//! `resources/certificate.json`: what an FMU's design promises, and what proves it.

use ftc_design::{
    ControlCertificate, Design, DwellTime, LostCertificate, Lyapunov, ObserverCertificate,
    RunningLoop,
};
use serde::{Deserialize, Serialize};

/// Where it stands in an FMU.
pub const PATH: &str = "resources/certificate.json";

/// Version of its layout.
const FORMAT: u32 = 2;

/// Identifier under which the design's fingerprint is taken.
const IDENTIFIER: &str = "certificate";

/// The certificate of the design beside which it lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// Layout version.
    pub format: u32,
    /// Fingerprint of the bytes of `resources/design.json`.
    pub design: String,
    /// What is promised.
    pub claims: Claims,
    /// What proves it, together with plant and gains in the design.
    pub proof: Proof,
}

/// What a certified design promises.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claims {
    /// Promises of the state feedback.
    pub state_feedback: Promise,
    /// Bound of the l2 gain from the disturbance to the performance signal, per mode; none where
    /// only decay was asked for or the plant knows no disturbance.
    pub gamma: Option<Vec<f64>>,
    /// Promises of the observer.
    pub observer: Promise,
    /// Promises of the loop that runs: gains, and what losing sensors leaves.
    pub running_loop: RunningLoop,
}

/// Stability of one of the two loops.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Promise {
    /// Which family of Lyapunov functions: under `common` and `switched`, switching is arbitrary.
    pub lyapunov: Lyapunov,
    /// The state shrinks by this factor per sample while no mode switches (under `dwell`), else
    /// always.
    pub decay: f64,
    /// How long modes must last on average, under `dwell`.
    pub dwell: Option<DwellTime>,
}

/// Lyapunov matrices and their units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proof {
    /// Of the state feedback.
    pub state_feedback: ControlCertificate,
    /// Of the observer.
    pub observer: ObserverCertificate,
    /// Of the observer with sensors lost.
    pub lost: Option<LostCertificate>,
}

impl Certificate {
    /// The certificate of a design whose record has these bytes; none where nothing was synthesised.
    pub fn of(design: &Design, bytes: &[u8]) -> Option<Self> {
        let synthesis = design.synthesis.as_ref()?;
        let (control, observer) = (&synthesis.state_feedback, &synthesis.observer);
        Some(Self {
            format: FORMAT,
            design: model_description::guid(IDENTIFIER, bytes),
            claims: Claims {
                state_feedback: Promise {
                    lyapunov: control.spec.lyapunov,
                    decay: control.spec.decay,
                    dwell: control.dwell,
                },
                gamma: control.gamma.clone(),
                observer: Promise {
                    lyapunov: observer.spec.lyapunov,
                    decay: observer.spec.decay,
                    dwell: observer.dwell,
                },
                running_loop: synthesis.running_loop.clone(),
            },
            proof: Proof {
                state_feedback: control.certificate.clone(),
                observer: observer.certificate.clone(),
                lost: observer.lost.clone(),
            },
        })
    }

    /// Whether this is the certificate that `expected` is.
    ///
    /// # Errors
    /// One sentence that names the first part that differs.
    pub fn agree(&self, expected: &Self) -> Result<(), String> {
        let parts = [
            (self.format == expected.format, "is of another layout"),
            (self.design == expected.design, "belongs to another design"),
            (
                self.claims == expected.claims,
                "claims something else than the design",
            ),
            (
                self.proof == expected.proof,
                "holds another proof than the design",
            ),
        ];
        match parts.iter().find(|(agrees, _)| !agrees) {
            Some((_, what)) => Err(format!("{PATH} {what}: export the design again")),
            None => Ok(()),
        }
    }
}
