//! The page of the converter.

use super::{COMPARED, FAULTY, HORIZON, INPUT_WEIGHT, REPORTED, Trial, name};
use crate::experiment::{OutputMerits, curve, figure};
use ftc_design::Design;
use ftc_plant::TruePlant;
use ftc_simulate::closed_loop::Record;
use ftc_simulate::{Trajectory, Variant};
use report::events::fault_intervals;
use report::figure::{Figure, Series};
use report::page::{Block, Column, KeyNumber, Page, Row, Section, Table};
use report::style;
use report::text::{aligned, number, significant, with_unit};

/// The two that are compared.
const PAIR: [Variant; 2] = [Variant::Ftc, Variant::Predictive];

/// Faults whose curves are drawn, by key.
const DRAWN: [&str; 5] = [
    "v_bias",
    "v_gain_loss",
    "v_stuck",
    "v_dropout",
    "i_gain_loss",
];

/// Everything, the comparison first.
pub fn page(design: &Design, trials: &[Trial]) -> Page {
    let mut sections = vec![
        Section::new("The paper’s Table 2, on a declared plant")
            .paragraph(
                "The paper gives neither the parameters of its converter nor the fault behind its two numbers. Here is \
                 the same comparison on a plant that anyone can run again, with and without fault, and for what the plant \
                 does (true) beside what its sensor says (measured).",
            )
            .with(Block::Table(table_2(trials))),
        Section::new("Every fault").with(Block::Table(every_fault(trials))),
    ];
    for trial in trials.iter().filter(|t| DRAWN.contains(&t.case.key)) {
        sections.extend(drawn(design, trial));
    }
    sections.push(
        Section::new("All numbers")
            .with(Block::Table(all(trials)))
            .with(Block::Facts(facts(design))),
    );
    Page {
        title: "AC/DC converter: fault-tolerant against predictive control".into(),
        lead: lead(trials),
        key_numbers: key_numbers(trials),
        sections,
        footer: format!(
            "Made by ftc-fmu {} (reproduce converter) from examples/converter.toml; converter.json and converter.csv beside this \
             page hold the same numbers.",
            env!("CARGO_PKG_VERSION")
        ),
    }
}

/// True VAF of the judged output under a fault.
fn vaf(trial: &Trial, variant: Variant) -> f64 {
    trial.vaf(variant).first().copied().unwrap_or(f64::NAN)
}

fn faulty(trials: &[Trial]) -> impl Iterator<Item = &Trial> {
    trials.iter().filter(|trial| trial.case.fault.is_some())
}

/// By how much the proposed controller's true VAF is above that of MPC.
fn lead_over_mpc(trial: &Trial) -> f64 {
    vaf(trial, Variant::Ftc) - vaf(trial, Variant::Predictive)
}

/// Faults under which the proposed controller is ahead by more than the noise explains.
fn ahead(trials: &[Trial]) -> usize {
    let clear = |trial: &&Trial| lead_over_mpc(trial) > noise_gain(trial);
    faulty(trials).filter(clear).count()
}

/// VAF that the noise of the faulty sensor alone would cost, in percent: less is no difference.
fn noise_gain(trial: &Trial) -> f64 {
    let (Some((sensor, _)), Some(run)) = (trial.case.fault, trial.of(Variant::Ftc)) else {
        return 0.0;
    };
    let column = |pick: fn(&Record, usize) -> f64| -> Vec<f64> {
        run.records
            .iter()
            .map(|record| pick(record, sensor))
            .collect()
    };
    let noise = column(|record, sensor| record.noise[sensor]);
    100.0 * variance(&noise) / variance(&column(|record, sensor| record.reference[sensor]))
}

fn variance(values: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let centre = mean(values);
    let squares: Vec<f64> = values
        .iter()
        .map(|value| (value - centre).powi(2))
        .collect();
    mean(&squares)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[middle],
        _ => (values[middle - 1] + values[middle]) / 2.0,
    }
}

