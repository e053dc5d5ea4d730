//! The page of a campaign: what an engineer wants to know of thousands of runs.

use crate::histogram::Histogram;
use crate::{Partial, Statistics};
use ftc_design::Design;
use ftc_plant::Deviation;
use report::figure::{Dash, Figure, Ink, Point, Series};
use report::page::{Block, Column, KeyNumber, Page, Row, Section, Table};
use report::text::significant;
use serde_json::{Value, json};
use std::fmt::Write;

/// Quantiles that are told, and what they are called.
const QUANTILES: [(f64, &str); 4] = [(0.5, "half"), (0.9, "90 %"), (0.99, "99 %"), (1.0, "worst")];
/// A curve is drawn from the least number up to this share of the runs: beyond it lies the tail.
const SHOWN: f64 = 0.999;

/// The page as HTML. `asked` is the number of runs that were wanted.
pub fn html(design: &Design, whole: &Partial, asked: u64) -> String {
    page(design, whole, asked).render()
}

/// The page.
pub fn page(design: &Design, whole: &Partial, asked: u64) -> Page {
    let statistics = &whole.statistics;
    Page {
        title: format!("{}: campaign of {} runs", design.name, statistics.runs),
        lead: lead(design, whole, asked),
        key_numbers: key_numbers(statistics),
        sections: vec![
            errors(statistics),
            healthy(statistics),
            detection(design, statistics),
            isolation(design, statistics),
            worst(statistics, whole),
        ],
        footer: format!(
            "Seed {}; {}; faults up to {} thresholds, at most {} in a run. Quantiles are exact to 1 %.",
            whole.options.seed,
            model_error(whole.options.model_error),
            whole.options.largest_fault,
            whole.options.most_faults
        ),
    }
}

fn lead(design: &Design, whole: &Partial, asked: u64) -> String {
    let runs = whole.statistics.runs;
    let part = match runs < asked {
        true => format!(" These are {runs} of the {asked} runs that were asked for."),
        false => String::new(),
    };
    let (_, deviation) = design.true_plant.clone().into_parts();
    let departs = match deviation == Deviation::default() {
        true => "",
        false => {
            " In every run the true plant departs from the model as [scenario.plant] says, too."
        }
    };
    let error = match whole.options.model_error > 0.0 {
        true => ", noise and an error of the model",
        false => " and noise",
    };
    let unstable =
        unstable(design, whole).map_or(String::new(), |sentence| format!(" {sentence}."));
    format!(
        "Each run draws other faults, a schedule of modes, references, a disturbance{error}, and is \
         done three times: with fault tolerance, without, and told the true fault.{departs}{unstable}{part}"
    )
}

/// Runs whose true plant is unstable where the model is not, in one sentence without its end.
pub fn unstable(design: &Design, whole: &Partial) -> Option<String> {
    let statistics = &whole.statistics;
    let most = statistics.most_unstable?;
    Some(format!(
        "In {} of {} runs the true plant is unstable where the model is not; the largest spectral radius of its A is \
         {:.4}, in mode {} ({}) of run {}",
        statistics.unstable_plants,
        statistics.runs,
        most.radius,
        most.mode + 1,
        design.plant.modes[most.mode].name,
        most.run
    ))
}

fn key_numbers(statistics: &Statistics) -> Vec<KeyNumber> {
    let key = |value: String, meaning: &str| KeyNumber {
        value,
        meaning: meaning.into(),
    };
    vec![
        key(
            quantile(&statistics.over_told, 0.5),
            "true error over that of the loop told the fault, in half of the runs at most",
        ),
        key(
            quantile(&statistics.over_told, 0.99),
            "the same, in 99 of 100 runs at most",
        ),
        key(
            percent(statistics.worse_than_none, statistics.faulty_runs),
            "of the runs with faults did worse than without fault tolerance",
        ),
        key(
            rate(statistics),
            "false alarms in a million samples of a healthy sensor",
        ),
    ]
}

/// A quantile as a person reads it.
pub fn quantile(histogram: &Histogram, share: f64) -> String {
    match histogram.quantile(share) {
        None => "-".into(),
        Some(value) if value.is_infinite() => "unbounded".into(),
        Some(value) => significant(value),
    }
}

