//! The observer that serves the running loop best.
//!
//! Among the Kalman filters of a range of ratios of noises (and the unknown input observer, where it
//! exists and is not excluded), the one with the quietest command of those whose gain from the
//! disturbance stays within [`TOLERANCE`] of that of a measured state; else the one of the least gain.

use super::gain::Channel;
use super::model::Models;
use super::subject::command_deviation;
use super::{RunningLoop, TOLERANCE};
use crate::observer::{self, Candidate};
use crate::verdict::DesignError;
use crate::{ObserverChoice, ObserverDesign, ObserverSpec, SolverFailure, StateFeedback, parallel};
use ftc_control::parameters::{Observer, ObserverKind};
use ftc_plant::SwitchedPlant;
use ftc_plant::scaling::Scaling;

/// What an observer makes of the loop.
#[derive(Clone, Copy, Debug)]
struct Merit {
    /// Largest gain of a mode over that of a measured state.
    excess: f64,
    /// Largest noise on the command of a mode, per-unit.
    noise: f64,
}

/// Chooses, proves and completes the observer (with gains for lost sensors), and certifies the loop.
///
/// # Errors
/// As [`crate::observer::synthesise`]; or the running loop cannot be certified.
pub(crate) fn choose(
    plant: &SwitchedPlant,
    control: &StateFeedback,
    spec: &ObserverSpec,
    scaling: &Scaling,
) -> Result<(ObserverDesign, RunningLoop), DesignError> {
    let models = Models::new(plant, control);
    let references: Vec<f64> = (0..plant.modes.len())
        .map(|mode| reference(&models, control, mode))
        .collect();
    let candidates = observer::candidates(plant, spec, scaling)?;
    let judged = parallel::each(&candidates, |candidate| {
        merit(&models, spec, &references, &candidate.observer)
    });
    let judged = judged.into_iter().zip(candidates);
    let mut ranked: Vec<(Merit, Candidate)> = judged
        .filter_map(|(judged, candidate)| Some((judged?, candidate)))
        .collect();
    ranked.sort_by(|(a, _), (b, _)| {
        let within = |merit: &Merit| merit.excess <= 1.0 + TOLERANCE;
        match (within(a), within(b)) {
            (true, true) => a.noise.total_cmp(&b.noise),
            (false, false) => a.excess.total_cmp(&b.excess),
            (first, _) => match first {
                true => std::cmp::Ordering::Less,
                false => std::cmp::Ordering::Greater,
            },
        }
    });
    let others: Vec<(Merit, ObserverKind)> = ranked
        .iter()
        .map(|(merit, candidate)| (*merit, candidate.observer.kind))
        .collect();
    let mut failure = DesignError::from(SolverFailure::NumericalTrouble);
    for (_, candidate) in ranked {
        let mut found = match candidate.proved(plant, spec, scaling) {
            Ok(found) => found,
            Err(error) => {
                failure = error;
                continue;
            }
        };
        let Some(judged) = merit(&models, spec, &references, &found.observer) else {
            continue;
        };
        if matches!(spec.kind, ObserverChoice::Auto | ObserverChoice::Kalman) {
            found.observer.note = Some(note(&found, judged, candidate.ratio, &others));
        }
        let complete = observer::with_lost_sensors(plant, found, candidate.ratio);
        if let Some(running) = RunningLoop::of(plant, control, &complete) {
            return Ok((complete, running));
        }
    }
    Err(failure)
}

/// The gain of a measured state in a mode, in the certificate's units.
fn reference(models: &Models, control: &StateFeedback, mode: usize) -> f64 {
    let units = models.units();
    let floor = crate::state_feedback::REJECTION;
    match &control.gamma {
        Some(gamma) => (gamma[mode] * units.disturbance / units.performance).max(floor),
        None => {
            let [a, b, c, d] = &models.measured(mode);
            Channel { a, b, c, d }.norm().max(floor)
        }
    }
}

/// `None` where the loop is not stable with it.
fn merit(
    models: &Models,
    spec: &ObserverSpec,
    references: &[f64],
    observer: &Observer,
) -> Option<Merit> {
    let units = models.units();
    let deviations: Vec<f64> = match spec.noise.len() == units.outputs.len() {
        true => spec
            .noise
            .iter()
            .zip(&units.outputs)
            .map(|(d, unit)| d / unit)
            .collect(),
        false => vec![1.0; units.outputs.len()],
    };
    let mut merit = Merit {
        excess: 0.0,
        noise: 0.0,
    };
    for (mode, reference) in references.iter().enumerate() {
        let model = models.healthy(mode, observer);
        let channel = Channel {
            a: &model.a,
            b: &model.disturbance,
            c: &model.performance,
            d: &model.direct,
        };
        let response = channel.response()?;
        if response.spectral_radius() >= 1.0 {
            return None;
        }
        let commands = command_deviation(&model, &deviations)?;
        let noise = commands.iter().map(|c| c * c).sum::<f64>().sqrt();
        merit.excess = merit.excess.max(response.norm() / reference);
        merit.noise = merit.noise.max(noise);
    }
    Some(merit)
}

/// Why this one.
fn note(found: &ObserverDesign, merit: Merit, ratio: f64, all: &[(Merit, ObserverKind)]) -> String {
    let percent = 100.0 * (merit.excess - 1.0);
    let above = match percent > 0.0 {
        true => format!("{percent:.1} % above that of a measured state"),
        false => "not above that of a measured state".into(),
    };
    let which = match found.observer.kind {
        ObserverKind::Kalman => format!("noise ratio {ratio}"),
        ObserverKind::Uio | ObserverKind::Luenberger => "the disturbance decoupled".into(),
    };
    let other = |kind: ObserverKind| {
        let of = all.iter().filter(|(_, other)| *other == kind);
        of.map(|(merit, _)| merit.noise).reduce(f64::min)
    };
    let compared = match (found.observer.kind, other(ObserverKind::Uio)) {
        (ObserverKind::Kalman, Some(noise)) if merit.noise > 0.0 => format!(
            "; an unknown input observer puts {:.2} times its noise on the command",
            noise / merit.noise
        ),
        _ => String::new(),
    };
    let rule = match merit.excess <= 1.0 + TOLERANCE {
        true => "the quietest command",
        false => "the least gain",
    };
    format!(
        "{rule} of {} observers tried ({which}), its gain {above}{compared}",
        all.len()
    )
}
