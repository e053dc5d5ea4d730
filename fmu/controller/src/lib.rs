//! The controller FMU: a [`Slave`] over [`ftc_control`].
//!
//! The binary is generic; `resources/design.cbor` makes it the controller of one plant. It works
//! when a tick begins: it samples the measurements and publishes the command at once, so a master
//! that steps the controller before the plant adds no delay to the loop.

use fmu_abi::clock::Event;
use fmu_abi::{
    Readiness, Refusal, Slave, Values, nearest_mode, require_finite, resource, selected_mode,
};
use ftc_control::estimator::hypotheses::{Sensors, has};
use ftc_control::{Change, Compensate, Controller, ControllerState, Delay, Sample};
use model_description::{CONTROLLER, DESIGN_FILE, Interface, Role, Span, VariableTable};
use std::path::Path;

fmu_abi::export_fmu!(ControllerFmu);

/// A controller and where its signals lie.
pub struct ControllerFmu {
    controller: Controller,
    table: VariableTable,
    spans: Spans,
    /// The state at rest in each mode, to begin with.
    at_rest: Vec<ControllerState>,
    /// Mode (0-based) a fresh instance rests in.
    first_mode: usize,
}

struct Spans {
    measurement: Span,
    reference: Span,
    /// The Integer and its Real twin.
    mode: [Span; 2],
    ftc_enabled: Span,
    threshold: Span,
    command: Span,
    state_estimate: Span,
    fault_estimate: Span,
    residual: Span,
    fault_flag: Span,
    fault_real: Span,
    suspect: Span,
    model_valid: Span,
    load_estimate: Span,
    actuator_fault: Span,
    /// The Integer and its Real twin.
    mode_estimate: [Span; 2],
    mode_probability: Span,
}

impl Spans {
    fn of(table: &VariableTable) -> Self {
        Self {
            measurement: table.span(Role::Measurement),
            reference: table.span(Role::Reference),
            mode: [Role::Mode, Role::ModeReal].map(|role| table.span(role)),
            ftc_enabled: table.span(Role::FtcEnabled),
            threshold: table.span(Role::Threshold),
            command: table.span(Role::Command),
            state_estimate: table.span(Role::StateEstimate),
            fault_estimate: table.span(Role::FaultEstimate),
            residual: table.span(Role::Residual),
            fault_flag: table.span(Role::FaultFlag),
            fault_real: table.span(Role::FaultFlagReal),
            suspect: table.span(Role::Suspect),
            model_valid: table.span(Role::ModelValid),
            load_estimate: table.span(Role::LoadEstimate),
            actuator_fault: table.span(Role::ActuatorFault),
            mode_estimate: [Role::ModeEstimate, Role::ModeEstimateReal]
                .map(|role| table.span(role)),
            mode_probability: table.span(Role::ModeProbability),
        }
    }
}

impl ControllerFmu {
    /// The mode told (0-based); the nearest, where the inputs have not passed their check. Where none is
    /// told, the one to begin with.
    fn mode(&self, values: &Values) -> usize {
        if self.controller.finds_the_mode() {
            return self.first_mode;
        }
        nearest_mode(values, self.spans.mode, self.at_rest.len())
    }

    /// Refuses references and thresholds that are no finite numbers.
    fn require_numbers(&self, values: &Values) -> Result<(), Refusal> {
        require_finite(&self.table, values, self.spans.reference)?;
        require_finite(&self.table, values, self.spans.threshold)
    }

    fn sample<'a>(&'a self, values: &'a Values, tick: u64) -> Result<Sample<'a>, Refusal> {
        let measurement = values.get(self.spans.measurement);
        let reference = values.get(self.spans.reference);
        let compensate = if values.flag(self.spans.ftc_enabled) {
            Compensate::Estimate
        } else {
            Compensate::Nothing
        };
        self.controller
            .sample(tick, self.mode(values), measurement, reference)
            .and_then(|sample| sample.with_thresholds(values.get(self.spans.threshold)))
            .and_then(|sample| sample.compensating(compensate))
            .map_err(|error| Refusal(error.to_string()))
    }