fn percent(part: u64, whole: u64) -> String {
    match whole {
        0 => "-".into(),
        _ => format!("{:.2} %", 100.0 * part as f64 / whole as f64),
    }
}

fn rate(statistics: &Statistics) -> String {
    let alarms: u64 = statistics.false_alarms.iter().sum();
    let samples: u64 = statistics.healthy_samples.iter().sum();
    match samples {
        0 => "-".into(),
        _ => significant(1e6 * alarms as f64 / samples as f64),
    }
}

fn model_error(largest: f64) -> String {
    match largest > 0.0 {
        true => format!("model error up to {} %", 100.0 * largest),
        false => "no model error".into(),
    }
}

/// The share of all runs up to each number, on a scale of powers of ten.
fn distribution(name: &str, histogram: &Histogram, scale: fn(f64) -> f64) -> Series {
    let count = histogram.count().max(1) as f64;
    let points: Vec<Point> = histogram
        .cumulated()
        .filter(|(value, _)| *value > 0.0 && value.is_finite())
        .take_while(|(_, below)| *below as f64 <= SHOWN * count || count < 1000.0)
        .map(|(value, below)| [scale(value), 100.0 * below as f64 / count])
        .collect();
    Series::new(name, points).step()
}

/// The distribution of true errors over those without fault tolerance.
fn over_none(histogram: &Histogram) -> Series {
    distribution("over none", histogram, f64::log10)
        .ink(Ink::Vermilion)
        .dash(Dash::Dashed)
}

fn errors(statistics: &Statistics) -> Section {
    let share = "runs up to this (%)";
    let absolute = Figure::new(
        "errors",
        "True error of all runs",
        "log10 of the true error (nominal values)",
        share,
    )
    .with(
        distribution("told the fault", &statistics.error_told, f64::log10)
            .ink(Ink::Text)
            .dash(Dash::Dotted),
    )
    .with(
        distribution(
            "without fault tolerance",
            &statistics.error_without,
            f64::log10,
        )
        .ink(Ink::Vermilion)
        .dash(Dash::Dashed),
    )
    .with(distribution(
        "with fault tolerance",
        &statistics.error,
        f64::log10,
    ));
    let relative = Figure::new(
        "ratios",
        "What fault tolerance gains",
        "log10 of the ratio of true errors",
        share,
    )
    .with(over_none(&statistics.over_none))
    .with(distribution(
        "over told the fault",
        &statistics.over_told,
        f64::log10,
    ));
    let table = Table {
        caption: "Quantiles: so many of the runs have at most this".into(),
        columns: quantile_columns(),
        rows: vec![
            quantiles("with fault tolerance", &statistics.error),
            quantiles("without", &statistics.error_without),
            quantiles("told the fault", &statistics.error_told),
            quantiles("with, over told", &statistics.over_told),
            quantiles("with, over without", &statistics.over_none),
        ],
        notes: vec!["Root mean square over samples and tracked outputs, in nominal values.".into()],
    };
    Section::new("True error")
        .figures(vec![relative, absolute])
        .with(Block::Table(table))
}

/// What fault tolerance costs where there is nothing to tolerate.
fn healthy(statistics: &Statistics) -> Section {
    let healthy = &statistics.healthy;
    let section = Section::new("Runs without a fault");
    if healthy.runs == 0 {
        return section.with(Block::Paragraph("There was none.".into()));
    }
    let figure = Figure::new(
        "healthy",
        "What fault tolerance costs",
        "log10 of the ratio of true errors",
        "runs up to this (%)",
    )
    .with(over_none(&healthy.over_none));
    let table = Table {
        caption: "Quantiles: so many of the runs without a fault have at most this".into(),
        columns: quantile_columns(),
        rows: vec![
            quantiles("with fault tolerance", &healthy.error),
            quantiles("with, over without", &healthy.over_none),
        ],
        notes: vec![format!(
            "Of {} runs without a fault {} had a false alarm, and in {} the true error was more than 1 % larger than \
             without fault tolerance.",
            healthy.runs, healthy.flagged, healthy.worse_than_none
        )],
    };
    section.figures(vec![figure]).with(Block::Table(table))
}

