//! The controller: estimator, compensation, observer, state feedback and integrator, composed.

mod derivative;

pub use derivative::Change;

use super::compensation::{self, AdditiveControl};
use super::estimator::{EstimatorState, Observation};
use super::integrator;
use super::kernel;
use super::observer::{ObservedMode, ObserverState};
use super::open_loop::OpenLoop;
use super::parameters::{Compensation, ControllerParameters, FeedbackGains, Limits};
use super::repetition::Repetition;
use crate::state::State;
use ftc_plant::OperatingPoint;
use serde::{Deserialize, Serialize};

/// A controller ready to run: immutable, shared by any number of [`ControllerState`]s.
#[derive(Clone, Debug)]
pub struct Controller {
    parameters: ControllerParameters,
    modes: Vec<ObservedMode>,
}

/// What a tick is told.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Number of the tick, counted from the start time.
    pub tick: u64,
    /// Active mode (0-based); an unknown one is taken as the nearest known.
    pub mode: usize,
    /// Measurement `y` (p); a value that is not finite is a fault of that sensor.
    pub measurement: &'a [f64],
    /// Reference `y_ref` (r).
    pub reference: &'a [f64],
    /// Decision thresholds (p).
    pub thresholds: &'a [f64],
    /// Which fault to take out of the loop.
    pub compensate: Compensate<'a>,
}

/// The fault that is taken out of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Compensate<'a> {
    /// None: the controller believes its sensors.
    Nothing,
    /// The estimate `f_hat`.
    Estimate,
    /// The true fault (p), which only a simulation can know: what a perfect estimate would give.
    Known(&'a [f64]),
}

/// Everything that changes while the controller runs. A copy of it is a complete snapshot.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerState {
    /// Mode of the last tick; none before the first.
    mode: Option<usize>,
    /// Which sensors repeat themselves.
    repetition: Repetition,
    /// State observer.
    pub observer: ObserverState,
    /// The model's own run while no reading can be judged.
    open_loop: OpenLoop,
    /// Fault estimator.
    pub estimator: EstimatorState,
    /// Integrator state `Z` and resonators (q).
    pub integral: Vec<f64>,
    /// The printed additive control, where it is chosen.
    additive: Option<AdditiveControl>,
    /// Command `u` (m).
    pub command: Vec<f64>,
    /// Corrected measurement `y_c` (p).
    pub corrected: Vec<f64>,
    /// The command acting over the coming sample (m).
    acting: Vec<f64>,
    /// Deviation scratch (n or m).
    deviation: Vec<f64>,
    /// What bumpless transfer adds to the command (m).
    offset: Vec<f64>,
    /// Samples since the offset was last set.
    since: u32,
    /// What saturation took off the command (m).
    excess: Vec<f64>,
    /// What stands in for a measurement that is not a number (p).
    substitute: Vec<f64>,
    /// A fault of zero (p).
    no_fault: Vec<f64>,
}

crate::state!(ControllerState {
    parts: [
        repetition, observer, open_loop, estimator, integral, additive, command, corrected, acting,
        deviation, offset, excess, substitute, no_fault
    ],
    constants: [],
    counters: [mode, since]
});

impl Controller {
    /// Prepares a controller; the parameters' sizes must agree with the plant's.
    pub fn new(parameters: ControllerParameters) -> Self {
        let modes = parameters
            .plant
            .modes
            .iter()
            .map(|mode| ObservedMode {
                a: mode.a.clone(),
                b: mode.b.clone(),
                c: mode.c.clone(),
                state_offset: mode.state_offset().iter().copied().collect(),
                output_offset: mode.output_offset().iter().copied().collect(),
            })
            .collect();
        Self { parameters, modes }
    }

    /// What this controller was built from.
    pub fn parameters(&self) -> &ControllerParameters {
        &self.parameters
    }

    /// The state before the first tick in `mode` (0-based): at rest at its operating point.
    pub fn initial_state(&self, mode: usize) -> ControllerState {
        let dims = self.parameters.plant.dimensions();
        let tracked = self.parameters.feedback.tracked.len();
        let point = &self.parameters.plant.modes[mode].operating_point;
        ControllerState {
            mode: None,
            repetition: Repetition::new(dims.outputs),
            observer: ObserverState::new(&point.x, dims.outputs),
            open_loop: OpenLoop::new(&point.x, dims.outputs),
            estimator: EstimatorState::new(&self.parameters.estimator, &point.u, dims.outputs),
            integral: vec![0.0; self.parameters.feedback.integral_size()],
            additive: (self.parameters.compensation == Compensation::Additive)
                .then(|| AdditiveControl::new(tracked, dims.inputs)),
            command: point.u.clone(),
            corrected: point.y.clone(),
            acting: point.u.clone(),
            deviation: vec![0.0; dims.states.max(dims.inputs)],
            offset: vec![0.0; dims.inputs],
            since: u32::MAX,
            excess: vec![0.0; dims.inputs],
            substitute: vec![0.0; dims.outputs],
            no_fault: vec![0.0; dims.outputs],
        }
    }

