//! The two tables of the project: the controller's and the plant's variables.
//!
//! Names are a contract (`y[1]`, `y_ref[1]`, `u[1]` ...), whatever the user calls a signal: the
//! user's name goes into the description, the unit and the range into the attributes. A range
//! is declared where the value cannot leave it or must not (measurements that come in,
//! commands, references); estimates and faulty measurements may leave any range, so they have
//! none.

use crate::units::display_unit;
use crate::{Causality, Kind, Role, Span, Variability, Variable, VariableTable};
use ftc_plant::scenario::InjectedKind;

/// What the user says about a signal.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(
    clippy::exhaustive_structs,
    reason = "what FMI 2.0 can say of a signal"
)]
pub struct SignalInfo {
    /// The user's name; empty for the default (`u[1]`, `y[1]`, `x[1]`).
    pub name: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Least value.
    pub min: Option<f64>,
    /// Greatest value.
    pub max: Option<f64>,
    /// Value at the start, moved into the range if it lies outside.
    pub start: f64,
}

/// The sizes and signal names of a design, all that the tables need of it.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::exhaustive_structs,
    reason = "whoever describes an FMU must say all of it"
)]
pub struct Interface {
    /// `Te` in seconds.
    pub sample_time: f64,
    /// Length of the default experiment in seconds.
    pub stop_time: f64,
    /// Inputs of the plant (m).
    pub inputs: Vec<SignalInfo>,
    /// Outputs of the plant (p).
    pub outputs: Vec<SignalInfo>,
    /// States of the plant (n).
    pub states: Vec<SignalInfo>,
    /// Tracked outputs, positions in `outputs` counted from 0 (r).
    pub tracked: Vec<usize>,
    /// Disturbances (s).
    pub disturbances: Vec<SignalInfo>,
    /// Number of modes.
    pub modes: usize,
    /// Whether the controller finds the active mode from the readings; else it is told.
    pub finds_the_mode: bool,
    /// Residual thresholds at the start (p).
    pub thresholds: Vec<f64>,
}

/// The controller's variables.
///
/// Inputs `y`, `y_ref`, `mode`, `mode_real`; outputs `u`, `x_hat`, `f_hat`, `residual`, `fault`,
/// `fault_real`; tunable parameters `ftc_enabled`, `threshold`. Where the controller finds the mode,
/// it has no such inputs, but outputs `mode_hat`, `mode_hat_real`, `mode_probability`.
pub fn controller(interface: &Interface) -> VariableTable {
    let inputs = &named("u", &interface.inputs);
    let outputs = &named("y", &interface.outputs);
    let states = &named("x", &interface.states);
    let references = interface.references(outputs);
    let mut table = VariableTable::new();

    let input = Maker::input();
    table.extend(input.vector("y", "Measured", Role::Measurement, outputs, Range::Open));
    table.extend(input.vector(
        "y_ref",
        "Reference of",
        Role::Reference,
        &references,
        Range::Closed,
    ));
    let mut told = Vec::new();
    if !interface.finds_the_mode {
        let mode = table.push(input.mode("mode", Role::Mode, "Active mode", interface.modes));
        let real = table.push(input.mode_real("mode_real", Role::ModeReal, interface.modes));
        told.extend([scalar(mode), scalar(real)]);
    }

    let output = Maker::output();
    table.extend(output.vector("u", "Command of", Role::Command, inputs, Range::Closed));
    table.extend(output.vector(
        "x_hat",
        "Estimate of",
        Role::StateEstimate,
        states,
        Range::Open,
    ));
    table.extend(output.vector(
        "f_hat",
        "Estimated sensor fault of",
        Role::FaultEstimate,
        &deviations(outputs),
        Range::Difference,
    ));
    table.extend(output.vector(
        "residual",
        "Measured less predicted",
        Role::Residual,
        &deviations(outputs),
        Range::Difference,
    ));
    let flags = || outputs.iter().enumerate();
    table.extend(flags().map(|(at, signal)| {
        output.boolean(
            format!("fault[{}]", at + 1),
            phrase("Sensor fault flagged on", &signal.name),
            Role::FaultFlag,
            false,
        )
    }));
    table.extend(flags().map(|(at, signal)| output.flag_real(at, &signal.name)));

    let tunable = Maker::parameter(Variability::Tunable);
    table.push(tunable.boolean(
        "ftc_enabled".into(),
        "Compensate sensor faults".into(),
        Role::FtcEnabled,
        true,
    ));
    let thresholds: Vec<SignalInfo> = outputs
        .iter()
        .zip(&interface.thresholds)
        .map(|(signal, &start)| SignalInfo {
            min: Some(0.0),
            max: None,
            start,
            ..signal.clone()
        })
        .collect();
    table.extend(tunable.vector(
        "threshold",
        "Residual that flags a fault of",
        Role::Threshold,
        &thresholds,
        Range::Difference,
    ));

    table.extend(outputs.iter().enumerate().map(|(at, signal)| {
        output.boolean(
            format!("suspect[{}]", at + 1),
            format!(
                "Slow divergence of {}: a sensor fault or a load",
                signal.name
            ),
            Role::Suspect,
            false,
        )
    }));
    table.push(output.boolean(
        "model_valid".into(),
        "The model explains the readings".into(),
        Role::ModelValid,
        true,
    ));
    table.extend(output.vector(
        "load_hat",
        "What acts on the plant beside the command of",
        Role::LoadEstimate,
        &deviations(inputs),
        Range::Open,
    ));
    table.extend(inputs.iter().enumerate().map(|(at, signal)| {
        output.boolean(
            format!("actuator_fault[{}]", at + 1),
            format!("Load or gain error on {} beyond its size", signal.name),
            Role::ActuatorFault,
            false,
        )
    }));

    if interface.finds_the_mode {
        let what = "Mode that the readings fit";
        table.push(output.mode("mode_hat", Role::ModeEstimate, what, interface.modes));
        table.push(output.mode_real("mode_hat_real", Role::ModeEstimateReal, interface.modes));
        table.extend((1..=interface.modes).map(|mode| output.probability(mode)));
    }
    // Before the first tick nothing is computed but the operating point of the active mode.
    for role in [Role::Command, Role::StateEstimate] {
        table.depend(role, |_| told.clone());
    }
    table
}

