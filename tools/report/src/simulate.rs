//! Every variant of the loop, simulated natively and written down sample by sample.

use crate::robustness;
use crate::table::{Table, number};
use crate::warnings;
use ftc_control::Controller;
use ftc_design::Design;
use ftc_simulate::baselines::comparison::{self, BaselineError};
use ftc_simulate::closed_loop::{Merits, Record};
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::io::Write;

/// Everything that `simulate` writes, and what it says.
pub struct Simulation {
    /// Name and contents of every file but the table of [`write_table`](Self::write_table).
    pub files: Vec<(String, Vec<u8>)>,
    /// The figures of merit as a table for a person.
    pub summary: String,
    /// What its user should know of the design and of the runs.
    pub warnings: Vec<String>,
    /// Every variant and baseline, sample by sample.
    pub trajectories: Vec<Trajectory>,
    /// `Te` in seconds.
    pub sample_time: f64,
}

/// The file of [`Simulation::write_table`].
pub const TABLE: &str = "trajectories.csv";

/// A run that keeps more bytes than this one is refused.
const MOST_BYTES: u64 = 8 << 30;
/// Bytes of a list, apart from its numbers: where it is and how long, and what an allocation costs.
const LIST: u64 = 48;

/// About how many bytes the samples of `simulate` take: all of them are kept for figures and page.
pub fn memory(design: &Design, baselines: bool) -> u64 {
    let size = design.plant.dimensions();
    let tracked = design.controller.feedback.tracked.len();
    let numbers = tracked + size.disturbances + 6 * size.outputs + 2 * size.states + size.inputs;
    let (lists, runs) = (12, if baselines { 5 } else { 3 });
    let sample = size_of::<u64>() as u64 * (2 + numbers as u64) + lists * LIST;
    sample * runs * design.scenario.steps
}

/// Refuses a run that would keep more than a usual machine has.
fn check_memory(design: &Design, baselines: bool) -> Result<(), SimulateError> {
    let (bytes, steps) = (memory(design, baselines), design.scenario.steps);
    if bytes <= MOST_BYTES {
        return Ok(());
    }
    let share = MOST_BYTES as f64 / bytes as f64;
    Err(SimulateError::TooLong {
        steps,
        gigabytes: bytes >> 30,
        most: (share * steps as f64) as u64,
    })
}

/// Why a simulation leaves no files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// There is no such baseline for this design.
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    /// The samples would take more memory than a usual machine has.
    #[error(
        "scenario.steps is {steps}: simulate keeps every sample, which would take about {gigabytes} GB of memory: give at most {most}"
    )]
    TooLong {
        /// Samples asked for.
        steps: u64,
        /// What they would take.
        gigabytes: u64,
        /// Samples that would fit.
        most: u64,
    },
}

/// Runs the scenario in every variant, and with every baseline if asked for:
/// `metrics.json`, `robustness.json` and the report. `warnings` are those of the design.
///
/// # Errors
/// A baseline that cannot be made for this design, or a scenario too long to be kept.
pub fn simulate(
    design: &Design,
    mut warnings: Vec<String>,
    baselines: bool,
) -> Result<Simulation, SimulateError> {
    check_memory(design, baselines)?;
    let mut trajectories = trajectories(design);
    let mut bound = None;
    if baselines {
        trajectories.extend(comparison::trajectories(design, &plant(design))?);
        bound = Some(comparison::bound(design, &trajectories[0]));
    }
    warnings.extend(warnings::of_runs(design, &trajectories));
    let metrics = metrics(design, &trajectories, bound.as_deref(), &warnings);
    let cases = robustness::cases(design);
    let worse = robustness::warnings(design, &cases);
    let tried = format!("{:#}\n", robustness::json(&cases, &worse));
    warnings.extend(worse);
    let mut files = vec![
        ("metrics.json".to_string(), metrics.into_bytes()),
        ("robustness.json".to_string(), tried.into_bytes()),
    ];
    let section = robustness::section(design, &cases);
    let page = crate::files(design, &trajectories, &warnings, section);
    files.extend(
        page.into_iter()
            .map(|(name, text)| (name, text.into_bytes())),
    );
    Ok(Simulation {
        files,
        summary: summary(design, &trajectories, bound.as_deref())
            + &robustness::text(design, &cases),
        warnings,
        trajectories,
        sample_time: design.plant.sample_time,
    })
}

