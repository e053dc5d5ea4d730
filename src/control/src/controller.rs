//! The controller: estimator, compensation, observer, state feedback and integrator, composed.

mod derivative;

use alloc::vec;
use alloc::vec::Vec;
pub use derivative::Change;

use super::compensation::{self, AdditiveControl};
use super::delay::{Commands, Delay, DelayWatch};
use super::estimator::hypotheses::{Bank, BankState};
use super::estimator::{EstimatorState, Observation};
use super::integrator;
use super::kernel;
use super::observer::{ObservedMode, ObserverState};
use super::open_loop::OpenLoop;
use super::parameters::{
    Compensation, ControllerParameters, EstimatorMethod, FeedbackGains, Limits, ModeModel,
};
use super::repetition::Repetition;
use crate::check::{self, Sizes};
use crate::error::{ControllerError, SampleError};
use crate::state::State;
use serde::{Deserialize, Serialize};

/// A controller ready to run: immutable, shared by any number of [`ControllerState`]s.
#[derive(Clone, Debug)]
pub struct Controller {
    parameters: ControllerParameters,
    modes: Vec<ObservedMode>,
    sizes: Sizes,
    /// The state-based estimator, where it is chosen.
    bank: Option<Bank>,
}

/// What a tick is told; made by [`Controller::sample`], which checks its sizes.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Number of the tick, counted from the start time.
    tick: u64,
    /// Active mode (0-based).
    mode: usize,
    /// Measurement `y` (p); a value that is not finite is a fault of that sensor.
    measurement: &'a [f64],
    /// Reference `y_ref` (r).
    reference: &'a [f64],
    /// Decision thresholds (p).
    thresholds: &'a [f64],
    /// Which fault to take out of the loop.
    compensate: Compensate<'a>,
    /// Whether `mode` holds although the design finds the mode from the readings.
    telling: bool,
}

impl<'a> Sample<'a> {
    /// The same sample judged by other thresholds (p, in output units).
    ///
    /// # Errors
    /// There is not one threshold per sensor.
    pub fn with_thresholds(self, thresholds: &'a [f64]) -> Result<Self, SampleError> {
        has_length("thresholds", thresholds, self.measurement.len())?;
        Ok(Self { thresholds, ..self })
    }

    /// The same sample with another fault taken out of the loop.
    ///
    /// # Errors
    /// A known fault has not one entry per sensor.
    pub fn compensating(self, compensate: Compensate<'a>) -> Result<Self, SampleError> {
        if let Compensate::Known(fault) = compensate {
            has_length("fault", fault, self.measurement.len())?;
        }
        Ok(Self { compensate, ..self })
    }

    /// The same sample, with its mode told to a controller that would find it from the readings.
    pub fn telling_the_mode(self) -> Self {
        Self {
            telling: true,
            ..self
        }
    }
}

fn has_length(signal: &'static str, values: &[f64], needed: usize) -> Result<(), SampleError> {
    match values.len() == needed {
        true => Ok(()),
        false => Err(SampleError::Length {
            signal,
            found: values.len(),
            needed,
        }),
    }
}

/// The fault that is taken out of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    clippy::exhaustive_enums,
    reason = "nothing, what is estimated, or what is known"
)]
pub enum Compensate<'a> {
    /// None: the controller uses the readings as they are.
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
    /// Whether the loop has the delay of the design.
    delay: DelayWatch,
    /// The model in open loop while no reading can be judged.
    open_loop: OpenLoop,
    /// Fault estimator.
    pub estimator: EstimatorState,
    /// The state-based estimator, where it is chosen.
    pub bank: Option<BankState>,
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
        repetition, observer, delay, open_loop, estimator, bank, integral, additive, command,
        corrected, acting, deviation, offset, excess, substitute, no_fault
    ],
    constants: [],
    counters: [mode, since]
});

impl Controller {
    /// Prepares a controller.
    ///
    /// # Errors
    /// The first field whose size does not agree with the others, or whose numbers are not finite.
    pub fn new(parameters: ControllerParameters) -> Result<Self, ControllerError> {
        let sizes = check::check(&parameters)?;
        let modes = parameters.modes.iter().map(ObservedMode::new).collect();
        let bank = match (
            parameters.estimator.method,
            &parameters.estimator.hypotheses,
        ) {
            (EstimatorMethod::Observer, Some(settings)) => {
                let thresholds = &parameters.estimator.thresholds;
                let tuning = parameters.estimator.tuning.bank;
                Some(Bank::new(
                    &parameters.modes,
                    parameters.sample_time,
                    settings,
                    tuning,
                    thresholds,
                ))
            }
            _ => None,
        };
        Ok(Self {
            parameters,
            modes,
            bank,
            sizes,
        })
    }