fn quantile_columns() -> Vec<Column> {
    std::iter::once(Column::name("true error"))
        .chain(QUANTILES.iter().map(|(_, name)| Column::number(*name)))
        .collect()
}

fn quantiles(name: &str, histogram: &Histogram) -> Row {
    let values = QUANTILES
        .iter()
        .map(|(share, _)| quantile(histogram, *share));
    Row {
        cells: std::iter::once(name.to_string()).chain(values).collect(),
        ..Row::default()
    }
}

fn detection(design: &Design, statistics: &Statistics) -> Section {
    let mut figure = Figure::new(
        "delays",
        "How soon a fault is declared",
        "log10 of the samples since it began, and one",
        "of the declared faults (%)",
    );
    let looks = [
        (Ink::Blue, Dash::Solid),
        (Ink::Vermilion, Dash::Dashed),
        (Ink::Green, Dash::Chain),
        (Ink::Purple, Dash::Dotted),
        (Ink::Ochre, Dash::Dashed),
        (Ink::Text, Dash::Chain),
    ];
    let mut rows = Vec::new();
    for ((name, kind), (ink, dash)) in statistics.kinds.iter().zip(looks) {
        figure = figure.with(
            distribution(name, &kind.delay, f64::log10)
                .ink(ink)
                .dash(dash),
        );
        rows.push(Row {
            cells: vec![
                name.clone(),
                kind.count.to_string(),
                percent(kind.detected, kind.count),
                quantile(&kind.delay, 0.5),
                quantile(&kind.delay, 0.99),
            ],
            ..Row::default()
        });
    }
    let kinds = Table {
        caption: "Faults by kind".into(),
        columns: vec![
            Column::name("kind"),
            Column::number("faults"),
            Column::number("declared"),
            Column::number("after (half)"),
            Column::number("after (99 %)"),
        ],
        rows,
        notes: vec![
            "After so many samples and one. A fault below its threshold, one that leaves the reading as it is, or one that ends \
             early need not be declared."
                .into(),
        ],
    };
    let sensors = Table {
        caption: "False alarms".into(),
        columns: vec![
            Column::name("sensor"),
            Column::number("samples while healthy"),
            Column::number("false alarms"),
        ],
        rows: names(design)
            .iter()
            .zip(&statistics.healthy_samples)
            .zip(&statistics.false_alarms)
            .map(|((name, samples), alarms)| Row {
                cells: vec![name.clone(), samples.to_string(), alarms.to_string()],
                ..Row::default()
            })
            .collect(),
        notes: vec![format!(
            "{} of {} runs had a false alarm.",
            statistics.runs_with_false_alarm, statistics.runs
        )],
    };
    Section::new("Detection")
        .figures(vec![figure])
        .with(Block::Table(kinds))
        .with(Block::Table(sensors))
}

fn names(design: &Design) -> Vec<String> {
    let outputs = design.signals.outputs.iter();
    outputs.map(|output| output.name.clone()).collect()
}

fn isolation(design: &Design, statistics: &Statistics) -> Section {
    let names = names(design);
    let columns = std::iter::once(Column::name("faulty sensor"))
        .chain(names.iter().map(|name| Column::number(name.clone())))
        .chain([Column::number("none")])
        .collect();
    let rows = names
        .iter()
        .zip(&statistics.isolation)
        .map(|(name, counts)| Row {
            cells: std::iter::once(name.clone())
                .chain(counts.iter().map(ToString::to_string))
                .collect(),
            ..Row::default()
        })
        .collect();
    Section::new("Isolation").with(Block::Table(Table {
        caption: "Runs with one fault: which sensor was declared faulty first while it lasted"
            .into(),
        columns,
        rows,
        notes: Vec::new(),
    }))
}

