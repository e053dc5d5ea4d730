//! The page of one design: what happened in its scenario, with and without fault tolerance.

pub mod events;
mod facts;
mod figures;
mod tables;

use crate::page::{Block, KeyNumber, Page, Section};
use crate::svg;
use crate::text::{self, count, list, number};
use events::Alarms;
pub use figures::Scene;
use ftc_design::{Design, Signal};
use ftc_simulate::{Trajectory, Variant};

/// The page of a simulated design as `report.html`, and each of its figures as `KEY.svg`: name and
/// contents of every file.
///
/// The trajectories may be any of the variants, in any order; what is missing is left out.
/// `warnings` are sentences that stand first.
pub fn files(
    design: &Design,
    trajectories: &[Trajectory],
    warnings: &[String],
) -> Vec<(String, String)> {
    let page = page(design, trajectories, warnings);
    let figures = page
        .figures()
        .map(|figure| (format!("{}.svg", figure.key), svg::document(figure)));
    let mut files: Vec<_> = figures.collect();
    files.push(("report.html".into(), page.render()));
    files
}

/// Every variant, the one the page is about first.
const RANKING: [Variant; 5] = [
    Variant::Ftc,
    Variant::ToldTheFault,
    Variant::Predictive,
    Variant::Additive,
    Variant::NoFtc,
];

/// What a variant is called everywhere on the page.
fn variant_name(variant: Variant) -> &'static str {
    match variant {
        Variant::Ftc => "with FTC",
        Variant::NoFtc => "without FTC",
        Variant::ToldTheFault => "told the fault",
        Variant::Additive => "additive FTC (printed)",
        Variant::Predictive => "predictive control",
    }
}

fn find(trajectories: &[Trajectory], variant: Variant) -> Option<&Trajectory> {
    trajectories.iter().find(|run| run.variant == variant)
}

/// The description of signal `index`, or `symbol[index + 1]` where the design describes none.
fn name_of(signals: &[Signal], index: usize, symbol: &str) -> String {
    signals.get(index).map_or_else(
        || format!("{symbol}[{}]", index + 1),
        |signal| signal.name.clone(),
    )
}

fn unit_of(signals: &[Signal], index: usize) -> Option<&str> {
    signals.get(index).and_then(|signal| signal.unit.as_deref())
}

/// The whole page.
pub fn page(design: &Design, trajectories: &[Trajectory], warnings: &[String]) -> Page {
    let scene = Scene::new(design, trajectories);
    let mut sections = Vec::new();
    if !warnings.is_empty() {
        let section = Section::new("Warnings");
        sections.push(warnings.iter().fold(section, Section::paragraph));
    }
    sections.extend([
        Section::new("Outputs")
            .paragraph(
                "What the plant really does (the true output, which no sensor of the faulty loop shows) with and \
                 without fault-tolerant control (FTC), beside the same controller told the true fault. Thin grey is what the sensor says in the loop with FTC. Shaded: the fault of this sensor is present.",
            )
            .figures(scene.outputs()),
        Section::new("Figures of merit")
            .with(Block::Table(tables::merits(design, trajectories)))
            .with(Block::Table(tables::variants(trajectories))),
    ]);
    let faults = scene.faults();
    if !faults.is_empty() {
        sections.push(
            Section::new("Sensor faults")
                .paragraph(
                    "The fault that is really there and the estimate that the controller takes out of the loop; below it \
                     the residual against the threshold. The threshold widens where the present input lies outside \
                     what the healthy database covers; drawn is its narrowest value.",
                )
                .figures(faults)
                .figures(scene.residuals()),
        );
    }
    sections.push(Section::new("Inputs").figures(scene.inputs()));
    let disturbances = scene.disturbances();
    if !disturbances.is_empty() {
        sections.push(Section::new("Disturbance").figures(disturbances));
    }
    sections.push(Section::new("Design").with(Block::Facts(facts::facts(design))));
    sections.push(
        Section::new("Modes and sensors")
            .with(Block::Table(tables::modes(design)))
            .with(Block::Table(tables::sensors(design))),
    );
    Page {
        title: format!("{}: fault-tolerant control, simulated", design.name),
        lead: lead(design, trajectories),
        key_numbers: key_numbers(design, trajectories),
        sections,
        footer: format!(
            "Made by ftc-fmu {} from the design “{}”. The figures lie beside this page as SVG files.",
            env!("CARGO_PKG_VERSION"),
            design.name
        ),
    }
}