/// The plant's variables.
///
/// Inputs `u`, `f_ext`, `w_ext`, `mode_ext`, `mode_ext_real`; outputs `y`, `y_true`, `x` and the
/// scenario's `y_ref`, `mode`, `mode_real`, `f`, `w`; fixed parameters `scenario_enabled`,
/// `noise_enabled`.
pub fn plant(interface: &Interface) -> VariableTable {
    let inputs = &named("u", &interface.inputs);
    let outputs = &named("y", &interface.outputs);
    let states = &named("x", &interface.states);
    let references = interface.references(outputs);
    let disturbances = named("w", &interface.disturbances);
    let disturbances = deviations(&disturbances);
    let faults = deviations(outputs);
    let mut table = VariableTable::new();

    let input = Maker::input();
    table.extend(input.vector("u", "Command of", Role::Command, inputs, Range::Closed));
    let f_ext = table.extend(input.vector(
        "f_ext",
        "Sensor fault added to",
        Role::ExternalFault,
        &faults,
        Range::Difference,
    ));
    let w_ext = table.extend(input.vector(
        "w_ext",
        "Added to the disturbance",
        Role::ExternalDisturbance,
        &disturbances,
        Range::Difference,
    ));
    let external = "Mode to be active while the scenario is off";
    let mode_ext =
        scalar(table.push(input.mode("mode_ext", Role::ExternalMode, external, interface.modes)));
    let mode_real = scalar(table.push(input.mode_real(
        "mode_ext_real",
        Role::ExternalModeReal,
        interface.modes,
    )));

    let output = Maker::output();
    table.extend(output.vector("y", "Measured", Role::Measurement, outputs, Range::Open));
    table.extend(output.vector("y_true", "True", Role::TrueOutput, outputs, Range::Open));
    table.extend(output.vector("x", "State", Role::State, states, Range::Open));
    table.extend(output.vector(
        "y_ref",
        "Reference of",
        Role::Reference,
        &references,
        Range::Open,
    ));
    table.push(output.mode("mode", Role::Mode, "Active mode", interface.modes));
    table.push(output.mode_real("mode_real", Role::ModeReal, interface.modes));
    table.extend(output.vector(
        "f",
        "Sensor fault of",
        Role::Fault,
        &faults,
        Range::Difference,
    ));
    table.extend(output.vector(
        "w",
        "Disturbance",
        Role::Disturbance,
        &disturbances,
        Range::Difference,
    ));

    let fixed = Maker::parameter(Variability::Fixed);
    let scenario = scalar(table.push(fixed.boolean(
        "scenario_enabled".into(),
        "Run the built-in reference, fault, disturbance and mode signals".into(),
        Role::ScenarioEnabled,
        true,
    )));
    let noise = scalar(table.push(fixed.boolean(
        "noise_enabled".into(),
        "Add the scenario's measurement noise".into(),
        Role::NoiseEnabled,
        true,
    )));

    let injected = injected(&mut table, &named("y", &interface.outputs));

    let element = |span: Span, at: u32| scalar(span.first + at);
    let mode = [mode_ext, mode_real, scenario];
    let with = |more: &[Span]| [&mode[..], more].concat();
    table.depend(Role::Measurement, |at| {
        let fault = injected.map(|span| element(span, at));
        [&with(&[element(f_ext, at), w_ext, noise])[..], &fault].concat()
    });
    table.depend(Role::TrueOutput, |_| with(&[w_ext]));
    table.depend(Role::State, |_| with(&[]));
    table.depend(Role::Reference, |_| vec![scenario]);
    table.depend(Role::Mode, |_| with(&[]));
    table.depend(Role::ModeReal, |_| with(&[]));
    table.depend(Role::Fault, |at| {
        let fault = injected.map(|span| element(span, at));
        [&with(&[element(f_ext, at), w_ext, noise])[..], &fault].concat()
    });
    table.depend(Role::Disturbance, |at| vec![element(w_ext, at), scenario]);
    table
}

