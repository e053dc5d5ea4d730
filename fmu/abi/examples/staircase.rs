//! The slave that proves the interface: it adds up its inputs, once per tick.
//!
//! `late` is published when a tick ends, as a plant does it; `early` when it begins, as a
//! controller does it. Two values of its reference make it fail, so that failure can be tested:
//! [`PANIC`] and [`FAIL`].

use fmu_abi::clock::Event;
use fmu_abi::{Readiness, Refusal, Slave, Values, require_finite, resource, selected_mode};
use model_description::{Causality, Kind, Role, Span, Variability, Variable, VariableTable};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the binary in the fingerprint.
pub const IDENTIFIER: &str = "staircase";
/// The resource: the sample time as text.
pub const RESOURCE: &str = "staircase.txt";
/// Reference at which a tick panics.
pub const PANIC: f64 = 666.0;
/// Reference at which a tick fails.
pub const FAIL: f64 = 667.0;
/// Number of modes.
pub const MODES: usize = 3;

/// The model: nothing in it changes at run time.
pub struct Staircase {
    table: VariableTable,
    sample_time: f64,
    spans: Spans,
}

/// Where the signals lie.
struct Spans {
    input: Span,
    reference: Span,
    mode: [Span; 2],
    gain: Span,
    start_at_one: Span,
    early: Span,
    late: Span,
    ticks: Span,
    odd: Span,
}

/// Everything that changes at run time.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    sum: Vec<f64>,
    ticks: u64,
    /// Number of the first tick that was run.
    first: u64,
    /// Ticks that began on inputs of an earlier one.
    stale: u64,
}

impl Clone for State {
    fn clone(&self) -> Self {
        Self {
            sum: self.sum.clone(),
            ..*self
        }
    }

    /// Copies in place: on line nothing may be allocated.
    fn clone_from(&mut self, source: &Self) {
        self.sum.clone_from(&source.sum);
        (self.ticks, self.first, self.stale) = (source.ticks, source.first, source.stale);
    }
}

/// `in[1..2]`, `ref`, `mode`, `mode_real`, `gain`, `start_at_one`, `early[1..2]`,
/// `late[1..2]`, `ticks`, `odd`: value references 0 to 12 in this order.
pub fn table() -> VariableTable {
    use Causality::{Input, Output, Parameter};
    use Variability::{Discrete, Fixed, Tunable};
    let real = Kind::Real {
        unit: None,
        display_unit: None,
        nominal: None,
        min: None,
        max: None,
        relative: false,
    };
    let ranged = Kind::Real {
        unit: None,
        display_unit: None,
        nominal: None,
        min: Some(-10.0),
        max: Some(10.0),
        relative: false,
    };
    let integer = Kind::Integer {
        min: None,
        max: None,
    };
    let rows = [
        ("in[1]", Role::Measurement, &real, Input, Discrete, 0.0),
        ("in[2]", Role::Measurement, &real, Input, Discrete, 0.0),
        ("ref", Role::Reference, &real, Input, Discrete, 0.0),
        ("mode", Role::Mode, &integer, Input, Discrete, 1.0),
        ("mode_real", Role::ModeReal, &real, Input, Discrete, 0.0),
        ("gain", Role::Threshold, &ranged, Parameter, Tunable, 1.0),
        (
            "start_at_one",
            Role::ScenarioEnabled,
            &Kind::Boolean,
            Parameter,
            Fixed,
            0.0,
        ),
        ("early[1]", Role::Command, &real, Output, Discrete, 0.0),
        ("early[2]", Role::Command, &real, Output, Discrete, 0.0),
        ("late[1]", Role::State, &real, Output, Discrete, 0.0),
        ("late[2]", Role::State, &real, Output, Discrete, 0.0),
        ("ticks", Role::Fault, &integer, Output, Discrete, 0.0),
        (
            "odd",
            Role::FaultFlag,
            &Kind::Boolean,
            Output,
            Discrete,
            0.0,
        ),
    ];
    let mut table = VariableTable::new();
    table.extend(rows.map(
        |(name, role, kind, causality, variability, start)| Variable {
            name: name.into(),
            description: String::new(),
            kind: kind.clone(),
            causality,
            variability,
            start,
            role,
            dependencies: Vec::new(),
            initial_dependencies: Vec::new(),
        },
    ));
    table
}

impl Staircase {
    /// The factor of the active mode, which is its number; none while the mode is untold.
    fn factor(&self, values: &Values) -> Result<Option<f64>, Refusal> {
        let mode = selected_mode(&self.table, values, self.spans.mode, MODES)?;
        Ok(mode.map(|mode| (mode + 1) as f64))
    }
}

