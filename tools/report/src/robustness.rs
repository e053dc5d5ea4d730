//! The same scenario on plants that are not quite the model's: with fault tolerance and without.

use crate::page::{Block, Column, Row, Section, Table};
use crate::text::{number, significant};
use ftc_design::Design;
use ftc_plant::deviation::Port;
use ftc_simulate::robustness::{Case, Departure, RobustnessWarning};
use serde_json::{Value, json};
use std::fmt::Write;

/// What differs from the scenario.
fn named(design: &Design, departure: Departure) -> String {
    match departure {
        Departure::None => "the scenario as it is".into(),
        Departure::InputGain(change) => format!(
            "every actuator {} % too {}",
            number(100.0 * change.abs()),
            if change > 0.0 { "strong" } else { "weak" }
        ),
        Departure::Step { at, size } => {
            let signals = match at {
                Port::Input(_) => &design.signals.inputs,
                Port::Disturbance(_) => &design.signals.disturbances,
                Port::State(_) => &design.signals.states,
            };
            let (Port::Input(index) | Port::Disturbance(index) | Port::State(index)) = at;
            let signal = signals.get(index);
            let name = signal.map_or_else(|| at.to_string(), |signal| signal.name.clone());
            format!("a step of {} on {name}", significant(size))
        }
        Departure::LateReadings => "readings one sample later".into(),
        other => format!("{other:?}"),
    }
}

/// One sentence for each warning.
pub fn warnings(design: &Design, cases: &[Case]) -> Vec<String> {
    let warnings = ftc_simulate::robustness::warnings(design, cases);
    let worded = warnings.iter().map(|warning| match *warning {
        RobustnessWarning::Unstable(departure) => format!(
            "{}: the loop is unstable: if that may happen, try a smaller controller.integral_weight or a larger input_weight",
            named(design, departure)
        ),
        RobustnessWarning::Worse {
            departure,
            output,
            with,
            without,
        } => format!(
            "{}: {} follows its reference worse with fault tolerance than without (true MSE {with:.3e} against \
             {without:.3e}): raise estimator.sigmas or threshold, or see whether its faults are worth detecting",
            named(design, departure),
            design.signals.outputs[output].name
        ),
        other => format!("{other:?}"),
    });
    worded.collect()
}

/// The section of the page.
pub fn section(design: &Design, cases: &[Case]) -> Section {
    let tracked = &design.controller.feedback.tracked;
    let mut rows = Vec::new();
    for case in cases {
        let departure = named(design, case.departure);
        for (index, &row) in tracked.iter().enumerate() {
            let (with, without) = (case.with[index], case.without[index]);
            rows.push(Row {
                cells: vec![
                    departure.clone(),
                    design.signals.outputs[row].name.clone(),
                    format!("{with:.3e}"),
                    format!("{without:.3e}"),
                    match case.is_worse(index) {
                        true => "worse".into(),
                        false => significant((without / with).sqrt()),
                    },
                ],
                begins_group: index == 0,
                ..Row::default()
            });
        }
    }
    Section::new("On a plant that is not quite the model").with(Block::Table(Table {
        caption: "True mean square error with fault tolerance and without".into(),
        columns: vec![
            Column::words("case"),
            Column::name("output"),
            Column::number("with"),
            Column::number("without"),
            Column::number("error smaller by"),
        ],
        rows,
        notes: vec![
            "Steps last from the middle of the scenario to its end. The ratio is that of root mean squares.".into(),
        ],
    }))
}

/// The table for a person at a terminal.
pub fn text(design: &Design, cases: &[Case]) -> String {
    let tracked = &design.controller.feedback.tracked;
    let mut text = format!(
        "{:<44}{:<12}{:>14}{:>14}\n",
        "true MSE on another plant", "output", "with FTC", "without"
    );
    for case in cases {
        let departure = named(design, case.departure);
        for (index, &row) in tracked.iter().enumerate() {
            let name = if index == 0 { departure.as_str() } else { "" };
            let _ = writeln!(
                text,
                "{name:<44}{:<12}{:>14.5e}{:>14.5e}",
                design.signals.outputs[row].name, case.with[index], case.without[index]
            );
        }
    }
    text.push('\n');
    text
}

/// The same for a program.
pub fn json(design: &Design, cases: &[Case], warnings: &[String]) -> Value {
    let finite = |values: &[f64]| -> Vec<Option<f64>> {
        let finite = values
            .iter()
            .map(|&value| Some(value).filter(|v| v.is_finite()));
        finite.collect()
    };
    let cases: Value = cases
        .iter()
        .map(|case| {
            json!({
                "case": named(design, case.departure),
                "mse": { "ftc": finite(&case.with), "no_ftc": finite(&case.without) },
            })
        })
        .collect();
    json!({ "cases": cases, "warnings": warnings })
}