    fn publish(&self, state: &ControllerState, values: &mut Values) {
        let spans = &self.spans;
        values.set(spans.command, &state.command);
        values.set(spans.state_estimate, &state.observer.estimate);
        values.set(spans.fault_estimate, &state.estimator.fault);
        values.set(spans.residual, &state.estimator.residual);
        for span in [spans.fault_flag, spans.fault_real] {
            let slots = values.get_mut(span).iter_mut();
            for (slot, &flagged) in slots.zip(&state.estimator.flagged) {
                *slot = f64::from(u8::from(flagged));
            }
        }
        let Some(bank) = &state.bank else { return };
        let flag = |set: Sensors, at: usize| f64::from(u8::from(has(set, at)));
        for (at, slot) in values.get_mut(spans.suspect).iter_mut().enumerate() {
            *slot = flag(bank.suspect, at);
        }
        for (at, slot) in values.get_mut(spans.actuator_fault).iter_mut().enumerate() {
            *slot = flag(bank.actuator_fault, at);
        }
        values.set(spans.load_estimate, &bank.load);
        values.set(spans.model_valid, &[f64::from(u8::from(bank.model_valid))]);
        if let Some(mode) = self.controller.found_mode(state) {
            for span in spans.mode_estimate {
                values.set(span, &[(mode + 1) as f64]);
            }
            values.set(spans.mode_probability, &bank.probability);
        }
    }
}

impl Slave for ControllerFmu {
    type State = ControllerState;

    const RESOURCE: &'static str = DESIGN_FILE;

    fn load(resources: &Path, guid: &str) -> Result<Self, Refusal> {
        let bytes = resource::read_verified(resources, DESIGN_FILE, CONTROLLER, guid)?;
        let design =
            model_description::read_controller(&bytes).map_err(|error| error.to_string())?;
        let table = model_description::controller(&Interface::of(&design));
        let modes = 0..design.plant.modes.len();
        let first_mode = design.scenario.mode(0, design.plant.sample_time);
        let controller = Controller::new(design.parameters()).map_err(|error| error.to_string())?;
        Ok(Self {
            at_rest: modes.map(|mode| controller.initial_state(mode)).collect(),
            spans: Spans::of(&table),
            controller,
            table,
            first_mode,
        })
    }

    fn variables(&self) -> &VariableTable {
        &self.table
    }

    fn sample_time(&self) -> f64 {
        self.controller.parameters().sample_time
    }

    fn initial_state(&self) -> ControllerState {
        self.controller.initial_state(self.first_mode)
    }

    fn initialize(&self, state: &mut ControllerState, values: &mut Values) -> Result<(), Refusal> {
        self.require_numbers(values)?;
        if let Some(rest) = self.at_rest.get(self.mode(values)) {
            state.clone_from(rest);
        }
        self.publish(state, values);
        Ok(())
    }

    fn check_inputs(&self, values: &Values) -> Result<Readiness, Refusal> {
        self.require_numbers(values)?;
        if self.controller.finds_the_mode() {
            return Ok(Readiness::Complete);
        }
        let mode = self.spans.mode;
        let selected = selected_mode(&self.table, values, mode, self.at_rest.len())?;
        Ok(selected.map_or(Readiness::ModeUntold(mode[0].first), |_| {
            Readiness::Complete
        }))
    }

    fn begin_tick(
        &self,
        state: &mut ControllerState,
        values: &mut Values,
        k: u64,
        fresh: bool,
    ) -> Result<(), Refusal> {
        if !fresh {
            self.controller.hold_readings(state);
        }
        self.controller.tick(state, &self.sample(values, k)?);
        self.publish(state, values);
        Ok(())
    }

    fn notice(&self, state: &ControllerState) -> Option<&'static str> {
        let latency = self.controller.parameters().feedback.latency;
        let found = self.controller.found_delay(state)?;
        Some(match (latency, found) {
            (0, _) => {
                "the readings fit one sample more of delay in the loop than the design allows for \
                 (latency = 0): step the controller before the plant and hand its command over in \
                 between, or design with latency = 1 for a master that steps both in parallel"
            }
            (_, Delay::Shorter) => {
                "the readings fit one sample less of delay in the loop than the design allows for \
                 (latency = 1): step controller and plant in parallel, or design with latency = 0 \
                 for a master that steps the controller first"
            }
            (_, Delay::Longer) => {
                "the readings fit one sample more of delay in the loop than the design allows for \
                 (latency = 1): hand every signal over at every sample"
            }
        })
    }

    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    /// Before the first tick no output depends on a Real input.
    fn directional_derivative(
        &self,
        trial: &mut ControllerState,
        values: &Values,
        at: Option<Event>,
        seed: &Values,
        response: &mut Values,
    ) -> Result<(), Refusal> {
        // Within a tick, too, the outputs change when the next one begins.
        let k = match at {
            None => return Ok(()),
            Some(Event::Begin(k)) => k,
            Some(Event::End(k)) => k + 1,
        };
        let sample = self.sample(values, k)?;
        let change = Change {
            measurement: seed.get(self.spans.measurement),
            reference: seed.get(self.spans.reference),
        };
        self.controller.differentiate(trial, &sample, change);
        self.publish(trial, response);
        Ok(())
    }

    fn fits(&self, state: &ControllerState) -> bool {
        self.controller.fits(state)
    }
}