fn lead(trials: &[Trial]) -> String {
    format!(
        "A three-phase PWM rectifier holds its DC voltage and reactive current while its load doubles and pulsates; one of \
         the two sensors fails for half of the time. The proposed controller estimates the fault and takes it out of the \
         measurement; model predictive control (MPC) has the same model, noise and limits, but no fault compensation. With a \
         fault the proposed controller follows the reference clearly better in {} of {} cases.",
        ahead(trials),
        faulty(trials).count()
    )
}

fn key_numbers(trials: &[Trial]) -> Vec<KeyNumber> {
    let key = |value: String, meaning: &str| KeyNumber {
        value,
        meaning: meaning.into(),
    };
    let middle = |variant| median(faulty(trials).map(|trial| vaf(trial, variant)).collect());
    let healthy = |variant| {
        let trial = trials.iter().find(|trial| trial.case.fault.is_none());
        joined(&trial.map_or_else(Vec::new, |trial| trial.vaf(variant)))
    };
    vec![
        key(
            format!("{} %", aligned(middle(Variant::Ftc), 1)),
            "true VAF of the output whose sensor fails, proposed FTC, median over the faults",
        ),
        key(
            format!("{} %", aligned(middle(Variant::Predictive), 1)),
            "the same with MPC",
        ),
        key(
            format!("{} of {}", ahead(trials), faulty(trials).count()),
            "faults under which the proposed FTC is clearly ahead",
        ),
        key(
            healthy(Variant::Ftc),
            "VAF (%) without fault: voltage / current, proposed FTC",
        ),
        key(healthy(Variant::Predictive), "the same with MPC"),
    ]
}

fn joined(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| aligned(*value, 1)).collect();
    values.join(" / ")
}

/// Mean over the tracked outputs without fault, and over the faults of each sensor.
fn table_2(trials: &[Trial]) -> Table {
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let over = |pick: fn(&OutputMerits) -> f64, of: fn(&Trial) -> bool| {
        PAIR.map(|variant| {
            let judged = trials.iter().filter(|trial| of(trial));
            mean(
                judged
                    .flat_map(|trial| trial.judged(variant))
                    .map(pick)
                    .collect(),
            )
        })
    };
    let truth = |merit: &OutputMerits| merit.true_output.vaf;
    let measured = |merit: &OutputMerits| merit.measured.vaf;
    let healthy = |trial: &Trial| trial.case.fault.is_none();
    let voltage = |trial: &Trial| trial.case.fault.is_some_and(|(sensor, _)| sensor == 0);
    let current = |trial: &Trial| trial.case.fault.is_some_and(|(sensor, _)| sensor == 1);
    let lines = [
        ("reported in the paper", REPORTED),
        ("true, no fault, mean of both outputs", over(truth, healthy)),
        (
            "true, voltage sensor fails, mean over the faults",
            over(truth, voltage),
        ),
        (
            "true, current sensor fails, mean over the faults",
            over(truth, current),
        ),
        ("measured, no fault", over(measured, healthy)),
        ("measured, voltage sensor fails", over(measured, voltage)),
        ("measured, current sensor fails", over(measured, current)),
    ];
    let rows = lines.iter().enumerate().map(|(place, (what, values))| Row {
        cells: std::iter::once((*what).to_string())
            .chain(values.iter().map(|value| aligned(*value, 2)))
            .collect(),
        emphasised: (1..4).contains(&place),
        begins_group: place == 1 || place == 4,
    });
    Table {
        caption: "VAF in percent".into(),
        columns: vec![
            Column::words(""),
            Column::number("proposed FTC"),
            Column::number("MPC"),
        ],
        rows: rows.collect(),
        notes: vec![
            "Measured, the two may change places: a controller that uses a faulty reading makes that reading follow the reference. \
             Samples without a reading are left out of the measured figures."
                .into(),
        ],
    }
}