/// An end in seconds that no run reaches.
const NEVER: f64 = 1e12;

/// Tunable parameters that put a fault on each sensor while the plant runs: kind, size, begin, end.
fn injected(table: &mut VariableTable, outputs: &[SignalInfo]) -> [Span; 4] {
    let tunable = Maker::parameter(Variability::Tunable);
    let number = |min: Option<f64>| Kind::Real {
        unit: None,
        display_unit: None,
        relative: false,
        nominal: None,
        min,
        max: None,
    };
    let kind = Kind::Integer {
        min: Some(0),
        max: Some(InjectedKind::LAST),
    };
    let numbered = InjectedKind::ALL.iter().zip(1..);
    let kinds = numbered.fold(String::from("0 none"), |text, ((_, name), number)| {
        format!("{text}, {number} {name}")
    });
    let of_size = "its bias, slope per second, lost fraction or standard deviation";
    [
        ("kind", Role::InjectedKind, kind, kinds.as_str(), 0.0),
        ("size", Role::InjectedSize, number(None), of_size, 0.0),
        (
            "from",
            Role::InjectedFrom,
            number(Some(0.0)),
            "its first second",
            0.0,
        ),
        (
            "until",
            Role::InjectedUntil,
            number(Some(0.0)),
            "the second when it ends",
            NEVER,
        ),
    ]
    .map(|(name, role, kind, what, start)| {
        table.extend(outputs.iter().enumerate().map(|(at, output)| {
            let name = format!("inject_{name}[{}]", at + 1);
            let description = format!("Fault put on {}: {what}", output.name);
            tunable.variable(name, description, kind.clone(), role, start)
        }))
    })
}

impl Interface {
    /// The tracked ones among the outputs; a position that is none is left out.
    fn references(&self, outputs: &[SignalInfo]) -> Vec<SignalInfo> {
        let tracked = self.tracked.iter();
        tracked.filter_map(|&at| outputs.get(at).cloned()).collect()
    }
}

/// The same signals, those without a name called `y[1]`, `y[2]` ... by their position.
fn named(base: &str, signals: &[SignalInfo]) -> Vec<SignalInfo> {
    let name = |(at, signal): (usize, &SignalInfo)| {
        let mut signal = signal.clone();
        if signal.name.is_empty() {
            signal.name = format!("{base}[{}]", at + 1);
        }
        signal
    };
    signals.iter().enumerate().map(name).collect()
}

/// The same signals as differences: unit and magnitude remain, range and operating point go.
fn deviations(signals: &[SignalInfo]) -> Vec<SignalInfo> {
    signals
        .iter()
        .map(|signal| SignalInfo {
            min: None,
            max: None,
            start: 0.0,
            ..signal.clone()
        })
        .collect()
}

fn scalar(reference: u32) -> Span {
    Span {
        first: reference,
        len: 1,
    }
}

/// Whether the signal's range is declared.
#[derive(Clone, Copy, PartialEq)]
enum Range {
    Open,
    Closed,
    /// It is, if any, that of a difference of two values: an offset of the unit drops out.
    Difference,
}

/// What a variable is, and of which signal: `Command of heater power`. A word that the user's
/// name has at its end is not said twice: the command of `active current command`.
fn phrase(what: &str, name: &str) -> String {
    let noun = what.strip_suffix(" of").unwrap_or(what);
    let repeated = name.get(name.len().saturating_sub(noun.len())..);
    match repeated {
        Some(end) if noun != what && end.eq_ignore_ascii_case(noun) => {
            let rest = name[..name.len() - noun.len()].trim_end();
            if rest.is_empty() {
                noun.into()
            } else {
                format!("{what} {rest}")
            }
        }
        _ => format!("{what} {name}"),
    }
}

/// Makes variables of one causality and variability.
struct Maker {
    causality: Causality,
    variability: Variability,
}