fn worst(statistics: &Statistics, whole: &Partial) -> Section {
    let rows = statistics
        .worst
        .iter()
        .map(|worst| Row {
            cells: vec![
                worst.run.to_string(),
                significant(worst.over_told),
                significant(worst.over_none),
                worst.faults.clone(),
            ],
            ..Row::default()
        })
        .collect();
    Section::new("The worst runs").with(Block::Table(Table {
        caption: "Largest true error over that of the loop told the fault".into(),
        columns: vec![
            Column::number("run"),
            Column::number("over told"),
            Column::number("over none"),
            Column::words("what happened"),
        ],
        rows,
        notes: vec![format!(
            "See one sample by sample: ftc-fmu campaign DESIGN.toml --seed {} --replay RUN --out DIR, with the options of this campaign.",
            whole.options.seed
        )],
    }))
}

/// The numbers that a person looks at first.
pub fn text(whole: &Partial) -> String {
    let statistics = &whole.statistics;
    let mut text = format!(
        "{}: {} runs, of which {} without a fault\n\n{:<34}{:>12}{:>12}{:>12}{:>12}\n",
        whole.design,
        statistics.runs,
        statistics.healthy.runs,
        "true error",
        "half",
        "90 %",
        "99 %",
        "worst"
    );
    for (name, histogram) in [
        ("with fault tolerance", &statistics.error),
        ("without", &statistics.error_without),
        ("told the fault", &statistics.error_told),
        ("with, over told", &statistics.over_told),
        ("with, over without", &statistics.over_none),
        (
            "with, over without, no fault",
            &statistics.healthy.over_none,
        ),
    ] {
        let _ = write!(text, "{name:<34}");
        for (share, _) in QUANTILES {
            let _ = write!(text, " {:>11}", quantile(histogram, share));
        }
        text.push('\n');
    }
    let alarms: u64 = statistics.false_alarms.iter().sum();
    let samples: u64 = statistics.healthy_samples.iter().sum();
    let _ = writeln!(
        text,
        "\nworse than without in {} of {} runs with faults; {alarms} false alarms in {samples} samples of healthy sensors",
        statistics.worse_than_none, statistics.faulty_runs,
    );
    text
}

/// The same numbers for a program: quantiles, rates, and the parts that merge.
pub fn json(whole: &Partial, asked: u64) -> Value {
    let statistics = &whole.statistics;
    let healthy = &statistics.healthy;
    let quantiles = |histogram: &Histogram| {
        let of = |share: f64| histogram.quantile(share).filter(|value| value.is_finite());
        json!({ "p50": of(0.5), "p90": of(0.9), "p99": of(0.99), "max": of(1.0) })
    };
    json!({
        "runs": statistics.runs,
        "asked": asked,
        "summary": {
            "error": quantiles(&statistics.error),
            "error_without": quantiles(&statistics.error_without),
            "error_told": quantiles(&statistics.error_told),
            "over_told": quantiles(&statistics.over_told),
            "over_none": quantiles(&statistics.over_none),
            "healthy_error": quantiles(&healthy.error),
            "healthy_over_none": quantiles(&healthy.over_none),
        },
        "campaign": whole,
    })
}

/// What a program printed by [`json()`], read back, and the number of runs that were asked for.
///
/// # Errors
/// A text that is no such thing; reads as the end of a sentence that begins with the file's name.
pub fn read(text: &str) -> Result<(Partial, u64), ReadError> {
    let value: Value = serde_json::from_str(text)?;
    let whole = value.get("campaign").cloned().unwrap_or_default();
    let known = whole.is_object();
    let whole: Partial = serde_json::from_value(whole).map_err(|error| match known {
        true => ReadError::Other(error),
        false => ReadError::NoCampaign,
    })?;
    let asked = value.get("asked").and_then(Value::as_u64);
    let asked = asked.unwrap_or(whole.statistics.runs);
    Ok((whole, asked))
}

/// What was read is no result of a campaign, or one of another version.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Something else.
    #[error("is no result of a campaign ({0}): name a campaign.json")]
    No(#[from] serde_json::Error),
    /// Something else, in JSON.
    #[error("is no result of a campaign: name a campaign.json")]
    NoCampaign,
    /// Its fields are not today's.
    #[error("was written by another version, or changed since ({0}): run the campaign again")]
    Other(#[source] serde_json::Error),
}