fn sensor_name(trial: &Trial) -> &'static str {
    match trial.case.fault {
        None => "–",
        Some((0, _)) => "DC voltage",
        Some(_) => "reactive current",
    }
}

fn every_fault(trials: &[Trial]) -> Table {
    let mut columns = vec![Column::name("sensor"), Column::name("fault")];
    columns.extend(COMPARED.map(|variant| Column::number(name(variant))));
    let rows = trials.iter().enumerate().map(|(place, trial)| {
        let first = place == 0 || sensor_name(&trials[place - 1]) != sensor_name(trial);
        let sensor = if first { sensor_name(trial) } else { "" };
        let mut cells = vec![sensor.to_string(), trial.case.words.clone()];
        cells.extend(COMPARED.map(|variant| {
            let values = trial.vaf(variant);
            let values: Vec<String> = values.iter().map(|v| aligned(*v, 2)).collect();
            values.join(" / ")
        }));
        Row {
            cells,
            begins_group: first && place > 0,
            ..Row::default()
        }
    });
    Table {
        caption: format!(
            "True VAF (%) of the output whose sensor is faulty from {} to {} s; without fault, of voltage / current",
            number(FAULTY[0]),
            number(FAULTY[1])
        ),
        columns,
        rows: rows.collect(),
        notes: notes(trials),
    }
}

/// Why it is lower where it is lower, from the numbers of the run.
fn notes(trials: &[Trial]) -> Vec<String> {
    let mut notes = Vec::new();
    let names = |pick: fn(f64, f64) -> bool| -> Vec<String> {
        faulty(trials)
            .filter(|trial| pick(lead_over_mpc(trial), noise_gain(trial)))
            .map(|trial| format!("{}, {}", sensor_name(trial), trial.case.words))
            .collect()
    };
    let level = names(|lead, noise| lead.abs() <= noise);
    if !level.is_empty() {
        notes.push(format!(
            "Level, by less than the noise of the sensor is worth: {}. A lost reading misleads no controller, the model \
             of the current is exact, and both reach a new reference in the one sample that no controller can save.",
            level.join("; ")
        ));
    }
    let behind = names(|lead, noise| lead < -noise);
    if !behind.is_empty() {
        notes.push(format!("MPC is ahead with: {}.", behind.join("; ")));
    }
    notes.push(
        "The load doubles at the very instant of a step of the voltage’s reference. For the response length after it \
         no residual means anything: the last estimate is held as long as it agrees with the linear model, and then the \
         model alone carries the loop. There the proposed controller loses most of what it loses."
            .into(),
    );
    notes
}