impl Maker {
    fn input() -> Self {
        Self {
            causality: Causality::Input,
            variability: Variability::Discrete,
        }
    }

    fn output() -> Self {
        Self {
            causality: Causality::Output,
            variability: Variability::Discrete,
        }
    }

    fn parameter(variability: Variability) -> Self {
        Self {
            causality: Causality::Parameter,
            variability,
        }
    }

    fn variable(
        &self,
        name: String,
        description: String,
        kind: Kind,
        role: Role,
        start: f64,
    ) -> Variable {
        Variable {
            name,
            description,
            kind,
            causality: self.causality,
            variability: self.variability,
            start,
            role,
            dependencies: Vec::new(),
            initial_dependencies: Vec::new(),
        }
    }

    fn vector(
        &self,
        base: &str,
        what: &str,
        role: Role,
        signals: &[SignalInfo],
        range: Range,
    ) -> Vec<Variable> {
        let make = |(at, signal): (usize, &SignalInfo)| {
            let (min, max) = match range {
                Range::Open => (None, None),
                Range::Closed | Range::Difference => (signal.min, signal.max),
            };
            let kind = Kind::Real {
                unit: (!signal.unit.is_empty()).then(|| signal.unit.clone()),
                display_unit: display_unit(&signal.unit).map(str::to_string),
                nominal: signal.nominal,
                min,
                max,
                relative: range == Range::Difference,
            };
            let start = signal
                .start
                .max(min.unwrap_or(f64::NEG_INFINITY))
                .min(max.unwrap_or(f64::INFINITY));
            let name = format!("{base}[{}]", at + 1);
            let description = phrase(what, &signal.name);
            self.variable(name, description, kind, role, start)
        };
        signals.iter().enumerate().map(make).collect()
    }

    fn boolean(&self, name: String, description: String, role: Role, start: bool) -> Variable {
        self.variable(
            name,
            description,
            Kind::Boolean,
            role,
            f64::from(u8::from(start)),
        )
    }

    /// A flag as a Real: 1 where it is raised.
    fn flag_real(&self, at: usize, name: &str) -> Variable {
        let kind = pure_number(Some(0.0), Some(1.0));
        let what = "1 where a sensor fault is flagged, else 0, as a Real, on";
        self.variable(
            format!("fault_real[{}]", at + 1),
            phrase(what, name),
            kind,
            Role::FaultFlagReal,
            0.0,
        )
    }

    /// How likely a mode is, counted from 1.
    fn probability(&self, mode: usize) -> Variable {
        self.variable(
            format!("mode_probability[{mode}]"),
            format!("Probability of mode {mode} given the readings"),
            pure_number(Some(0.0), Some(1.0)),
            Role::ModeProbability,
            0.0,
        )
    }

    /// A mode that comes in may be 0: it has not been told, or comes by the Real twin.
    fn mode(&self, name: &str, role: Role, what: &str, modes: usize) -> Variable {
        let input = self.causality == Causality::Input;
        let (least, more) = if input {
            (0, "; 0 while it is not told, or where it comes as a Real")
        } else {
            (1, "")
        };
        let kind = Kind::Integer {
            min: Some(least),
            max: i32::try_from(modes).ok(),
        };
        let description = format!("{what}, counted from 1{more}");
        self.variable(name.into(), description, kind, role, f64::from(least))
    }

    fn mode_real(&self, name: &str, role: Role, modes: usize) -> Variable {
        let (least, more) = match self.causality {
            Causality::Input => (0.0, "; 0 when not connected"),
            _ => (1.0, ""),
        };
        let kind = pure_number(Some(least), Some(modes as f64));
        let description = format!("The mode as a Real, for tools that connect no Integer{more}");
        self.variable(name.into(), description, kind, role, least)
    }
}

/// A Real without a unit.
fn pure_number(min: Option<f64>, max: Option<f64>) -> Kind {
    Kind::Real {
        unit: None,
        display_unit: None,
        nominal: None,
        min,
        max,
        relative: false,
    }
}

#[cfg(test)]
mod tests {
    use super::phrase;

    #[test]
    fn descriptions_read_as_english() {
        for (what, name, expected) in [
            (
                "Command of",
                "active current command",
                "Command of active current",
            ),
            ("Command of", "heater power", "Command of heater power"),
            ("Command of", "command", "Command"),
            ("Command of", "u[1]", "Command of u[1]"),
            ("Reference of", "Speed Reference", "Reference of Speed"),
            ("Measured", "DC voltage", "Measured DC voltage"),
            ("Estimate of", "é", "Estimate of é"),
        ] {
            assert_eq!(phrase(what, name), expected);
        }
    }
}