impl Simulation {
    /// Writes `trajectories.csv`, one row per sample: `t`, `mode` and the signals of the scenario, then
    /// those of each variant.
    ///
    /// # Errors
    /// What the sink says.
    pub fn write_table(&self, sink: impl Write) -> csv::Result<()> {
        let trajectories = &self.trajectories;
        let records = trajectories.first().map_or(&[][..], |run| &run.records);
        let Some(first) = records.first() else {
            return Ok(());
        };
        let mut table = Table::into_sink(sink, header(first, trajectories))?;
        let mut row = Vec::new();
        for (at, record) in records.iter().enumerate() {
            row.clear();
            let time = record.tick as f64 * self.sample_time;
            row.push(number(time));
            row.push((record.mode + 1).to_string());
            for (_, values) in shared(record) {
                row.extend(values.iter().map(|&value| number(value)));
            }
            for trajectory in trajectories {
                let record = &trajectory.records[at];
                for (_, values) in own(record) {
                    row.extend(values.iter().map(|&value| number(value)));
                }
                let flags = record.flagged.iter();
                row.extend(flags.map(|&flag| u8::from(flag).to_string()));
                row.extend(record.mode_hat.map(|mode| (mode + 1).to_string()));
            }
            table.row(&row)?;
        }
        table.finish().map(drop)
    }
}

fn plant(design: &Design) -> PlantSimulator {
    PlantSimulator::with_true_plant(
        design.plant.clone(),
        design.true_plant.clone(),
        design.scenario.clone(),
    )
}

/// Every variant of the design's scenario.
pub fn trajectories(design: &Design) -> Vec<Trajectory> {
    Variant::ALL
        .iter()
        .map(|&variant| one(design, variant))
        .collect()
}

/// One variant of the design's scenario.
pub fn one(design: &Design, variant: Variant) -> Trajectory {
    let controller =
        Controller::new(design.parameters()).expect("a finished design has matching sizes");
    run(&plant(design), &controller, variant)
}

