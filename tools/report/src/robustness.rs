//! The same scenario on plants that are not quite the model's: with fault tolerance and without.

use crate::page::{Block, Column, Row, Section, Table};
use crate::text::significant;
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::deviation::{Load, Port};
use ftc_plant::scenario::NEVER;
use ftc_plant::{Deviation, Dimensions, TruePlant};
use ftc_simulate::closed_loop::visit;
use ftc_simulate::{PlantSimulator, Variant};
use serde_json::{Value, json};
use std::fmt::Write;

/// By how much every actuator is too strong or too weak.
const GAIN: f64 = 0.1;
/// Height of a step on an input, relative to its nominal value.
const STEP: f64 = 0.1;
/// Fault tolerance does worse than none where its true error is larger by more than this share.
pub const WORSE: f64 = 0.01;
/// Errors (root mean square, relative to the nominal value of the output) below this one do not matter.
const NEGLIGIBLE: f64 = 1e-3;

/// A loop is lost where its true error is larger than that of the scenario as it is, and than the output's
/// nominal value, by this factor.
const LOST: f64 = 30.0;

/// One case and what came of it.
#[expect(
    clippy::exhaustive_structs,
    reason = "a row of the table of robustness"
)]
pub struct Case {
    /// What differs from the scenario, in words.
    pub name: String,
    /// True mean square error per tracked output with fault tolerance.
    pub with: Vec<f64>,
    /// The same without.
    pub without: Vec<f64>,
}

/// Tries the scenario as it is, actuators that are too strong and too weak, a step on each input and
/// each disturbance in the middle of the scenario, and readings that are one sample later.
pub fn cases(design: &Design) -> Vec<Case> {
    let controller =
        Controller::new(design.parameters()).expect("a finished design has matching sizes");
    departures(design)
        .into_iter()
        .map(|(name, deviation)| {
            let true_plant = design.true_plant.clone().with_deviation(deviation);
            let errors = |variant| errors(design, &controller, true_plant.clone(), variant);
            Case {
                name,
                with: errors(Variant::Ftc),
                without: errors(Variant::NoFtc),
            }
        })
        .collect()
}

/// How many cases [`cases`] tries for a plant of these sizes.
pub(crate) fn count(size: Dimensions) -> usize {
    4 + size.inputs + size.disturbances
}

/// What is tried, on top of what departs anyway.
fn departures(design: &Design) -> Vec<(String, Deviation)> {
    let (_, own) = design.true_plant.clone().into_parts();
    let dims = design.plant.dimensions();
    let mut all = vec![("the scenario as it is".to_string(), own.clone())];
    for (name, change) in [("10 % too strong", GAIN), ("10 % too weak", -GAIN)] {
        let mut deviation = own.clone();
        deviation.input_gain.resize(dims.inputs, 1.0);
        for gain in &mut deviation.input_gain {
            *gain *= 1.0 + change;
        }
        all.push((format!("every actuator {name}"), deviation));
    }
    let middle = (design.scenario.steps / 2) as f64 * design.plant.sample_time;
    let mut step = |name: String, at: Port, size: f64| {
        let mut deviation = own.clone();
        deviation.loads.push(Load {
            at,
            from: middle,
            until: NEVER,
            size,
        });
        all.push((name, deviation));
    };
    for (index, input) in design.signals.inputs.iter().enumerate() {
        let size = STEP * input.nominal;
        let name = format!("a step of {} on {}", significant(size), input.name);
        step(name, Port::Input(index), size);
    }
    for channel in 0..dims.disturbances {
        let size = height(design, channel);
        let described = design.signals.disturbances.get(channel);
        let whose = described.map_or_else(
            || format!("disturbance {}", channel + 1),
            |signal| signal.name.clone(),
        );
        let name = format!("a step of {} on {whose}", significant(size));
        step(name, Port::Disturbance(channel), size);
    }
    let mut late = own;
    late.sensor_delay += 1;
    all.push(("readings one sample later".into(), late));
    all
}

/// The largest value of a disturbance in the scenario, or one.
fn height(design: &Design, channel: usize) -> f64 {
    let te = design.plant.sample_time;
    let signal = &design.scenario.disturbance[channel];
    let values = (0..design.scenario.steps).map(|tick| signal.at(tick, te).abs());
    let largest = values.fold(0.0, f64::max);
    if largest > 0.0 { largest } else { 1.0 }
}