    /// Before a tick: its readings are held ones, since nobody read the sensors anew; that they
    /// repeat accuses nobody.
    pub fn hold_readings(&self, state: &mut ControllerState) {
        state.repetition.hold();
    }

    /// One tick: takes the sample and leaves the command in `state.command`.
    pub fn tick(&self, state: &mut ControllerState, sample: &Sample<'_>) {
        let mode = sample.mode.min(self.modes.len().saturating_sub(1));
        let (Some(model), Some(described)) =
            (self.modes.get(mode), self.parameters.plant.modes.get(mode))
        else {
            return;
        };
        let point = &described.operating_point;
        let left = self.enter(state, mode, sample.thresholds);
        let settings = &self.parameters.estimator;
        state.estimator.observe(
            settings,
            &Observation {
                tick: sample.tick,
                mode,
                u0: &point.u,
                y0: &point.y,
                y: state
                    .repetition
                    .screen(sample.measurement, settings.stuck_after),
                thresholds: sample.thresholds,
            },
        );
        self.correct_measurement(state, model, sample);
        state.observer.correct(
            &self.parameters.observer,
            model,
            left,
            mode,
            &state.corrected,
        );
        if let Some(transfer) = self.parameters.feedback.transfer {
            state.since = state.since.saturating_add(1);
            if left != mode && state.since as usize >= transfer.samples {
                self.transfer(state, mode, point, sample.reference);
            }
        }
        self.command(state, mode, point, sample);
        self.advance(state, model, mode, sample);
    }

    /// Whether a state has the sizes of this controller; one that came as bytes may not.
    pub fn fits(&self, state: &ControllerState) -> bool {
        state.same_shape(&self.initial_state(0))
    }

    /// Notes the mode and returns the one just left.
    fn enter(&self, state: &mut ControllerState, mode: usize, thresholds: &[f64]) -> usize {
        let left = state.mode.replace(mode).unwrap_or(mode);
        if left != mode {
            state
                .estimator
                .mode_entered(&self.parameters.estimator, left, mode, thresholds);
        }
        left
    }

    /// Whether the estimate is what is subtracted from the measurement.
    fn takes_out_the_estimate(&self, sample: &Sample<'_>) -> bool {
        sample.compensate == Compensate::Estimate
            && self.parameters.compensation == Compensation::VirtualSensor
    }

    /// `y_c`: the measurement without the fault; a lost sensor is replaced by what is expected of it.
    fn correct_measurement(
        &self,
        state: &mut ControllerState,
        model: &ObservedMode,
        sample: &Sample<'_>,
    ) {
        let settings = &self.parameters.estimator;
        state.open_loop.output(model, &mut state.substitute);
        state
            .estimator
            .predict_into(settings, &mut state.substitute);
        let estimated = self.takes_out_the_estimate(sample);
        let fault = match sample.compensate {
            Compensate::Known(fault) => fault,
            Compensate::Estimate if estimated => &state.estimator.fault,
            Compensate::Estimate | Compensate::Nothing => &state.no_fault,
        };
        compensation::correct(
            &mut state.corrected,
            readings(&state.repetition, sample),
            fault,
            &state.substitute,
        );
        if estimated {
            let held = state.estimator.held(settings);
            let (thresholds, corrected) = (sample.thresholds, &mut state.corrected);
            let expected = &state.substitute;
            state
                .open_loop
                .overrule(expected, held, thresholds, corrected);
        }
        kernel::bound(&mut state.corrected);
    }

    /// Sets the offset so that the mode just entered repeats the last command.
    fn transfer(
        &self,
        state: &mut ControllerState,
        mode: usize,
        point: &OperatingPoint,
        reference: &[f64],
    ) {
        let Some(gains) = self.parameters.feedback.modes.get(mode) else {
            return;
        };
        kernel::copy(&mut state.excess, &state.command);
        if self.parameters.feedback.latency > 0 {
            kernel::copy(&mut state.acting, &state.command);
        }
        state.offset.fill(0.0);
        self.feedback(state, gains, point, reference);
        kernel::difference(&mut state.offset, &state.excess, &state.command);
        kernel::bound(&mut state.offset);
        kernel::copy(&mut state.command, &state.excess);
        state.since = 0;
    }