    /// What a tick is told: its number `tick` counted from the start time, the active `mode` (0-based;
    /// of no account where the design [finds it](Self::finds_the_mode)), the `measurement` (p; a value
    /// that is not finite is a fault of that sensor) and the `reference` (r). Judged by the design's
    /// thresholds, and corrected by the fault estimate, unless [`Sample::with_thresholds`] and
    /// [`Sample::compensating`] say otherwise.
    ///
    /// # Errors
    /// A vector of another length, or a mode that does not exist.
    pub fn sample<'a>(
        &'a self,
        tick: u64,
        mode: usize,
        measurement: &'a [f64],
        reference: &'a [f64],
    ) -> Result<Sample<'a>, SampleError> {
        let Sizes { outputs, modes, .. } = self.sizes;
        has_length("measurement", measurement, outputs)?;
        has_length(
            "reference",
            reference,
            self.parameters.feedback.tracked.len(),
        )?;
        if mode >= modes {
            return Err(SampleError::Mode { mode, modes });
        }
        Ok(Sample {
            tick,
            mode,
            measurement,
            reference,
            thresholds: &self.parameters.estimator.thresholds,
            compensate: Compensate::Estimate,
            telling: false,
        })
    }

    /// What this controller was built from.
    pub fn parameters(&self) -> &ControllerParameters {
        &self.parameters
    }

    /// The state before the first tick in `mode` (0-based): at rest at its operating point.
    ///
    /// # Panics
    /// There is no such mode.
    pub fn initial_state(&self, mode: usize) -> ControllerState {
        let dims = self.sizes;
        let tracked = self.parameters.feedback.tracked.len();
        let point = &self.parameters.modes[mode];
        ControllerState {
            mode: None,
            repetition: Repetition::new(dims.outputs),
            observer: ObserverState::new(&point.x0, dims.outputs),
            delay: DelayWatch::new(
                &point.x0,
                &point.u0,
                dims.outputs,
                self.parameters.feedback.latency,
            ),
            open_loop: OpenLoop::new(&point.x0, dims.outputs),
            estimator: EstimatorState::new(&self.parameters.estimator, &point.u0, dims.outputs),
            bank: self.bank.as_ref().map(|bank| bank.start(mode)),
            integral: vec![0.0; self.parameters.feedback.integral_size()],
            additive: (self.parameters.compensation == Compensation::Additive)
                .then(|| AdditiveControl::new(tracked, dims.inputs)),
            command: point.u0.clone(),
            corrected: point.y0.clone(),
            acting: point.u0.clone(),
            deviation: vec![0.0; dims.states.max(dims.inputs)],
            offset: vec![0.0; dims.inputs],
            since: u32::MAX,
            excess: vec![0.0; dims.inputs],
            substitute: vec![0.0; dims.outputs],
            no_fault: vec![0.0; dims.outputs],
        }
    }

    /// Before a tick: marks its readings as held, the sensors were not sampled again; their repetition
    /// is then no sign of a frozen sensor.
    pub fn hold_readings(&self, state: &mut ControllerState) {
        state.repetition.hold();
    }

    /// Whether the mode is found from the readings, not told.
    pub fn finds_the_mode(&self) -> bool {
        self.parameters.estimator.finds_the_mode()
    }

    /// The mode (0-based) found from the readings, if that is what the controller does.
    pub fn found_mode(&self, state: &ControllerState) -> Option<usize> {
        let found = state.bank.as_ref().map(|bank| bank.mode().0);
        found.filter(|_| self.finds_the_mode())
    }

    /// One tick: takes the sample and leaves the command in `state.command`. State and sample are this controller's
    /// ([`Controller::initial_state`], [`Controller::sample`]); of another's, only what both have is used.
    pub fn tick(&self, state: &mut ControllerState, sample: &Sample<'_>) {
        self.run(state, sample);
    }

    /// One tick; returns the modes just left and entered, the same where there was no switch.
    fn run(&self, state: &mut ControllerState, sample: &Sample<'_>) -> [usize; 2] {
        let settings = &self.parameters.estimator;
        let told = sample.mode.min(self.modes.len().saturating_sub(1));
        let readings = state
            .repetition
            .screen(sample.measurement, settings.stuck_after);
        let mut mode = told;
        let mut moved_by = None;
        if let (Some(bank), Some(judged)) = (&self.bank, &mut state.bank) {
            bank.observe(judged, told, readings, sample.thresholds);
            // Every change of the command then looks like a fault.
            if state.delay.found().is_some() {
                judged.accept_readings(readings);
            }
            state.estimator.adopt(settings, judged, readings);
            if self.finds_the_mode() && !sample.telling {
                let (found, before) = judged.mode();
                (mode, moved_by) = (found, Some(before));
            }
        }
        let (Some(model), Some(point)) = (self.modes.get(mode), self.parameters.modes.get(mode))
        else {
            return [told; 2];
        };
        let left = self.enter(state, mode, moved_by, sample.thresholds);
        if self.bank.is_none() {
            let readings = state.repetition.screened();
            let seen = Observation {
                tick: sample.tick,
                mode,
                u0: &point.u0,
                y0: &point.y0,
                y: readings,
                thresholds: sample.thresholds,
            };
            state.estimator.observe(settings, &seen);
        }
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
        self.watch_delay(state, model, (left, mode), sample.measurement);
        [left, mode]
    }

    /// The delay that the readings fit, if it is another than the design's.
    pub fn found_delay(&self, state: &ControllerState) -> Option<Delay> {
        state.delay.found()
    }

    /// Runs the observer under other delays of the command.
    fn watch_delay(
        &self,
        state: &mut ControllerState,
        model: &ObservedMode,
        modes: (usize, usize),
        y: &[f64],
    ) {
        let observer = &self.parameters.observer;
        let Some(gain) = observer.gains.get(modes.1) else {
            return;
        };
        let commands = Commands {
            designed: &state.acting,
            newest: &state.command,
        };
        let tuning = &self.parameters.estimator.tuning.delay;
        state
            .delay
            .watch((observer, gain), model, modes, y, commands, tuning);
    }

    /// Whether a state has the sizes of this controller; one that came as bytes may not.
    pub fn fits(&self, state: &ControllerState) -> bool {
        let consistent = state.bank.as_ref().is_none_or(BankState::is_consistent);
        consistent && state.same_shape(&self.initial_state(0))
    }

    /// Notes the mode and returns the one just left. A switch that was found a sample late, the plant
    /// having been `moved_by` the mode entered, is made up for: the observer predicts once more.
    fn enter(
        &self,
        state: &mut ControllerState,
        mode: usize,
        moved_by: Option<usize>,
        thresholds: &[f64],
    ) -> usize {
        let first = state.mode.is_none();
        let left = state.mode.replace(mode).unwrap_or(mode);
        if let (true, Some(_), Some(point)) = (first, moved_by, self.parameters.modes.get(mode)) {
            state.observer.rest_at(&point.x0);
        }
        if left == mode {
            return left;
        }
        state
            .estimator
            .mode_entered(&self.parameters.estimator, left, mode, thresholds);
        let late = moved_by == Some(mode);
        let gain = self.parameters.observer.gains.get(mode);
        let (true, Some(gain), Some(model)) = (late, gain, self.modes.get(mode)) else {
            return left;
        };
        let corrected = &state.corrected;
        state
            .observer
            .predict(gain, model, &state.acting, corrected);
        mode
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
            let most = settings.tuning.database.open_loop_thresholds;
            let (thresholds, corrected) = ((most, sample.thresholds), &mut state.corrected);
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
        point: &ModeModel,
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
        point: &ModeModel,
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
                self.parameters.sample_time,
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
        point: &ModeModel,
        reference: &[f64],
    ) {
        kernel::copy(&mut state.command, &point.u0);
        kernel::difference(&mut state.deviation, &state.observer.estimate, &point.x0);
        kernel::add_product(&mut state.command, &gains.state_feedback, &state.deviation);
        kernel::add_product(&mut state.command, &gains.integral, &state.integral);
        let targets = reference.iter().zip(&self.parameters.feedback.tracked);
        for (asked, (&target, &row)) in state.deviation.iter_mut().zip(targets) {
            *asked = target - point.y0.get(row).copied().unwrap_or(0.0);
        }
        kernel::add_product(&mut state.command, &gains.feedforward, &state.deviation);
        kernel::difference(&mut state.deviation, &state.acting, &point.u0);
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
                .predict(gain, model, &state.acting, &state.corrected);
        }
        let settings = &self.parameters.estimator;
        if state.estimator.needs_open_loop(settings) {
            state.open_loop.advance(model, &state.acting);
        } else {
            state.open_loop.restart(state.observer.predicted());
        }
        if let Some(gains) = feedback.modes.get(mode) {
            integrator::advance(
                &mut state.integral,
                self.parameters.sample_time,
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
        if let (Some(bank), Some(judged)) = (&self.bank, &mut state.bank) {
            bank.advance(judged, &state.acting);
        } else {
            state.estimator.remember(&state.acting);
        }
    }
}

/// The readings used (p): frozen ones are screened only where faults are estimated.
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
