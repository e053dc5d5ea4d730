//! How the outputs follow small changes of the inputs.
//!
//! The mode, the scenario's own signals, a sensor whose reading is lost and a state at its bound do not
//! move. A sensor that is stuck keeps what it read last, and so the change of that.

use super::rectifier;
use super::{External, PlantSimulator, PlantState};
use ftc_control::kernel;
use ftc_plant::TruePlant;
use ftc_plant::scenario::{FaultEvent, FaultKind};

/// Small changes of the plant's inputs.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::exhaustive_structs, reason = "the inputs of the plant")]
pub struct Change<'a> {
    /// Of the command (m).
    pub command: &'a [f64],
    /// Of the external fault (p).
    pub fault: &'a [f64],
    /// Of the external disturbance (s).
    pub disturbance: &'a [f64],
}

impl PlantSimulator {
    /// Runs a tick under input `u` (m) on `trial` and observes its end; then state, outputs,
    /// fault and disturbance become their changes, where the inputs are changed from the
    /// beginning of the tick on: `dx = B du + E dw`, or the variational equation of the
    /// nonlinear plant.
    ///
    /// What else is in `trial` means nothing afterwards: give a copy.
    pub fn differentiate_tick(
        &self,
        trial: &mut PlantState,
        external: &External<'_>,
        u: &[f64],
        change: &Change<'_>,
    ) {
        self.observe(trial, external);
        trial.last.fill(0.0);
        self.differentiate_sensors(trial, external, change, false);
        self.differentiate_state(trial, u, change);
        for (x, &change) in trial.x.iter_mut().zip(&trial.next) {
            *x = kernel::bounded_change(*x, change);
        }
        self.differentiate_observation(trial, external, change);
    }

    /// Turns the state's outputs into their changes where the inputs are changed now, too late
    /// to move the state: what an observation would see.
    pub fn differentiate_outputs(
        &self,
        trial: &mut PlantState,
        external: &External<'_>,
        change: &Change<'_>,
    ) {
        trial.x.fill(0.0);
        trial.last.fill(0.0);
        self.differentiate_observation(trial, external, change);
    }

    /// Advances the state, and leaves its change in the scratch.
    fn differentiate_state(&self, trial: &mut PlantState, u: &[f64], change: &Change<'_>) {
        self.actuate(trial, u);
        self.actuate_change(trial, change.command);
        match &self.true_plant {
            TruePlant::Rectifier(rectifier) => {
                rectifier::differentiate_rectifier(
                    rectifier,
                    trial.mode,
                    &trial.x,
                    &rectifier::Held {
                        input: [&trial.departed.applied, &trial.departed.change],
                        disturbance: [&trial.disturbance, change.disturbance],
                    },
                    self.plant.sample_time,
                    &mut trial.next,
                );
                let _ = self.advance(trial, u);
            }
            TruePlant::AsDesigned | TruePlant::Linear { .. } | TruePlant::Deviating { .. } => {
                let _ = self.advance(trial, u);
                trial.next.fill(0.0);
                let Some(mode) = self.modes.get(trial.mode) else {
                    return;
                };
                kernel::add_product(&mut trial.next, &mode.b, &trial.departed.change);
                kernel::add_product(&mut trial.next, &mode.e, change.disturbance);
            }
        }
    }

    /// The changes of all outputs, from that of the state.
    fn differentiate_observation(
        &self,
        trial: &mut PlantState,
        external: &External<'_>,
        change: &Change<'_>,
    ) {
        trial.mode = self.active_mode(external, trial.tick);
        self.differentiate_sensors(trial, external, change, true);
        trial.reference.fill(0.0);
        kernel::copy(&mut trial.disturbance, change.disturbance);
    }

    /// `dy_true = C dx + F dw`, and what the sensors make of it; `dx` counts if the state `moved`.
    fn differentiate_sensors(
        &self,
        trial: &mut PlantState,
        external: &External<'_>,
        change: &Change<'_>,
        moved: bool,
    ) {
        trial.y_true.fill(0.0);
        let Some(mode) = self.modes.get(trial.mode) else {
            return;
        };
        if moved {
            kernel::add_product(&mut trial.y_true, &mode.c, &trial.x);
        }
        kernel::add_product(&mut trial.y_true, &mode.f, change.disturbance);
        let (tick, events) = (trial.tick, external.mode.is_none());
        // What a late sensor reads was on its way before the inputs changed.
        let late = trial.departed.is_late();
        let read = trial
            .y
            .iter_mut()
            .zip(&mut trial.fault)
            .zip(&mut trial.last);
        let clean = trial.y_true.iter().zip(change.fault);
        for (sensor, (((y, fault), last), (&healthy, &added))) in read.zip(clean).enumerate() {
            let active = self.acting(sensor, tick, events);
            let healthy = if late { 0.0 } else { healthy };
            (*y, *fault) = differentiate_sensor(active, healthy, added, last);
        }
    }
}

/// The same steps as a reading takes, for its change and that of its fault.
fn differentiate_sensor<'a>(
    events: impl Iterator<Item = &'a FaultEvent>,
    healthy: f64,
    added: f64,
    last: &mut f64,
) -> (f64, f64) {
    let mut reading = healthy + added;
    let (mut faulty, mut lost) = (false, false);
    for event in events {
        faulty = true;
        match event.kind {
            FaultKind::Bias { .. } | FaultKind::Drift { .. } | FaultKind::Intermittent { .. } => {}
            FaultKind::GainLoss { loss } => reading *= 1.0 - loss,
            FaultKind::Stuck => (reading, lost) = (*last, false),
            FaultKind::Dropout => lost = true,
        }
    }
    if lost {
        return (0.0, 0.0);
    }
    if !faulty {
        *last = reading;
    }
    (reading, reading - healthy)
}
