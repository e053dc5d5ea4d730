//! The page of the paper's example.

use super::claims::Claims;
use super::reachable::REPORTED;
use super::{CHANNELS, ControllerKind, NOISES, REFERENCES, Record, Run, Shown};
use crate::experiment::{OutputMerits, curve, figure};
use report::events::{any_fault_intervals, fault_intervals};
use report::figure::{Figure, Series};
use report::page::{Block, Column, KeyNumber, Page, Row, Section, Table};
use report::style;
use report::text::{aligned, number, significant};

/// Everything, the verdicts first.
pub fn page(record: &Record, claims: &Claims) -> Page {
    let mut sections = vec![
        Section::new("What the paper says, what is found, and why")
            .with(Block::Table(said(claims))),
    ];
    sections.extend(record.shown.as_ref().map(shown));
    sections.push(
        Section::new("Which references reach the reported figures")
            .with(Block::Table(reach(record))),
    );
    sections.push(runs(record).with(Block::Table(controllers())));
    Page {
        title: "The paper’s example, reproduced".into(),
        lead: format!(
            "Yahia, Bedoui, Abderrahim, “Sensor Fault Tolerant Control for Hybrid Systems With Sinusoidal Disturbance”, \
             section VII-A: two modes, a slow sine as disturbance, both sensors wrong by 0.5 for more than half of the time. \
             The method works, but not as printed: with corrected inequalities and a healthy database its true mean square error \
             is at most {} times that of a controller told the fault, in all {} runs.",
            aligned(record.worst_over_told(ControllerKind::Proposed), 3),
            record
                .runs
                .iter()
                .filter(|r| r.controller == ControllerKind::Proposed)
                .count()
        ),
        key_numbers: key_numbers(record, claims),
        sections,
        footer: format!(
            "Made by ftc-fmu {} (reproduce paper) from examples/paper.toml and examples/paper_output.toml; paper.json and \
             paper.csv beside this page hold the same numbers.",
            env!("CARGO_PKG_VERSION")
        ),
    }
}

fn key_numbers(record: &Record, claims: &Claims) -> Vec<KeyNumber> {
    let key = |value: String, meaning: &str| KeyNumber {
        value,
        meaning: meaning.into(),
    };
    let infeasible = claims.theorems.iter().filter(|t| !t.feasible).count();
    vec![
        key(
            format!(
                "{} ×",
                aligned(record.worst_over_told(ControllerKind::Proposed), 3)
            ),
            "the true error of a controller told the fault: proposed FTC, worst of all runs",
        ),
        key(
            format!(
                "{} ×",
                number(record.best_over_told(ControllerKind::AdditiveSliding))
            ),
            "the same for additive FTC as printed, best of all runs",
        ),
        key(
            format!("{} ×", number(record.best_over_told(ControllerKind::NoFtc))),
            "the same without FTC, best of all runs",
        ),
        key(
            format!("{infeasible} of {}", claims.theorems.len()),
            "printed theorems that have no solution for any plant",
        ),
        key(
            format!("≤ {}", aligned(claims.largest_variance, 3)),
            "variance of the output that the reported MSE and VAF allow",
        ),
    ]
}

fn said(claims: &Claims) -> Table {
    let rows = claims.words.iter().map(|claim| Row {
        cells: [&claim.subject, &claim.paper, &claim.found, &claim.why]
            .map(String::clone)
            .into(),
        ..Row::default()
    });
    Table {
        caption: "Numbers in parentheses are the paper’s equations".into(),
        columns: vec![
            Column::name("about"),
            Column::words("the paper says"),
            Column::words("found"),
            Column::words("why"),
        ],
        rows: rows.collect(),
        notes: Vec::new(),
    }
}

/// The figures that correspond to the paper's 2 to 6.
fn shown(shown: &Shown) -> Section {
    let outputs = (0..2)
        .filter_map(|output| response(shown, output))
        .collect();
    let faults = (0..2)
        .filter_map(|sensor| estimate(shown, sensor))
        .collect();
    let inputs = (0..2).filter_map(|input| command(shown, input)).collect();
    Section::new("Figures 2 to 6")
        .paragraph(
            "Reference “levels”, disturbance on the state, noise 0.005. Drawn is the true output, which no sensor of a \
             faulty loop shows. A curve that would flatten all others is cut off.",
        )
        .figures(outputs)
        .figures(faults)
        .figures(inputs)
}

/// Figures 2 and 3: the outputs.
fn response(shown: &Shown, output: usize) -> Option<Figure> {
    let te = shown.design.plant.sample_time;
    let run = shown.of(ControllerKind::Proposed)?;
    let mut figure = figure(
        run,
        &shown.design,
        (
            format!("figure-{}", output + 2),
            format!("Figure {}: output y{}", output + 2, output + 1),
            format!("y{}", output + 1),
        ),
        &fault_intervals(run, output),
    );
    for who in [
        ControllerKind::AdditiveSliding,
        ControllerKind::ToldTheFault,
        ControllerKind::Proposed,
    ] {
        let points = curve(shown.of(who)?, te, |record| record.y_true[output]);
        figure = figure.with(style::variant(who.name(), who.variant(), points));
    }
    Some(figure.with(style::reference(curve(run, te, |record| {
        record.reference[output]
    }))))
}

