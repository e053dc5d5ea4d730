//! The plant FMU: a [`Slave`] over [`ftc_simulate::PlantSimulator`], to try the controller against.
//!
//! It latches its inputs when a tick begins and publishes what they lead to when the tick ends,
//! so its outputs at a communication point are those of that very instant, whatever the step.
//! With `scenario_enabled` it also runs the design's experiment: mode schedule, references,
//! faults, disturbance and noise.

use fmu_abi::clock::Event;
use fmu_abi::{
    Readiness, Refusal, Slave, Values, nearest_mode, require_finite, resource, selected_mode,
};
use ftc_simulate::integrate::Stalled;
use ftc_simulate::plant::{Change, External, Injected, InjectedKind};
use ftc_simulate::{PlantSimulator, PlantState};
use model_description::{DESIGN_FILE, Interface, PLANT, Role, Span, VariableTable};
use std::path::Path;

fmu_abi::export_fmu!(PlantFmu);

/// A plant and where its signals lie.
pub struct PlantFmu {
    simulator: PlantSimulator,
    /// The state at rest in each mode, to begin with.
    at_rest: Vec<PlantState>,
    table: VariableTable,
    spans: Spans,
}

struct Spans {
    command: Span,
    external_fault: Span,
    external_disturbance: Span,
    /// The Integer and its Real twin.
    external_mode: [Span; 2],
    measurement: Span,
    true_output: Span,
    state: Span,
    reference: Span,
    mode: Span,
    mode_real: Span,
    fault: Span,
    disturbance: Span,
    scenario_enabled: Span,
    noise_enabled: Span,
    /// Kind, size, begin and end of injected faults.
    injected: [Span; 4],
}

impl Spans {
    fn of(table: &VariableTable) -> Self {
        Self {
            command: table.span(Role::Command),
            external_fault: table.span(Role::ExternalFault),
            external_disturbance: table.span(Role::ExternalDisturbance),
            external_mode: [Role::ExternalMode, Role::ExternalModeReal]
                .map(|role| table.span(role)),
            measurement: table.span(Role::Measurement),
            true_output: table.span(Role::TrueOutput),
            state: table.span(Role::State),
            reference: table.span(Role::Reference),
            mode: table.span(Role::Mode),
            mode_real: table.span(Role::ModeReal),
            fault: table.span(Role::Fault),
            disturbance: table.span(Role::Disturbance),
            scenario_enabled: table.span(Role::ScenarioEnabled),
            noise_enabled: table.span(Role::NoiseEnabled),
            injected: [
                Role::InjectedKind,
                Role::InjectedSize,
                Role::InjectedFrom,
                Role::InjectedUntil,
            ]
            .map(|role| table.span(role)),
        }
    }
}

impl PlantFmu {
    /// The mode (0-based) from outside while the scenario is off; the nearest, where the inputs
    /// have not passed their check.
    fn external_mode(&self, values: &Values) -> Option<usize> {
        let spans = &self.spans;
        let own = values.flag(spans.scenario_enabled);
        (!own).then(|| nearest_mode(values, spans.external_mode, self.at_rest.len()))
    }

    fn external<'a>(&self, values: &'a Values) -> External<'a> {
        let spans = &self.spans;
        let fault = values.get(spans.external_fault);
        External::new(fault, values.get(spans.external_disturbance))
            .in_mode(self.external_mode(values))
            .with_noise(values.flag(spans.noise_enabled))
    }

    fn injected<'a>(&self, values: &'a Values) -> Injected<'a> {
        let spans = self.spans.injected;
        let [kind, size, from, until] = spans.map(|span| values.get(span));
        Injected {
            kind,
            size,
            from,
            until,
        }
    }

    /// Observes the present tick, faults from outside included.
    fn observe(&self, state: &mut PlantState, values: &mut Values) {
        self.simulator.observe(state, &self.external(values));
        let kinds = values.get(self.spans.injected[0]);
        if kinds.iter().all(|&kind| kind == 0.0) {
            self.simulator.inject(state, &Injected::default());
        } else {
            self.simulator.inject(state, &self.injected(values));
        }
        values.settle();
    }

    /// Refuses commands and disturbances that are no finite numbers.
    #[inline]
    fn require_numbers(&self, values: &Values) -> Result<(), Refusal> {
        require_finite(&self.table, values, self.spans.command)?;
        if values.are_settled() {
            return Ok(());
        }
        self.require_other_numbers(values)
    }

    #[inline(never)]
    fn require_other_numbers(&self, values: &Values) -> Result<(), Refusal> {
        require_finite(&self.table, values, self.spans.external_disturbance)?;
        for span in self.spans.injected {
            require_finite(&self.table, values, span)?;
        }
        let mut kinds = values.get(self.spans.injected[0]).iter().enumerate();
        let last = f64::from(InjectedKind::LAST);
        match kinds.find(|(_, kind)| !(0.0..=last).contains(*kind)) {
            Some((at, kind)) => Err(Refusal::from(format!(
                "inject_kind[{}] is {kind}: give a kind from 0 to {last}",
                at + 1
            ))),
            None => Ok(()),
        }
    }

    /// Observes the present tick and publishes every output.
    fn publish(&self, state: &mut PlantState, values: &mut Values) {
        self.observe(state, values);
        let spans = &self.spans;
        values.set(spans.measurement, &state.y);
        values.set(spans.true_output, &state.y_true);
        values.set(spans.state, &state.x);
        values.set(spans.reference, &state.reference);
        values.set(spans.fault, &state.fault);
        values.set(spans.disturbance, &state.disturbance);
        let number = [(state.told + 1) as f64];
        values.set(spans.mode, &number);
        values.set(spans.mode_real, &number);
    }
}

