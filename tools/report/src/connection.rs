//! How the two FMUs are connected and stepped: the sentences that every place tells alike.

use crate::page::{Block, Column, Row, Section, Table};
use ftc_design::Design;

/// Which of the two FMUs is spoken of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::exhaustive_enums, reason = "controller and plant")]
pub enum Side {
    /// The controller.
    Controller,
    /// The plant.
    Plant,
}

/// In which order a master must step the FMUs of this design: the loop that was proved.
pub fn coupling(design: &Design) -> &'static str {
    match design.controller.feedback.latency {
        0 => {
            "Step the controller before the plant, one sample time a step, and hand its new command over in \
             between: the design (latency = 0) allows for no delay in the loop and may diverge under a master \
             that steps both FMUs in parallel."
        }
        _ => {
            "Step controller and plant in parallel, one sample time a step, both from the signals of the last \
             communication point: the design (latency = 1) allows for one sample of delay in the loop and may \
             diverge under a master that steps one FMU after the other."
        }
    }
}

/// What of a design does not fit a package that names parallel masters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Misfit {
    /// The design allows for no sample of delay in the loop.
    #[error(
        "the masters that the package is for step both FMUs in parallel, which puts a sample of delay into the \
         loop, but the design allows for none: design it with latency = 1"
    )]
    NoLatency,
}

/// What a package that names parallel masters must say of this design; nothing where it fits.
pub fn misfit(design: &Design) -> Option<Misfit> {
    (design.controller.feedback.latency == 0).then_some(Misfit::NoLatency)
}

/// What a signal is, and where it goes: name, meaning, counterpart.
type Signal = (&'static str, &'static str, &'static str);

/// The mode that a controller is told.
const TOLD: [Signal; 2] = [
    (
        "mode",
        "Integer input: the active mode, counted from 1; 0 while it is not told: the controller rests until it is",
        "mode of the plant, or what selects the mode",
    ),
    (
        "mode_real",
        "input: the mode as a Real, for tools that connect no Integer; 0 when not connected",
        "mode_real of the plant, instead of mode or beside it",
    ),
];

/// The mode that a controller finds.
const FOUND: [Signal; 3] = [
    (
        "mode_hat",
        "Integer output: the mode that the readings fit, counted from 1; the controller is told none",
        "to watch",
    ),
    ("mode_hat_real", "output: the same as a Real", "to watch"),
    (
        "mode_probability",
        "output, one per mode: its probability given the readings",
        "to watch",
    ),
];

const CONTROLLER: [Signal; 12] = [
    (
        "y",
        "input: the measured outputs",
        "y of the plant, or your sensors",
    ),
    (
        "y_ref",
        "input: references of the tracked outputs",
        "y_ref of the plant, or your set points",
    ),
    (
        "u",
        "output: the command",
        "u of the plant, or your actuators",
    ),
    ("x_hat", "output: estimated state", "to watch"),
    ("f_hat", "output: estimated sensor fault", "to watch"),
    ("residual", "output: measured less predicted", "to watch"),
    ("fault", "Boolean output: a fault is flagged", "to watch"),
    (
        "fault_real",
        "output: the flag as a Real, 1 or 0",
        "to watch",
    ),
    (
        "suspect",
        "Boolean output: a slow divergence that a sensor's drift or a load explains",
        "to watch",
    ),
    (
        "model_valid",
        "Boolean output: false while nothing that the estimator knows of explains the readings",
        "to watch",
    ),
    (
        "load_hat",
        "output: what acts on the plant beside the command",
        "to watch",
    ),
    (
        "actuator_fault",
        "Boolean output: that exceeds the size of a usual load",
        "to watch",
    ),
];

const PLANT: [Signal; 13] = [
    ("u", "input: the command", "u of the controller"),
    (
        "f_ext",
        "input: sensor fault, added to that of the scenario",
        "nothing, or a fault of your own",
    ),
    (
        "w_ext",
        "input: disturbance, added to that of the scenario",
        "nothing, or a disturbance of your own",
    ),
    (
        "mode_ext",
        "Integer input: the mode while scenario_enabled is false; 0 while it is not told",
        "nothing, or what selects the mode",
    ),
    (
        "mode_ext_real",
        "input: the same as a Real; 0 when not connected",
        "instead of mode_ext",
    ),
    (
        "y",
        "output: measured, with fault and noise",
        "y of the controller",
    ),
    ("y_true", "output: without fault and noise", "to watch"),
    ("x", "output: state", "to watch"),
    (
        "y_ref",
        "output: the scenario's references",
        "y_ref of the controller",
    ),
    (
        "mode",
        "Integer output: active mode",
        "mode of the controller",
    ),
    (
        "mode_real",
        "output: the mode as a Real",
        "mode_real of the controller",
    ),
    ("f", "output: sensor fault in force", "to watch"),
    ("w", "output: disturbance in force", "to watch"),
];

/// The controller's signals: the mode comes in, or is found.
fn controller(design: &Design) -> Vec<Signal> {
    let mode: &[Signal] = match design.controller.estimator.finds_the_mode() {
        true => &FOUND,
        false => &TOLD,
    };
    CONTROLLER.iter().chain(mode).copied().collect()
}

/// The section "How to connect" of an FMU's documentation.
pub fn section(design: &Design, side: Side) -> Section {
    let te = design.plant.sample_time;
    let (signals, parameters): (&[Signal], &[(&str, &str)]) = match side {
        Side::Controller => (
            &controller(design),
            &[
                (
                    "ftc_enabled",
                    "Tunable. True: faults that are found are taken out of the loop. False: the controller uses \
                     the readings as they are; faults are still estimated and flagged.",
                ),
                (
                    "threshold",
                    "Tunable, one per output, in its unit, at least 0. A residual beyond it flags a fault: a smaller \
                     value finds smaller faults and gives more false alarms.",
                ),
            ],
        ),
        Side::Plant => (
            &PLANT,
            &[
                (
                    "scenario_enabled",
                    "Fixed. True: the plant runs the design's scenario: references, modes, faults and disturbance. False: \
                     these are zero, and mode_ext is the mode.",
                ),
                (
                    "noise_enabled",
                    "Fixed. True: the scenario's measurement noise is added to y.",
                ),
            ],
        ),
    };
    let rows = signals.iter().map(|(name, meaning, other)| Row {
        cells: [*name, *meaning, *other].map(String::from).into(),
        ..Row::default()
    });
    let table = Table {
        caption: "Signals, one scalar variable per element, such as y[1]".into(),
        columns: ["Signal", "What it is", "Connect to"].map(words).into(),
        rows: rows.collect(),
        notes: Vec::new(),
    };
    let facts = parameters
        .iter()
        .map(|(name, text)| (name.to_string(), text.to_string()));
    Section::new("How to connect")
        .paragraph(coupling(design))
        .paragraph(format!(
            "The sample time is {te} s. Steps of just that, or of a whole fraction of it, give the loop that was \
             designed; a step within a thousandth of such a value is taken for it. In a step that is longer, or \
             that ends within a sample, ticks run on old inputs, of which the log warns once."
        ))
        .with(Block::Table(table))
        .with(Block::Facts(facts.collect()))
}

fn words(name: &str) -> Column {
    Column {
        name: name.into(),
        kind: crate::page::ColumnKind::Words,
    }
}