    /// The command of this sample, compensated and clamped to the input's limits.
    fn command(
        &self,
        state: &mut ControllerState,
        mode: usize,
        point: &OperatingPoint,
        sample: &Sample<'_>,
    ) {
        let Some(gains) = self.parameters.feedback.modes.get(mode) else {
            return;
        };
        if self.parameters.feedback.latency > 0 {
            kernel::copy(&mut state.acting, &state.command);
        }
        self.feedback(state, gains, point, sample.reference);
        if let Some(additive) = &mut state.additive
            && sample.compensate == Compensate::Estimate
        {
            let fault = &state.estimator.fault;
            additive.add_to(
                &mut state.command,
                &gains.output_feedback,
                &gains.integral,
                fault,
            );
            additive.advance(
                self.parameters.plant.sample_time,
                &self.parameters.feedback.tracked,
                fault,
            );
        }
        saturate(
            &mut state.command,
            &mut state.excess,
            &self.parameters.input_limits,
        );
    }

    /// `u = u0 + K (x_hat - x0) + G Z + N (y_ref - S y0) + V (u_prev - u0) + offset`.
    fn feedback(
        &self,
        state: &mut ControllerState,
        gains: &FeedbackGains,
        point: &OperatingPoint,
        reference: &[f64],
    ) {
        kernel::copy(&mut state.command, &point.u);
        kernel::difference(&mut state.deviation, &state.observer.estimate, &point.x);
        kernel::add_product(&mut state.command, &gains.state_feedback, &state.deviation);
        kernel::add_product(&mut state.command, &gains.integral, &state.integral);
        let targets = reference.iter().zip(&self.parameters.feedback.tracked);
        for (asked, (&target, &row)) in state.deviation.iter_mut().zip(targets) {
            *asked = target - point.y.get(row).copied().unwrap_or(0.0);
        }
        kernel::add_product(&mut state.command, &gains.feedforward, &state.deviation);
        kernel::difference(&mut state.deviation, &state.acting, &point.u);
        kernel::add_product(&mut state.command, &gains.previous_input, &state.deviation);
        kernel::add_scaled(&mut state.command, 1.0, &state.offset);
    }

    /// Moves observer, integrator and input history to the next sample.
    fn advance(
        &self,
        state: &mut ControllerState,
        model: &ObservedMode,
        mode: usize,
        sample: &Sample<'_>,
    ) {
        let feedback = &self.parameters.feedback;
        if feedback.latency == 0 {
            kernel::copy(&mut state.acting, &state.command);
        }
        if let Some(gain) = self.parameters.observer.gains.get(mode) {
            state
                .observer
                .predict(&gain.0, model, &state.acting, &state.corrected);
        }
        let settings = &self.parameters.estimator;
        if state.estimator.leans_on_the_model(settings) {
            state.open_loop.advance(model, &state.acting);
        } else {
            state.open_loop.restart(state.observer.predicted());
        }
        if let Some(gains) = feedback.modes.get(mode) {
            integrator::advance(
                &mut state.integral,
                self.parameters.plant.sample_time,
                sample.reference,
                &state.corrected,
                feedback,
                gains,
                &state.excess,
            );
        }
        if let Some(transfer) = feedback.transfer {
            for offset in &mut state.offset {
                *offset = kernel::bounded(transfer.decay * *offset);
            }
        }
        state.estimator.remember(&state.acting);
    }
}

/// What the sensors say (p): who believes them, or knows their fault, believes a frozen one too.
fn readings<'a>(repetition: &'a Repetition, sample: &Sample<'a>) -> &'a [f64] {
    match sample.compensate {
        Compensate::Estimate => repetition.screened(),
        Compensate::Known(_) | Compensate::Nothing => sample.measurement,
    }
}

/// Clamps each command to its limits and keeps in `excess` what was taken off (clamped - wanted).
fn saturate(command: &mut [f64], excess: &mut [f64], limits: &[Limits]) {
    for ((value, taken), limit) in command.iter_mut().zip(excess).zip(limits) {
        let wanted = kernel::bounded(*value);
        *value = limit.clamp(wanted);
        *taken = *value - wanted;
    }
}