impl Slave for PlantFmu {
    type State = PlantState;

    const RESOURCE: &'static str = DESIGN_FILE;

    fn load(resources: &Path, guid: &str) -> Result<Self, Refusal> {
        let bytes = resource::read_verified(resources, DESIGN_FILE, PLANT, guid)?;
        let design = model_description::read_design(&bytes).map_err(|error| error.to_string())?;
        let table = model_description::plant(&Interface::of(&design));
        let plant = design.plant;
        let modes = 0..plant.modes.len();
        let simulator = PlantSimulator::with_true_plant(plant, design.true_plant, design.scenario);
        Ok(Self {
            at_rest: modes.map(|mode| simulator.initial_state_in(mode)).collect(),
            spans: Spans::of(&table),
            simulator,
            table,
        })
    }

    fn variables(&self) -> &VariableTable {
        &self.table
    }

    fn sample_time(&self) -> f64 {
        self.simulator.plant().sample_time
    }

    fn initial_state(&self) -> PlantState {
        self.simulator.initial_state()
    }

    fn is_latched(&self, reference: u32) -> bool {
        self.spans.command.range().contains(&(reference as usize))
    }

    fn initialize(&self, state: &mut PlantState, values: &mut Values) -> Result<(), Refusal> {
        self.require_numbers(values)?;
        let external = self.external_mode(values);
        let mode = external.unwrap_or_else(|| self.simulator.first_mode());
        if let Some(rest) = self.at_rest.get(mode) {
            state.clone_from(rest);
        }
        self.publish(state, values);
        Ok(())
    }

    fn check_inputs(&self, values: &Values) -> Result<Readiness, Refusal> {
        self.require_numbers(values)?;
        let spans = &self.spans;
        if values.flag(spans.scenario_enabled) {
            return Ok(Readiness::Complete);
        }
        let mode = spans.external_mode;
        let selected = selected_mode(&self.table, values, mode, self.at_rest.len())?;
        Ok(selected.map_or(Readiness::ModeUntold(mode[0].first), |_| {
            Readiness::Complete
        }))
    }

    /// The disturbance and the mode reach the outputs without delay.
    fn check_late_inputs(&self, values: &Values) -> Result<(), Refusal> {
        self.check_inputs(values).map(drop)
    }

    fn begin_tick(
        &self,
        state: &mut PlantState,
        values: &mut Values,
        _k: u64,
        _fresh: bool,
    ) -> Result<(), Refusal> {
        // The end of the tick before it has observed this one already.
        if !values.are_settled() {
            self.observe(state, values);
        }
        let command = values.get(self.spans.command);
        self.simulator.advance(state, command).map_err(|Stalled| {
            Refusal::from(
                "the plant's equations cannot be integrated under this command: give a smaller u",
            )
        })
    }

    fn end_tick(
        &self,
        state: &mut PlantState,
        values: &mut Values,
        _k: u64,
    ) -> Result<(), Refusal> {
        self.publish(state, values);
        Ok(())
    }

    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    /// Once a tick has begun, the command comes too late for what is published at its end.
    fn directional_derivative(
        &self,
        trial: &mut PlantState,
        values: &Values,
        at: Option<Event>,
        seed: &Values,
        response: &mut Values,
    ) -> Result<(), Refusal> {
        let spans = &self.spans;
        let external = self.external(values);
        let change = Change {
            command: seed.get(spans.command),
            fault: seed.get(spans.external_fault),
            disturbance: seed.get(spans.external_disturbance),
        };
        if let Some(Event::Begin(_)) = at {
            let command = values.get(spans.command);
            self.simulator
                .differentiate_tick(trial, &external, command, &change);
        } else {
            self.simulator
                .differentiate_outputs(trial, &external, &change);
        }
        self.simulator.inject_change(trial, &self.injected(values));
        response.set(spans.measurement, &trial.y);
        response.set(spans.true_output, &trial.y_true);
        response.set(spans.state, &trial.x);
        response.set(spans.fault, &trial.fault);
        response.set(spans.disturbance, &trial.disturbance);
        Ok(())
    }

    fn fits(&self, state: &PlantState) -> bool {
        self.simulator.fits(state)
    }
}