impl Slave for Staircase {
    type State = State;

    const RESOURCE: &'static str = RESOURCE;

    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn load(resources: &Path, guid: &str) -> Result<Self, Refusal> {
        let bytes = resource::read_verified(resources, RESOURCE, IDENTIFIER, guid)?;
        let text = String::from_utf8_lossy(&bytes);
        let sample_time = text
            .trim()
            .parse()
            .map_err(|error| format!("{RESOURCE} holds no sample time: {error}"))?;
        let table = table();
        let spans = Spans {
            input: table.span(Role::Measurement),
            reference: table.span(Role::Reference),
            mode: [Role::Mode, Role::ModeReal].map(|role| table.span(role)),
            gain: table.span(Role::Threshold),
            start_at_one: table.span(Role::ScenarioEnabled),
            early: table.span(Role::Command),
            late: table.span(Role::State),
            ticks: table.span(Role::Fault),
            odd: table.span(Role::FaultFlag),
        };
        Ok(Self {
            table,
            sample_time,
            spans,
        })
    }

    fn variables(&self) -> &VariableTable {
        &self.table
    }

    fn sample_time(&self) -> f64 {
        self.sample_time
    }

    fn initial_state(&self) -> State {
        State {
            sum: vec![0.0; 2],
            ticks: 0,
            first: 0,
            stale: 0,
        }
    }

    fn check_inputs(&self, values: &Values) -> Result<Readiness, Refusal> {
        require_finite(&self.table, values, self.spans.reference)?;
        Ok(match self.factor(values)? {
            Some(_) => Readiness::Complete,
            None => Readiness::ModeUntold(self.spans.mode[0].first),
        })
    }

    fn initialize(&self, state: &mut State, values: &mut Values) -> Result<(), Refusal> {
        require_finite(&self.table, values, self.spans.reference)?;
        let start = values.scalar(self.spans.start_at_one);
        (state.ticks, state.stale) = (0, 0);
        state.sum.fill(start + values.scalar(self.spans.reference));
        values.set(self.spans.early, &state.sum);
        values.set(self.spans.late, &state.sum);
        values.set(self.spans.ticks, &[0.0]);
        values.set(self.spans.odd, &[0.0]);
        Ok(())
    }

    fn begin_tick(
        &self,
        state: &mut State,
        values: &mut Values,
        k: u64,
        fresh: bool,
    ) -> Result<(), Refusal> {
        state.stale += u64::from(!fresh);
        if state.ticks == 0 {
            state.first = k;
        }
        let reference = values.scalar(self.spans.reference);
        if reference == PANIC {
            panic!("asked to panic, 100%s");
        }
        if reference == FAIL {
            return Err("asked to fail".into());
        }
        assert_eq!(
            k,
            state.first + state.ticks,
            "ticks come in order, each once"
        );
        let factor = self.factor(values)?.unwrap_or(0.0) * values.scalar(self.spans.gain);
        for (sum, input) in state.sum.iter_mut().zip(values.get(self.spans.input)) {
            // A NaN measurement arrives here as it is; this slave ignores it.
            if input.is_finite() {
                *sum += factor * input;
            }
        }
        values.set(self.spans.early, &state.sum);
        Ok(())
    }

    fn end_tick(&self, state: &mut State, values: &mut Values, k: u64) -> Result<(), Refusal> {
        assert_eq!(k, state.first + state.ticks, "a tick ends after it began");
        state.ticks += 1;
        values.set(self.spans.late, &state.sum);
        values.set(self.spans.ticks, &[state.ticks as f64]);
        values.set(self.spans.odd, &[(state.ticks % 2) as f64]);
        Ok(())
    }

    fn directional_derivative(
        &self,
        _trial: &mut State,
        values: &Values,
        _at: Option<Event>,
        seed: &Values,
        response: &mut Values,
    ) -> Result<(), Refusal> {
        let factor = self.factor(values)?.unwrap_or(0.0) * values.scalar(self.spans.gain);
        for span in [self.spans.early, self.spans.late] {
            let changes = seed.get(self.spans.input);
            for (slot, change) in response.get_mut(span).iter_mut().zip(changes) {
                *slot = factor * change;
            }
        }
        Ok(())
    }

    fn fits(&self, state: &State) -> bool {
        state.sum.len() == 2
    }
}

fmu_abi::export_fmu!(Staircase);
