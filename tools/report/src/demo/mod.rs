//! The page of one design: what happened in its scenario, with and without fault tolerance.

mod digest;
pub mod events;
mod figures;
mod tables;

use crate::page::{Block, KeyNumber, Page, Section};
use crate::summary;
use crate::svg;
use crate::text::{self, count, list, number};
pub use digest::Digest;
pub use figures::Scene;
use ftc_design::{Design, Signal};
use ftc_plant::Mode;
use ftc_simulate::Variant;

/// The page of a simulated design as `report.html`, and each of its figures as `KEY.svg`: name and
/// contents of every file.
///
/// The runs may be of any of the variants, in any order; what is missing is left out.
/// `warnings` are sentences that stand first.
pub fn files(
    design: &Design,
    runs: &[Digest],
    warnings: &[String],
    robustness: Section,
) -> Vec<(String, String)> {
    let mut page = page(design, runs, warnings);
    let merits = page
        .sections
        .iter()
        .position(|section| section.heading == MERITS);
    page.sections
        .insert(merits.map_or(0, |at| at + 1), robustness);
    let figures = page
        .figures()
        .map(|figure| (format!("{}.svg", figure.key), svg::document(figure)));
    let mut files: Vec<_> = figures.collect();
    files.push(("report.html".into(), page.render()));
    files
}

/// Heading of the section that compares the variants.
const MERITS: &str = "Figures of merit";

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

fn find(runs: &[Digest], variant: Variant) -> Option<&Digest> {
    runs.iter().find(|run| run.variant == variant)
}

/// The description of signal `index`, or `symbol[index + 1]` where the design describes none.
fn name_of(signals: &[Signal], index: usize, symbol: &str) -> String {
    signals.get(index).map_or_else(
        || format!("{symbol}[{}]", index + 1),
        |signal| signal.name.clone(),
    )
}

/// `mode 2`, and its name where the user gave one that says more.
fn mode_name(modes: &[Mode], index: usize) -> String {
    let number = index + 1;
    match modes.get(index) {
        Some(mode)
            if !mode.name.is_empty()
                && mode.name != number.to_string()
                && mode.name != format!("mode {number}") =>
        {
            format!("mode {number}: {}", mode.name)
        }
        _ => format!("mode {number}"),
    }
}

fn unit_of(signals: &[Signal], index: usize) -> Option<&str> {
    signals.get(index).and_then(|signal| signal.unit.as_deref())
}

/// The whole page.
pub fn page(design: &Design, runs: &[Digest], warnings: &[String]) -> Page {
    let scene = Scene::new(design, runs);
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
        Section::new(MERITS)
            .with(Block::Table(tables::merits(design, runs)))
            .with(Block::Table(tables::variants(runs))),
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
    let report = summary::sections(design).into_iter();
    sections.extend(report.map(|(title, lines)| Section::new(title).with(Block::Facts(lines))));
    sections.push(
        Section::new("Modes and sensors")
            .with(Block::Table(tables::modes(design)))
            .with(Block::Table(tables::sensors(design))),
    );
    Page {
        title: format!("{}: fault-tolerant control, simulated", design.name),
        lead: lead(design, runs),
        key_numbers: key_numbers(design, runs),
        sections,
        footer: format!(
            "Made by ftc-fmu {} from the design “{}”. The figures lie beside this page as SVG files.",
            env!("CARGO_PKG_VERSION"),
            design.name
        ),
    }
}

/// What happened, in a few sentences.
fn lead(design: &Design, runs: &[Digest]) -> String {
    let plant = &design.plant;
    let Some(run) = find(runs, Variant::Ftc).or(runs.first()) else {
        return "Nothing was simulated.".into();
    };
    let te = plant.sample_time;
    let samples = run.samples();
    let mut sentences = vec![format!(
        "The loop ran for {} s ({} of {} s) through {}.",
        number(samples as f64 * te),
        count(samples as usize, "sample"),
        number(te),
        count(run.modes_visited(), "mode")
    )];
    let faulty: Vec<String> = (0..plant.dimensions().outputs)
        .filter(|sensor| !run.fault_intervals(*sensor).is_empty())
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
        "During part of it, the {noun} {} had a fault.",
        list(&faulty)
    ));
    if let Some((without, against_told)) = ratios(design, runs) {
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
fn ratios(design: &Design, runs: &[Digest]) -> Option<(f64, f64)> {
    let tracked = &design.controller.feedback.tracked;
    let ftc = find(runs, Variant::Ftc)?;
    let mut outputs: Vec<usize> = (0..tracked.len())
        .filter(|index| !ftc.fault_intervals(tracked[*index]).is_empty())
        .collect();
    if outputs.is_empty() {
        outputs = (0..tracked.len()).collect();
    }
    let errors = |variant| -> Option<Vec<f64>> {
        let merits = find(runs, variant)?.merits();
        Some(
            outputs
                .iter()
                .map(|index| merits[*index].true_output.mse)
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

fn key_numbers(design: &Design, runs: &[Digest]) -> Vec<KeyNumber> {
    let key = |value: String, meaning: &str| KeyNumber {
        value,
        meaning: meaning.into(),
    };
    let mut keys = Vec::new();
    if let Some((without, against_told)) = ratios(design, runs) {
        keys.push(key(
            format!("{} ×", rounded(without)),
            "as large a true mean square error without FTC, at least",
        ));
        keys.push(key(
            format!("{} ×", text::aligned(against_told, 3)),
            "the true mean square error of a controller told the fault, at most",
        ));
    }
    if let Some(run) = find(runs, Variant::Ftc) {
        let alarms = run.alarms();
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