/// What happened, in a few sentences.
fn lead(design: &Design, trajectories: &[Trajectory]) -> String {
    let plant = &design.controller.plant;
    let Some(run) = find(trajectories, Variant::Ftc).or(trajectories.first()) else {
        return "Nothing was simulated.".into();
    };
    let te = plant.sample_time;
    let samples = run.records.len();
    let mut sentences = vec![format!(
        "The loop ran for {} s ({} of {} s) through {}.",
        number(samples as f64 * te),
        count(samples, "sample"),
        number(te),
        count(events::modes_visited(run), "mode")
    )];
    let faulty: Vec<String> = (0..plant.dimensions().outputs)
        .filter(|sensor| !events::fault_intervals(run, *sensor).is_empty())
        .map(|sensor| name_of(&design.signals.outputs, sensor, "y"))
        .collect();
    if faulty.is_empty() {
        sentences.push("No sensor was faulty.".into());
        return sentences.join(" ");
    }
    let noun = if faulty.len() == 1 {
        "sensor"
    } else {
        "sensors"
    };
    sentences.push(format!(
        "During part of it, the {noun} {} did not tell the truth.",
        list(&faulty)
    ));
    if let Some((without, against_told)) = ratios(design, trajectories) {
        sentences.push(format!(
            "With fault-tolerant control (FTC) the mean square error of the true outputs behind these sensors was {}, and \
             {} a controller that was told the true fault.",
            beside_without(without),
            beside_told(against_told)
        ));
    }
    sentences.join(" ")
}

/// Smallest `MSE without FTC / MSE with FTC` and largest `MSE with FTC / MSE told the fault` over
/// the tracked outputs whose own sensor fails (over all tracked ones if none of these does), true signals.
fn ratios(design: &Design, trajectories: &[Trajectory]) -> Option<(f64, f64)> {
    let tracked = &design.controller.feedback.tracked;
    let ftc = find(trajectories, Variant::Ftc)?;
    let mut outputs: Vec<usize> = (0..tracked.len())
        .filter(|index| !events::fault_intervals(ftc, tracked[*index]).is_empty())
        .collect();
    if outputs.is_empty() {
        outputs = (0..tracked.len()).collect();
    }
    let errors = |variant| -> Option<Vec<f64>> {
        let merits = find(trajectories, variant)?.merits(tracked);
        Some(
            outputs
                .iter()
                .map(|index| merits[*index].truth.mse)
                .collect(),
        )
    };
    let over = |above: &[f64], below: &[f64], pick: fn(f64, f64) -> f64| {
        above
            .iter()
            .zip(below)
            .map(|(a, b)| a / b)
            .reduce(pick)
            .filter(|ratio| ratio.is_finite())
    };
    let with = errors(Variant::Ftc)?;
    let without = over(&errors(Variant::NoFtc)?, &with, f64::min)?;
    let against_told = over(&with, &errors(Variant::ToldTheFault)?, f64::max)?;
    Some((without, against_told))
}

/// How much smaller an error is than without FTC, as the middle of a sentence.
fn beside_without(ratio: f64) -> String {
    if ratio > 1.1 {
        format!("at least {} times smaller than without it", rounded(ratio))
    } else if ratio > 1.0 / 1.1 {
        "about the same as without it for at least one of them".into()
    } else {
        format!(
            "up to {} times larger than without it",
            rounded(1.0 / ratio)
        )
    }
}

/// How an error compares with that of a controller told the fault, as the middle of a sentence.
fn beside_told(ratio: f64) -> String {
    let difference = 100.0 * (ratio - 1.0);
    if difference <= 0.0 {
        "no larger than that of".into()
    } else if difference < 10.0 {
        format!("at most {} % larger than that of", rounded(difference))
    } else {
        format!("up to {} times that of", rounded(ratio))
    }
}

/// Three significant digits.
fn rounded(value: f64) -> String {
    let digits = if value >= 100.0 {
        0
    } else if value >= 10.0 {
        1
    } else {
        2
    };
    if value < 1e5 {
        text::aligned(value, digits)
    } else {
        number(value)
    }
}

fn key_numbers(design: &Design, trajectories: &[Trajectory]) -> Vec<KeyNumber> {
    let key = |value: String, meaning: &str| KeyNumber {
        value,
        meaning: meaning.into(),
    };
    let mut keys = Vec::new();
    if let Some((without, against_told)) = ratios(design, trajectories) {
        keys.push(key(
            format!("{} ×", rounded(without)),
            "as large a true mean square error without FTC, at least",
        ));
        keys.push(key(
            format!("{} ×", text::aligned(against_told, 3)),
            "the true mean square error of a controller told the fault, at most",
        ));
    }
    if let Some(run) = find(trajectories, Variant::Ftc) {
        let alarms = Alarms::of(run);
        if alarms.onsets > 0 {
            keys.push(key(
                format!("{} of {}", alarms.found, alarms.onsets),
                "sensor faults found",
            ));
        }
        if let Some(delay) = alarms.longest_delay {
            keys.push(key(
                count(delay as usize, "sample"),
                "longest delay from a fault to its detection",
            ));
        }
        keys.push(key(
            alarms.false_alarms.to_string(),
            "false alarms of healthy sensors",
        ));
    }
    keys
}
