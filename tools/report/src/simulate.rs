//! Every variant of the loop, simulated natively side by side and written down sample by sample.

use crate::robustness;
use crate::table::{Table, number};
use crate::{Digest, warnings};
use ftc_baselines::comparison::{BaselineError, Baselines, Bound};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::Dimensions;
use ftc_simulate::closed_loop::{Loop, Merits, Record};
use ftc_simulate::warnings::RunWatch;
use ftc_simulate::{PlantSimulator, Variant, run};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

/// Everything that `simulate` writes beside the samples, and what it says.
#[non_exhaustive]
pub struct Simulation {
    /// Name and contents of every file.
    pub files: Vec<(String, Vec<u8>)>,
    /// The figures of merit as a table for a person.
    pub summary: String,
    /// What its user should know of the design and of the runs.
    pub warnings: Vec<String>,
}

/// Where samples go as they are made; none is kept otherwise.
pub trait Samples {
    /// Takes one sample of every run; the order of the runs is always the same.
    ///
    /// # Errors
    /// What keeps it from being taken; the simulation ends then.
    fn take(&mut self, runs: &[(Variant, Record)]) -> io::Result<()>;
}

/// Name of the table of all samples, see [`TableOfSamples`].
pub const TABLE: &str = "trajectories.csv";

/// A table that takes more bytes than this is refused.
const MOST_BYTES: u64 = 64 << 30;
/// Bytes of a number in the table, with its comma.
const NUMBER: u64 = 20;

/// What a simulation takes, known before anything is designed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Extent {
    /// Samples of each run.
    pub steps: u64,
    /// Runs of the scenario, those of plants that depart from the model among them.
    pub runs: u64,
    /// About how many bytes the table of all samples takes on the disk.
    pub bytes: u64,
}

impl Extent {
    /// Of a scenario for a plant of these sizes with so many tracked outputs.
    pub fn new(size: Dimensions, tracked: usize, steps: u64, baselines: bool) -> Self {
        let shared = 2 + tracked + size.disturbances + 2 * size.outputs;
        let own = 5 * size.outputs + 2 * size.states + size.inputs;
        let kept = if baselines { 5 } else { 3 };
        Self {
            steps,
            runs: kept + 2 * ftc_simulate::robustness::count(size) as u64,
            bytes: steps * NUMBER * (shared as u64 + kept * own as u64),
        }
    }

    /// Refuses what would fill a usual disk.
    ///
    /// # Errors
    /// The estimate, and what would fit.
    pub fn check(&self) -> Result<(), SimulateError> {
        if self.bytes <= MOST_BYTES {
            return Ok(());
        }
        let share = MOST_BYTES as f64 / self.bytes as f64;
        Err(SimulateError::TooLong {
            steps: self.steps,
            gigabytes: self.bytes >> 30,
            most: (share * self.steps as f64) as u64,
        })
    }
}

/// Why a simulation leaves no files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// There is no such baseline for this design.
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    /// The samples would fill a usual disk.
    #[error(
        "scenario.steps is {steps}: {TABLE} would take about {gigabytes} GB on the disk: give at most {most}"
    )]
    TooLong {
        /// Samples asked for.
        steps: u64,
        /// What they would take.
        gigabytes: u64,
        /// Samples that would fit.
        most: u64,
    },
    /// The samples could not be taken where they went.
    #[error("the samples cannot be written ({0})")]
    Samples(#[from] io::Error),
    /// The directory that gets the files.
    #[error(transparent)]
    Output(#[from] output::Error),
}

/// As [`simulate`], with the samples in [`TABLE`] and all files in a directory, or none; `told` hears how
/// many samples are done, one after the other.
///
/// # Errors
/// As [`simulate`], or a directory that cannot be written to.
pub fn simulate_into(
    out: &Path,
    design: &Design,
    warnings: Vec<String>,
    baselines: bool,
    told: &dyn Fn(u64),
) -> Result<Simulation, SimulateError> {
    let staging = output::Staging::new(out)?;
    let mut outcome = None;
    staging.add_written(TABLE, |file| {
        let table = TableOfSamples::new(file, design.plant.sample_time);
        let mut samples = Counted {
            table,
            told,
            done: 0,
        };
        let found = simulate(design, warnings, baselines, &mut samples);
        if let Err(SimulateError::Samples(error)) = found {
            return Err(error);
        }
        outcome = Some(found);
        samples.table.finish()
    })?;
    let found = outcome.unwrap_or_else(|| Err(io::Error::other("none was made").into()))?;
    staging.add_all(&found.files)?;
    staging.commit()?;
    Ok(found)
}

/// The table of samples, and how many it holds.
struct Counted<'a, W: Write> {
    table: TableOfSamples<W>,
    told: &'a dyn Fn(u64),
    done: u64,
}

impl<W: Write> Samples for Counted<'_, W> {
    fn take(&mut self, runs: &[(Variant, Record)]) -> io::Result<()> {
        self.done += 1;
        (self.told)(self.done);
        self.table.take(runs)
    }
}