/// Figure 4: the fault and its estimates.
fn estimate(shown: &Shown, sensor: usize) -> Option<Figure> {
    let te = shown.design.plant.sample_time;
    let run = shown.of(ControllerKind::Proposed)?;
    let truth = curve(run, te, |record| record.fault[sensor]);
    let printed = curve(shown.of(ControllerKind::AdditiveSliding)?, te, |record| {
        record.f_hat[sensor]
    });
    let found = curve(run, te, |record| record.f_hat[sensor]);
    let figure = figure(
        run,
        &shown.design,
        (
            format!("figure-4-{}", sensor + 1),
            format!("Figure 4: fault of sensor {}", sensor + 1),
            format!("fault of y{}", sensor + 1),
        ),
        &fault_intervals(run, sensor),
    );
    Some(
        figure
            .with(style::true_fault(truth))
            .with(
                style::variant(
                    "sliding window, printed",
                    ControllerKind::AdditiveSliding.variant(),
                    printed,
                )
                .step(),
            )
            .with(Series::new("reference window", found).step()),
    )
}

/// Figures 5 and 6: the inputs.
fn command(shown: &Shown, input: usize) -> Option<Figure> {
    let te = shown.design.plant.sample_time;
    let run = shown.of(ControllerKind::Proposed)?;
    let mut figure = figure(
        run,
        &shown.design,
        (
            format!("figure-{}", input + 5),
            format!("Figure {}: input u{}", input + 5, input + 1),
            format!("u{}", input + 1),
        ),
        &any_fault_intervals(run),
    );
    for who in [ControllerKind::ToldTheFault, ControllerKind::Proposed] {
        let points = curve(shown.of(who)?, te, |record| record.u[input]);
        figure = figure.with(style::variant(who.name(), who.variant(), points).step());
    }
    Some(figure)
}

fn reach(record: &Record) -> Table {
    let rows = record.references.iter().map(|reference| Row {
        cells: vec![
            reference.name.into(),
            aligned(reference.variance, 3),
            significant(reference.deadbeat.mse),
            aligned(reference.deadbeat.vaf, 2),
            significant(reference.proposed.mse),
            aligned(reference.proposed.vaf, 2),
            reference.verdict(),
        ],
        emphasised: reference.reached(),
        begins_group: false,
    });
    Table {
        caption: format!(
            "MSE {} and VAF {} % against four references: first output, no noise, disturbance on the state",
            number(REPORTED.mse),
            number(REPORTED.vaf)
        ),
        columns: vec![
            Column::name("reference"),
            Column::number("variance"),
            Column::number("deadbeat MSE"),
            Column::number("VAF (%)"),
            Column::number("proposed MSE"),
            Column::number("VAF (%)"),
            Column::words("verdict"),
        ],
        rows: rows.collect(),
        notes: vec![
            "Deadbeat: the output repeats the reference one sample late, from rest. No causal controller of \
             this plant whose output rests on the reference when that jumps has a smaller mean square error, whatever \
             it knows of the fault; on a smooth one, as the sine, a response that runs ahead a little is better still."
                .into(),
        ],
    }
}

fn runs(record: &Record) -> Section {
    let mut section = Section::new("All runs").paragraph(
        "Mean of both outputs; each on its own in paper.csv. True: what the plant does. Measured: what its sensor says, \
         fault and noise included. Over told: the true MSE over that of the proposed gains told the fault; other gains \
         may come out below 1. Deadbeat bound: the output repeats the reference one sample late; a bound wherever the reference jumps.",
    );
    for (channel, _) in CHANNELS {
        for noise in NOISES {
            section = section.with(Block::Table(table(record, channel, noise)));
        }
    }
    section
}

fn table(record: &Record, channel: &str, noise: f64) -> Table {
    let mut rows = Vec::new();
    for reference in REFERENCES {
        let group: Vec<&Run> = ControllerKind::ALL
            .into_iter()
            .filter_map(|controller| record.run(channel, reference, noise, controller))
            .collect();
        for (place, run) in group.iter().enumerate() {
            rows.push(Row {
                cells: cells(run, place == 0),
                emphasised: run.controller == ControllerKind::Proposed,
                begins_group: place == 0 && !rows.is_empty(),
            });
        }
        rows.extend(group.first().map(|run| bound(run)));
    }
    let noise = if noise == 0.0 {
        "no noise".into()
    } else {
        format!("noise {noise}")
    };
    Table {
        caption: format!("Disturbance on the {channel}, {noise}"),
        columns: vec![
            Column::name("reference"),
            Column::name("controller"),
            Column::number("true MSE"),
            Column::number("true VAF (%)"),
            Column::number("measured MSE"),
            Column::number("measured VAF (%)"),
            Column::number("over told"),
        ],
        rows,
        notes: Vec::new(),
    }
}

fn cells(run: &Run, first: bool) -> Vec<String> {
    let mean = |pick: fn(&OutputMerits) -> f64| {
        run.outputs.iter().map(pick).sum::<f64>() / run.outputs.len() as f64
    };
    vec![
        if first { run.reference } else { "" }.into(),
        run.controller.name().into(),
        significant(mean(|m| m.true_output.mse)),
        aligned(mean(|m| m.true_output.vaf), 2),
        significant(mean(|m| m.measured.mse)),
        aligned(mean(|m| m.measured.vaf), 2),
        significant(run.over_told),
    ]
}

/// The bound that needs no controller; its mean square error only.
fn bound(run: &Run) -> Row {
    let mean = run.deadbeat_bound / run.outputs.len() as f64;
    let mut cells = vec![String::new(), "deadbeat bound".into(), significant(mean)];
    cells.resize(7, String::new());
    Row {
        cells,
        ..Row::default()
    }
}

fn controllers() -> Table {
    let rows = ControllerKind::ALL.map(|controller| Row {
        cells: vec![controller.name().into(), controller.explanation().into()],
        emphasised: controller == ControllerKind::Proposed,
        ..Row::default()
    });
    Table {
        caption: "The controllers compared".into(),
        columns: vec![Column::name("controller"), Column::words("what it does")],
        rows: rows.into(),
        notes: Vec::new(),
    }
}