/// Signals that are the same in every variant.
fn shared(record: &Record) -> [(&'static str, &[f64]); 4] {
    [
        ("y_ref", &record.reference),
        ("w", &record.disturbance),
        ("f", &record.fault),
        ("noise", &record.noise),
    ]
}

/// Signals of one variant; the flags follow them.
fn own(record: &Record) -> [(&'static str, &[f64]); 7] {
    [
        ("y", &record.y),
        ("y_true", &record.y_true),
        ("x", &record.x),
        ("u", &record.u),
        ("x_hat", &record.x_hat),
        ("f_hat", &record.f_hat),
        ("residual", &record.residual),
    ]
}

fn header(record: &Record, trajectories: &[Trajectory]) -> Vec<String> {
    let vector = |prefix: &str, name: &str, size: usize| -> Vec<String> {
        (1..=size).map(|i| format!("{prefix}{name}[{i}]")).collect()
    };
    let mut names = vec!["t".to_string(), "mode".to_string()];
    for (name, values) in shared(record) {
        names.extend(vector("", name, values.len()));
    }
    for trajectory in trajectories {
        let prefix = format!("{}.", trajectory.variant.key());
        for (name, values) in own(record) {
            names.extend(vector(&prefix, name, values.len()));
        }
        names.extend(vector(&prefix, "fault", record.flagged.len()));
        if trajectory.finds_the_mode() {
            names.push(format!("{prefix}mode_hat"));
        }
    }
    names
}

/// Per variant `mse` and `vaf`, each measured and true, one number per tracked output; of the
/// deadbeat bound the true `mse` alone. Where the mode is found from the readings, in how many samples
/// another was found than the plant was in, and at most how many in a row. Beside them the `warnings`, one sentence each.
fn metrics(
    design: &Design,
    trajectories: &[Trajectory],
    bound: Option<&[f64]>,
    warnings: &[String],
) -> String {
    let tracked = &design.controller.feedback.tracked;
    let of = |trajectory: &Trajectory| {
        let merits = trajectory.merits(tracked);
        let list = |pick: fn(&Merits) -> f64| merits.iter().map(pick).collect::<Vec<f64>>();
        let mut value = json!({
            "mse": { "measured": list(|m| m.measured.mse), "true": list(|m| m.truth.mse) },
            "vaf": { "measured": list(|m| m.measured.vaf), "true": list(|m| m.truth.vaf) },
        });
        if let Some(wrong) = trajectory.wrong_modes() {
            value["wrong_mode"] = json!({ "samples": wrong.samples, "longest": wrong.longest });
        }
        (trajectory.variant.key().to_string(), value)
    };
    let mut variants: Map<String, Value> = trajectories.iter().map(of).collect();
    if let Some(mse) = bound {
        variants.insert(BOUND.into(), json!({ "mse": { "true": mse } }));
    }
    variants.insert("warnings".into(), json!(warnings));
    format!("{:#}\n", Value::Object(variants))
}

/// Name of the deadbeat bound in files.
const BOUND: &str = "deadbeat_bound";

/// The same as a small table for a person.
fn summary(design: &Design, trajectories: &[Trajectory], bound: Option<&[f64]>) -> String {
    let mut text = format!(
        "{}: {} samples of {} s\n\n{:<16}{:<12}{:>14}{:>14}{:>12}{:>12}\n",
        design.name,
        design.scenario.steps,
        design.plant.sample_time,
        "variant",
        "output",
        "MSE measured",
        "MSE true",
        "VAF meas. %",
        "VAF true %",
    );
    let tracked = &design.controller.feedback.tracked;
    let mut constant = false;
    for trajectory in trajectories {
        let merits = trajectory.merits(tracked);
        for (row, (merits, &output)) in merits.iter().zip(tracked).enumerate() {
            let varies = varies(trajectory, row);
            constant |= !varies;
            let vaf = |value: f64| match varies {
                true => format!("{value:.3}"),
                false => "-".into(),
            };
            let _ = writeln!(
                text,
                "{:<16}{:<12}{:>14.5e}{:>14.5e}{:>12}{:>12}",
                trajectory.variant.key(),
                design.signals.outputs[output].name,
                merits.measured.mse,
                merits.truth.mse,
                vaf(merits.measured.vaf),
                vaf(merits.truth.vaf),
            );
        }
    }
    for (mse, &output) in bound.unwrap_or_default().iter().zip(tracked) {
        let name = &design.signals.outputs[output].name;
        let _ = writeln!(text, "{BOUND:<16}{name:<12}{:>14}{mse:>14.5e}", "");
    }
    for wrong in trajectories.iter().filter_map(Trajectory::wrong_modes) {
        let _ = writeln!(
            text,
            "\nmode found from the readings: another than the plant's in {} samples, at most {} in a row",
            wrong.samples, wrong.longest
        );
    }
    if constant {
        text.push_str(
            "\n-: VAF compares variances and means nothing where the reference is constant\n",
        );
    }
    text.push('\n');
    text
}

/// Whether the reference of a tracked output moves at all.
fn varies(trajectory: &Trajectory, row: usize) -> bool {
    let mut values = trajectory
        .records
        .iter()
        .map(|record| record.reference[row]);
    let first = values.next();
    values.any(|value| Some(value) != first)
}