/// Output and fault estimate under one fault.
fn drawn(design: &Design, trial: &Trial) -> Option<Section> {
    let (sensor, _) = trial.case.fault?;
    let run = trial.of(Variant::Ftc)?;
    let others: Vec<&Trajectory> = PAIR.iter().rev().filter_map(|v| trial.of(*v)).collect();
    let heading = format!("{}: {}", sensor_name(trial), trial.case.words);
    let section = Section::new(capitalised(&heading)).figures(vec![
        response(design, trial, run, &others, sensor),
        estimate(design, trial, run, sensor),
    ]);
    Some(section)
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// A label with the unit of an output.
fn label(design: &Design, what: &str, output: usize) -> String {
    with_unit(what, design.signals.outputs[output].unit.as_deref())
}

fn response(
    design: &Design,
    trial: &Trial,
    run: &Trajectory,
    others: &[&Trajectory],
    sensor: usize,
) -> Figure {
    let te = design.plant.sample_time;
    let output = &design.signals.outputs[sensor].name;
    let mut figure = figure(
        run,
        design,
        (
            format!("{}-output", trial.case.key),
            format!("True {output}"),
            label(design, output, sensor),
        ),
        &fault_intervals(run, sensor),
    );
    for other in others {
        let points = curve(other, te, |record| record.y_true[sensor]);
        figure = figure.with(style::variant(name(other.variant), other.variant, points));
    }
    figure.with(style::reference(curve(run, te, |record| {
        record.reference[sensor]
    })))
}

fn estimate(design: &Design, trial: &Trial, run: &Trajectory, sensor: usize) -> Figure {
    let te = design.plant.sample_time;
    let truth = curve(run, te, |record| {
        if record.y[sensor].is_finite() {
            record.fault[sensor]
        } else {
            f64::NAN
        }
    });
    let found = curve(run, te, |record| record.f_hat[sensor]);
    figure(
        run,
        design,
        (
            format!("{}-fault", trial.case.key),
            "Fault and its estimate".into(),
            label(design, "fault", sensor),
        ),
        &fault_intervals(run, sensor),
    )
    .with(style::true_fault(truth))
    .with(Series::new("estimate", found).step())
}

/// MSE and VAF, true and measured.
fn all(trials: &[Trial]) -> Table {
    let mut rows = Vec::new();
    for trial in trials {
        for (place, variant) in COMPARED.into_iter().enumerate() {
            let title = match trial.case.fault {
                None => trial.case.words.clone(),
                Some(_) => format!("{}: {}", sensor_name(trial), trial.case.words),
            };
            let mut cells = vec![if place == 0 { title } else { String::new() }];
            cells.push(name(variant).into());
            let outputs = trial.outputs(variant);
            cells.extend(outputs.iter().map(|m| significant(m.true_output.mse)));
            cells.extend(outputs.iter().map(|m| aligned(m.true_output.vaf, 2)));
            cells.extend(outputs.iter().map(|m| significant(m.measured.mse)));
            cells.extend(outputs.iter().map(|m| aligned(m.measured.vaf, 2)));
            rows.push(Row {
                cells,
                emphasised: variant == Variant::Ftc,
                begins_group: place == 0 && !rows.is_empty(),
            });
        }
    }
    Table {
        caption: "Both outputs under every fault; MSE in V² and A²".into(),
        columns: vec![
            Column::words("fault"),
            Column::name("controller"),
            Column::number("true MSE v"),
            Column::number("i"),
            Column::number("true VAF v (%)"),
            Column::number("i"),
            Column::number("measured MSE v"),
            Column::number("i"),
            Column::number("measured VAF v (%)"),
            Column::number("i"),
        ],
        rows,
        notes: Vec::new(),
    }
}

/// The plant and both controllers.
fn facts(design: &Design) -> Vec<(String, String)> {
    let mut facts = Vec::new();
    let mut fact = |name: &str, value: String| facts.push((name.to_string(), value));
    if let TruePlant::Rectifier(plant) = &design.true_plant {
        let loads: Vec<String> = plant.loads.iter().map(|load| number(*load)).collect();
        fact(
            "Plant",
            "three-phase PWM rectifier, averaged, nonlinear; integrated with error control".into(),
        );
        fact(
            "Lines",
            format!(
                "{} H, {} Ω, {} V phase amplitude",
                number(plant.inductance),
                number(plant.resistance),
                number(plant.phase_voltage)
            ),
        );
        fact(
            "DC link",
            format!(
                "{} F, {} V",
                number(plant.capacitance),
                number(plant.dc_voltage)
            ),
        );
        fact("Loads", format!("{} Ω, one mode each", loads.join(" and ")));
        fact(
            "Current loops",
            format!("first order, {} s", number(plant.current_loop)),
        );
    }
    let te = design.plant.sample_time;
    let estimator = &design.controller.estimator;
    fact("Sample time", format!("{} s", number(te)));
    fact(
        "Proposed FTC",
        format!(
            "gains by the corrected Theorem 2 from the linearisations, certified under arbitrary switching; reference window of {} \
             samples; virtual sensor",
            estimator.response_length
        ),
    );
    fact(
        "MPC",
        format!(
            "linear, offset-free, input limits; horizon {HORIZON} samples, input weight {}; its filter is told noise and \
             disturbance",
            number(INPUT_WEIGHT)
        ),
    );
    facts
}