/// True mean square error per tracked output; infinite where the plant could not be integrated.
fn errors(
    design: &Design,
    controller: &Controller,
    true_plant: TruePlant,
    variant: Variant,
) -> Vec<f64> {
    let plant =
        PlantSimulator::with_true_plant(design.plant.clone(), true_plant, design.scenario.clone());
    let tracked = &design.controller.feedback.tracked;
    let mut squares = vec![0.0; tracked.len()];
    let stalled = visit(&plant, controller, variant, &mut |seen| {
        let outputs = tracked.iter().zip(&seen.plant.reference);
        for (sum, (&row, reference)) in squares.iter_mut().zip(outputs) {
            let error = seen.plant.y_true[row] - reference;
            *sum += error * error;
        }
    });
    for sum in &mut squares {
        *sum = match stalled {
            None => *sum / design.scenario.steps.max(1) as f64,
            Some(_) => f64::INFINITY,
        };
    }
    squares
}

/// Whether a true mean square error with fault tolerance is worth a word beside the one without.
fn is_worse(with: f64, without: f64, nominal: f64) -> bool {
    with.sqrt() > NEGLIGIBLE * nominal && with > (1.0 + WORSE) * without
}

/// Whether a loop is lost: its true error is large beside the output's nominal value and beside that of
/// the scenario as it is, with fault tolerance and without.
fn is_lost(case: &Case, usual: &Case, index: usize, nominal: f64) -> bool {
    let least = |case: &Case| case.with[index].min(case.without[index]).sqrt();
    least(case) > LOST * least(usual).max(nominal)
}

/// A sentence for every case in which the loop is lost, whatever the fault tolerance does, and for every
/// case and output in which fault tolerance does worse than none.
pub fn warnings(design: &Design, cases: &[Case]) -> Vec<String> {
    let tracked = &design.controller.feedback.tracked;
    let Some(usual) = cases.first() else {
        return Vec::new();
    };
    let nominal = |row: usize| design.signals.outputs[row].nominal;
    let (lost, kept): (Vec<&Case>, Vec<&Case>) = cases.iter().partition(|case| {
        let mut rows = tracked.iter().enumerate();
        rows.any(|(index, &row)| is_lost(case, usual, index, nominal(row)))
    });
    let lost = lost.into_iter().map(|case| {
        format!(
            "{}: the loop is unstable: if that may happen, try a smaller controller.integral_weight or a larger input_weight",
            case.name
        )
    });
    let worse = kept.into_iter().flat_map(|case| {
        let outputs = tracked.iter().zip(case.with.iter().zip(&case.without));
        outputs.filter_map(|(&row, (&with, &without))| {
            let output = &design.signals.outputs[row];
            is_worse(with, without, output.nominal).then(|| {
                format!(
                    "{}: {} follows its reference worse with fault tolerance than without (true MSE {with:.3e} against \
                     {without:.3e}): raise estimator.sigmas or threshold, or see whether its faults are worth detecting",
                    case.name, output.name
                )
            })
        })
    });
    lost.chain(worse).collect()
}

/// The section of the page.
pub fn section(design: &Design, cases: &[Case]) -> Section {
    let tracked = &design.controller.feedback.tracked;
    let mut rows = Vec::new();
    for case in cases {
        for (index, &row) in tracked.iter().enumerate() {
            let (with, without) = (case.with[index], case.without[index]);
            rows.push(Row {
                cells: vec![
                    case.name.clone(),
                    design.signals.outputs[row].name.clone(),
                    format!("{with:.3e}"),
                    format!("{without:.3e}"),
                    match with > (1.0 + WORSE) * without {
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
        for (index, &row) in tracked.iter().enumerate() {
            let name = if index == 0 { case.name.as_str() } else { "" };
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
pub fn json(cases: &[Case], warnings: &[String]) -> Value {
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
                "case": case.name,
                "mse": { "ftc": finite(&case.with), "no_ftc": finite(&case.without) },
            })
        })
        .collect();
    json!({ "cases": cases, "warnings": warnings })
}

#[cfg(test)]
mod tests {
    use super::{Case, is_lost, is_worse};

    #[test]
    fn a_loop_is_lost_where_both_variants_are() {
        let case = |with: f64, without: f64| Case {
            name: String::new(),
            with: vec![with],
            without: vec![without],
        };
        let usual = case(0.01, 0.02);
        assert!(is_lost(&case(1e4, f64::INFINITY), &usual, 0, 1.0));
        assert!(!is_lost(&case(0.5, 1e9), &usual, 0, 1.0));
        assert!(!is_lost(&case(1e4, 1e4), &case(1e4, 1e4), 0, 1.0));
        assert!(!is_lost(&case(1e4, 1e4), &usual, 0, 1e3));
    }

    #[test]
    fn worse_is_what_is_larger_and_matters() {
        assert!(is_worse(0.02, 0.01, 1.0) && is_worse(f64::INFINITY, 1.0, 1.0));
        assert!(!is_worse(0.01, 0.01, 1.0) && !is_worse(0.01, 0.02, 1.0));
        assert!(!is_worse(1e-8, 1e-9, 1.0) && is_worse(1e-8, 1e-9, 1e-3));
        assert!(!is_worse(0.010_05, 0.01, 1.0));
    }
}