/// Runs the scenario in every variant, and with every baseline if asked for:
/// `metrics.json`, `robustness.json` and the report. `warnings` are those of the design. Memory does not
/// grow with the length of the scenario beyond a point: what the page shows is thinned as it comes.
///
/// # Errors
/// A baseline that cannot be made for this design, a scenario too long to be written, or samples that
/// are not taken.
pub fn simulate(
    design: &Design,
    mut warnings: Vec<String>,
    baselines: bool,
    samples: &mut dyn Samples,
) -> Result<Simulation, SimulateError> {
    let feedback = &design.controller.feedback;
    let (size, steps) = (design.plant.dimensions(), design.scenario.steps);
    Extent::new(size, feedback.tracked.len(), steps, baselines).check()?;
    let Gathered {
        digests,
        watches,
        bound,
    } = gather(design, baselines, samples)?;
    warnings.extend(warnings::of_runs(design, &watches));
    let metrics = metrics(&digests, bound.as_deref(), &warnings);
    let cases = ftc_simulate::robustness::cases(design, &controller(design));
    let worse = robustness::warnings(design, &cases);
    let tried = format!("{:#}\n", robustness::json(design, &cases, &worse));
    warnings.extend(worse);
    let mut files = vec![
        ("metrics.json".to_string(), metrics.into_bytes()),
        ("robustness.json".to_string(), tried.into_bytes()),
    ];
    let section = robustness::section(design, &cases);
    let page = crate::files(design, &digests, &warnings, section);
    files.extend(
        page.into_iter()
            .map(|(name, text)| (name, text.into_bytes())),
    );
    Ok(Simulation {
        files,
        summary: summary(design, &digests, bound.as_deref()) + &robustness::text(design, &cases),
        warnings,
    })
}

/// What is kept of all runs.
struct Gathered<'a> {
    digests: Vec<Digest>,
    /// Each with the first tick that it could not be integrated through.
    watches: Vec<(RunWatch<'a>, Option<u64>)>,
    bound: Option<Vec<f64>>,
}

/// Runs all loops side by side.
fn gather<'a>(
    design: &'a Design,
    baselines: bool,
    samples: &mut dyn Samples,
) -> Result<Gathered<'a>, SimulateError> {
    let plant = plant(design);
    let controller = controller(design);
    let mut compared = match baselines {
        true => Some(Baselines::new(design, &plant)?),
        false => None,
    };
    let mut bound = compared.as_ref().map(|_| Bound::new(design));
    let tolerant = |variant| (variant, Loop::tolerant(&plant, &controller, variant));
    let mut loops: Vec<(Variant, Loop<'_>)> = Variant::ALL.map(tolerant).into();
    if let Some(compared) = &mut compared {
        loops.extend(compared.loops(&plant));
    }
    let mut digests: Vec<Digest> = loops
        .iter()
        .map(|(variant, _)| Digest::new(design, *variant))
        .collect();
    let mut watches: Vec<RunWatch<'a>> = loops
        .iter()
        .map(|(variant, _)| RunWatch::new(design, *variant))
        .collect();
    let mut sample = Vec::with_capacity(loops.len());
    for _ in 0..design.scenario.steps {
        sample.clear();
        for (at, (variant, closed)) in loops.iter_mut().enumerate() {
            closed.tick();
            let record = closed.record();
            digests[at].see(&record, closed.stalled().is_none());
            watches[at].see(&record);
            sample.push((*variant, record));
        }
        if let (Some(bound), Some((_, first))) = (&mut bound, sample.first()) {
            bound.see(first);
        }
        samples.take(&sample)?;
        for (_, closed) in &mut loops {
            closed.advance();
        }
    }
    let stalled = loops.iter().map(|(_, closed)| closed.stalled());
    Ok(Gathered {
        digests,
        watches: watches.into_iter().zip(stalled).collect(),
        bound: bound.map(|bound| bound.bounds()),
    })
}

/// `trajectories.csv`, one row per sample: `t`, `mode` and the signals of the scenario, then those of
/// each variant.
pub struct TableOfSamples<W: Write> {
    sample_time: f64,
    sink: Option<W>,
    table: Option<Table<W>>,
    row: Vec<String>,
}

impl<W: Write> TableOfSamples<W> {
    /// A table that goes where it is told as it grows; `sample_time` in seconds.
    pub fn new(sink: W, sample_time: f64) -> Self {
        Self {
            sample_time,
            sink: Some(sink),
            table: None,
            row: Vec::new(),
        }
    }

    /// Writes what has not been written yet.
    ///
    /// # Errors
    /// What the sink says.
    pub fn finish(self) -> io::Result<()> {
        match self.table {
            Some(table) => table.finish().map(drop).map_err(unwritten),
            None => Ok(()),
        }
    }
}

/// What the sink said, of its kind.
fn unwritten(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        kind => io::Error::other(format!("{kind:?}")),
    }
}

