//! The controller FMU: a [`Slave`] over [`ftc_control`].
//!
//! The binary is generic; `resources/design.json` makes it the controller of one plant. It works
//! when a tick begins: it samples the measurements and publishes the command at once, so a master
//! that steps the controller before the plant adds no delay to the loop.

use fmu_abi::clock::Event;
use fmu_abi::{
    Readiness, Refusal, Slave, Values, nearest_mode, require_finite, resource, selected_mode,
};
use ftc_control::{Change, Compensate, Controller, ControllerState, Sample};
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
        }
    }
}

impl ControllerFmu {
    /// The active mode (0-based); the nearest, where the inputs have not passed their check.
    fn mode(&self, values: &Values) -> usize {
        nearest_mode(values, self.spans.mode, self.at_rest.len())
    }

    /// Refuses references and thresholds that are no finite numbers.
    fn require_numbers(&self, values: &Values) -> Result<(), Refusal> {
        require_finite(&self.table, values, self.spans.reference)?;
        require_finite(&self.table, values, self.spans.threshold)
    }

    fn sample<'a>(&self, values: &'a Values, tick: u64) -> Sample<'a> {
        Sample {
            tick,
            mode: self.mode(values),
            measurement: values.get(self.spans.measurement),
            reference: values.get(self.spans.reference),
            thresholds: values.get(self.spans.threshold),
            compensate: if values.flag(self.spans.ftc_enabled) {
                Compensate::Estimate
            } else {
                Compensate::Nothing
            },
        }
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
    }
}

impl Slave for ControllerFmu {
    type State = ControllerState;

    const RESOURCE: &'static str = DESIGN_FILE;

    fn load(resources: &Path, guid: &str) -> Result<Self, String> {
        let bytes = resource::read_verified(resources, DESIGN_FILE, CONTROLLER, guid)?;
        let design = model_description::read_design(&bytes)?;
        let table = model_description::controller(&Interface::from(&design));
        let modes = 0..design.controller.plant.modes.len();
        let first_mode = design.scenario.mode(0, design.controller.plant.sample_time);
        let controller = Controller::new(design.controller);
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
        self.controller.parameters().plant.sample_time
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
        self.controller.tick(state, &self.sample(values, k));
        self.publish(state, values);
        Ok(())
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
        let sample = self.sample(values, k);
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
