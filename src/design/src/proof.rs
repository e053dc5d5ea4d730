//! What proves a design, beside the numbers that the controller runs on.
//!
//! Gains, observer, tracked outputs, latency and resonators stand in the record's controller and nowhere
//! else; [`Design::synthesis`](crate::Design::synthesis) puts both together again, and that is what is proved.

use super::{
    ControlCertificate, ControlSpec, DwellTime, LostCertificate, Lyapunov, ModeGains, Objective,
    ObserverCertificate, ObserverDesign, ObserverSpec, RunningLoop, StateFeedback, Synthesis,
};
use ftc_control::parameters::{self, FeedbackGains};
use ftc_record::dense;
use serde::{Deserialize, Serialize};

/// Claims of a design and what proves them, together with plant and controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Proof {
    /// Of the state feedback.
    pub state_feedback: ControlProof,
    /// Of the observer.
    pub observer: ObserverProof,
    /// Of both together, as the controller runs them.
    pub running_loop: RunningLoop,
}

/// A [`StateFeedback`] without the controller's numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ControlProof {
    /// As [`ControlSpec::lyapunov`].
    pub lyapunov: Lyapunov,
    /// As [`ControlSpec::decay`].
    pub decay: f64,
    /// As [`ControlSpec::objective`].
    pub objective: Objective,
    /// As [`ControlSpec::output_weight`] (r).
    pub output_weight: Vec<f64>,
    /// As [`ControlSpec::integral_weight`] (r).
    pub integral_weight: Vec<f64>,
    /// As [`ControlSpec::input_weight`] (m).
    pub input_weight: Vec<f64>,
    /// As [`StateFeedback::gamma`].
    pub gamma: Option<Vec<f64>>,
    /// As [`StateFeedback::optimum`].
    pub optimum: Option<Vec<f64>>,
    /// As [`StateFeedback::spectral_radius`].
    pub spectral_radius: Vec<f64>,
    /// As [`StateFeedback::dwell`].
    pub dwell: Option<DwellTime>,
    /// As [`StateFeedback::certificate`].
    pub certificate: ControlCertificate,
}

/// An [`ObserverDesign`] without the observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ObserverProof {
    /// As [`ObserverDesign::spec`].
    pub spec: ObserverSpec,
    /// As [`ObserverDesign::spectral_radius`].
    pub spectral_radius: Vec<f64>,
    /// As [`ObserverDesign::dwell`].
    pub dwell: Option<DwellTime>,
    /// As [`ObserverDesign::certificate`].
    pub certificate: ObserverCertificate,
    /// As [`ObserverDesign::lost`].
    pub lost: Option<LostCertificate>,
}

impl From<Synthesis> for Proof {
    /// The proof alone; the controller made of the same synthesis holds the rest.
    fn from(synthesis: Synthesis) -> Self {
        let Synthesis {
            state_feedback: control,
            observer,
            running_loop,
        } = synthesis;
        Self {
            state_feedback: ControlProof {
                lyapunov: control.spec.lyapunov,
                decay: control.spec.decay,
                objective: control.spec.objective,
                output_weight: control.spec.output_weight,
                integral_weight: control.spec.integral_weight,
                input_weight: control.spec.input_weight,
                gamma: control.gamma,
                optimum: control.optimum,
                spectral_radius: control.spectral_radius,
                dwell: control.dwell,
                certificate: control.certificate,
            },
            observer: ObserverProof {
                spec: observer.spec,
                spectral_radius: observer.spectral_radius,
                dwell: observer.dwell,
                certificate: observer.certificate,
                lost: observer.lost,
            },
            running_loop,
        }
    }
}

impl Proof {
    /// Samples for longer than which modes must last on average, for feedback and observer both; none where
    /// modes may change at any sample.
    pub fn dwell(&self) -> Option<f64> {
        let dwell = [self.state_feedback.dwell, self.observer.dwell];
        let samples = dwell.iter().flatten().map(|dwell| dwell.samples);
        samples.reduce(f64::max)
    }

    /// Samples that each mode must last for where bumpless transfer needs that: as transfer needs, and longer
    /// than [`dwell`](Self::dwell).
    pub fn shortest_mode(&self) -> Option<usize> {
        let transfer = self.running_loop.transfer.as_ref()?;
        // The cast saturates.
        let longer = self
            .dwell()
            .map_or(0, |samples| samples.floor() as usize + 1);
        transfer
            .needs_dwell()
            .then(|| transfer.samples().max(longer))
    }

    /// What is proved: these claims of this controller.
    pub(crate) fn of(
        self,
        feedback: &parameters::StateFeedback,
        observer: &parameters::Observer,
    ) -> Synthesis {
        let control = self.state_feedback;
        let gains = |gains: &FeedbackGains| ModeGains {
            state_feedback: dense(&gains.state_feedback),
            integral: dense(&gains.integral),
            previous_input: dense(&gains.previous_input),
        };
        Synthesis {
            state_feedback: StateFeedback {
                spec: ControlSpec {
                    tracked: feedback.tracked.clone(),
                    latency: feedback.latency,
                    lyapunov: control.lyapunov,
                    decay: control.decay,
                    objective: control.objective,
                    resonators: feedback.resonators.clone(),
                    output_weight: control.output_weight,
                    integral_weight: control.integral_weight,
                    input_weight: control.input_weight,
                },
                modes: feedback.modes.iter().map(gains).collect(),
                gamma: control.gamma,
                optimum: control.optimum,
                spectral_radius: control.spectral_radius,
                dwell: control.dwell,
                certificate: control.certificate,
            },
            observer: ObserverDesign {
                spec: self.observer.spec,
                observer: observer.clone(),
                spectral_radius: self.observer.spectral_radius,
                dwell: self.observer.dwell,
                certificate: self.observer.certificate,
                lost: self.observer.lost,
            },
            running_loop: self.running_loop,
        }
    }
}