impl<W: Write> Samples for TableOfSamples<W> {
    fn take(&mut self, runs: &[(Variant, Record)]) -> io::Result<()> {
        let Some((_, first)) = runs.first() else {
            return Ok(());
        };
        if let Some(sink) = self.sink.take() {
            let table = Table::into_sink(sink, header(first, runs)).map_err(unwritten)?;
            self.table = Some(table);
        }
        let row = &mut self.row;
        row.clear();
        row.push(number(first.tick as f64 * self.sample_time));
        row.push((first.mode + 1).to_string());
        for (_, values) in shared(first) {
            row.extend(values.iter().map(|&value| number(value)));
        }
        for (_, record) in runs {
            for (_, values) in own(record) {
                row.extend(values.iter().map(|&value| number(value)));
            }
            let flags = record.flagged.iter();
            row.extend(flags.map(|&flag| u8::from(flag).to_string()));
            row.extend(record.mode_hat.map(|mode| (mode + 1).to_string()));
        }
        match &mut self.table {
            Some(table) => table.row(&*row).map_err(unwritten),
            None => Ok(()),
        }
    }
}

fn plant(design: &Design) -> PlantSimulator {
    PlantSimulator::with_true_plant(
        design.plant.clone(),
        design.true_plant.clone(),
        design.scenario.clone(),
    )
}

fn controller(design: &Design) -> Controller {
    Controller::new(design.parameters()).expect("a finished design has matching sizes")
}

/// One variant of the design's scenario.
pub(crate) fn one(design: &Design, variant: Variant) -> Digest {
    let run = run(&plant(design), &controller(design), variant);
    Digest::of(design, &run)
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

fn header(record: &Record, runs: &[(Variant, Record)]) -> Vec<String> {
    let vector = |prefix: &str, name: &str, size: usize| -> Vec<String> {
        (1..=size).map(|i| format!("{prefix}{name}[{i}]")).collect()
    };
    let mut names = vec!["t".to_string(), "mode".to_string()];
    for (name, values) in shared(record) {
        names.extend(vector("", name, values.len()));
    }
    for (variant, record) in runs {
        let prefix = format!("{}.", variant.key());
        for (name, values) in own(record) {
            names.extend(vector(&prefix, name, values.len()));
        }
        names.extend(vector(&prefix, "fault", record.flagged.len()));
        if record.mode_hat.is_some() {
            names.push(format!("{prefix}mode_hat"));
        }
    }
    names
}

/// Per variant `mse` and `vaf`, each measured and true, one number per tracked output; of the
/// deadbeat bound the true `mse` alone. Where the mode is found from the readings, in how many samples
/// another was found than the plant was in, and at most how many in a row. Beside them the `warnings`, one
/// sentence each.
fn metrics(runs: &[Digest], bound: Option<&[f64]>, warnings: &[String]) -> String {
    let of = |run: &Digest| {
        let merits = run.merits();
        let list = |pick: fn(&Merits) -> f64| merits.iter().map(pick).collect::<Vec<f64>>();
        let mut value = json!({
            "mse": { "measured": list(|m| m.measured.mse), "true": list(|m| m.true_output.mse) },
            "vaf": { "measured": list(|m| m.measured.vaf), "true": list(|m| m.true_output.vaf) },
        });
        if let Some(wrong) = run.wrong_modes() {
            value["wrong_mode"] = json!({ "samples": wrong.samples, "longest": wrong.longest });
        }
        (run.variant.key().to_string(), value)
    };
    let mut variants: Map<String, Value> = runs.iter().map(of).collect();
    if let Some(mse) = bound {
        variants.insert(BOUND.into(), json!({ "mse": { "true": mse } }));
    }
    variants.insert("warnings".into(), json!(warnings));
    format!("{:#}\n", Value::Object(variants))
}

/// Name of the deadbeat bound in files.
const BOUND: &str = "deadbeat_bound";

/// The same as a small table for a person.
fn summary(design: &Design, runs: &[Digest], bound: Option<&[f64]>) -> String {
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
    for run in runs {
        let merits = run.merits();
        for (row, (merits, &output)) in merits.iter().zip(tracked).enumerate() {
            let varies = run.varies(row);
            constant |= !varies;
            let vaf = |value: f64| match varies {
                true => format!("{value:.3}"),
                false => "-".into(),
            };
            let _ = writeln!(
                text,
                "{:<16}{:<12}{:>14.5e}{:>14.5e}{:>12}{:>12}",
                run.variant.key(),
                design.signals.outputs[output].name,
                merits.measured.mse,
                merits.true_output.mse,
                vaf(merits.measured.vaf),
                vaf(merits.true_output.vaf),
            );
        }
    }
    for (mse, &output) in bound.unwrap_or_default().iter().zip(tracked) {
        let name = &design.signals.outputs[output].name;
        let _ = writeln!(text, "{BOUND:<16}{name:<12}{:>14}{mse:>14.5e}", "");
    }
    for wrong in runs.iter().filter_map(Digest::wrong_modes) {
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
