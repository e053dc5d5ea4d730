//! Logs of healthy operation: from CSV files to the stretches of each mode, or one sentence.
//!
//! A row is one sample: the inputs that act from it on and the outputs measured at it, in physical
//! units. Columns bear the user's signal names or `u[1]`, `y[1]` ...; `t` (seconds) and `mode`
//! (from 1) are optional, every other column is ignored.

use crate::{check, sentence, suggest, values::NameOrList};
use csv::{ReaderBuilder, StringRecord, Trim};
use ftc_design::commissioning::Database;
use ftc_design::{Signal, Signals};
use ftc_plant::{Mode, SwitchedPlant};
use nalgebra::DMatrix;
use std::fs::File;
use std::path::Path;

/// The most rows a log may have.
const LONGEST_LOG: usize = 1_000_000;
/// How far a time step may be from the sample time, relative to it: logs print rounded times.
const TIME_TOLERANCE: f64 = 0.05;

/// What is logged, and where.
pub struct Logs<'a> {
    /// The plant that was logged.
    pub plant: &'a SwitchedPlant,
    /// Names of its signals.
    pub signals: &'a Signals,
    /// The design file's directory.
    pub folder: &'a Path,
}

/// Where a row stands in its file.
#[derive(Clone, Copy)]
struct Place {
    /// Below the header, from 1.
    row: usize,
    /// In the file, from 1.
    line: u64,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "row {} (line {})", self.row, self.line)
    }
}

/// One sample of a log.
struct Row {
    mode: usize,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

/// The log of a mode (0-based).
pub fn file_of(files: &NameOrList, mode: usize) -> &str {
    match files {
        NameOrList::Name(file) => file,
        NameOrList::List(files) => files.get(mode).map_or("", String::as_str),
    }
}

/// Which column holds what.
struct Columns {
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    time: Option<usize>,
    mode: Option<usize>,
    names: Vec<String>,
}

impl Logs<'_> {
    /// The stretches of each mode: from one file with a `mode` column, or from one file per mode.
    ///
    /// # Errors
    /// One sentence that names the file, the row and the column.
    pub fn read(&self, files: &NameOrList) -> Result<Vec<Vec<Database>>, String> {
        let modes = self.plant.modes.len();
        let mut stretches = vec![Vec::new(); modes];
        match files {
            NameOrList::Name(file) => self.add(file, None, &mut stretches)?,
            NameOrList::List(files) if files.len() != modes => {
                return Err(format!(
                    "lists {} logs: give one per mode, {modes}, or one file with a mode column",
                    files.len()
                ));
            }
            NameOrList::List(files) => {
                for (mode, file) in files.iter().enumerate() {
                    self.add(file, Some(mode), &mut stretches)?;
                }
            }
        }
        match stretches.iter().position(Vec::is_empty) {
            Some(mode) => Err(format!(
                "has no sample of mode {} ({}): record healthy operation in every mode",
                mode + 1,
                self.plant.modes[mode].name
            )),
            None => self.check_alive(files, &stretches).map(|()| stretches),
        }
    }

    /// Refuses a sensor that says the same throughout a mode.
    fn check_alive(&self, files: &NameOrList, stretches: &[Vec<Database>]) -> Result<(), String> {
        let outputs = &self.signals.outputs;
        for (mode, stretches) in stretches.iter().enumerate() {
            let samples: usize = stretches.iter().map(Database::samples).sum();
            let still = |output: &usize| {
                let columns = stretches.iter().map(|log| log.outputs.column(*output));
                let [least, most] = columns
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, values| {
                        [ends[0].min(values.min()), ends[1].max(values.max())]
                    });
                samples > 1 && least == most
            };
            if let Some(output) = (0..outputs.len()).find(still) {
                return Err(format!(
                    "{}: mode {} ({}): {} never changes: record with a sensor that works",
                    sentence::shorten(file_of(files, mode)),
                    mode + 1,
                    self.plant.modes[mode].name,
                    outputs[output].name
                ));
            }
        }
        Ok(())
    }

    /// Adds the stretches of one file; all of it belongs to mode `only`, if given.
    fn add(
        &self,
        file: &str,
        only: Option<usize>,
        stretches: &mut [Vec<Database>],
    ) -> Result<(), String> {
        let rows = self
            .rows(&self.folder.join(file), only)
            .map_err(|what| format!("{}: {what}", sentence::shorten(file)))?;
        let mut first = 0;
        for stretch in rows.chunk_by(|one, next| one.mode == next.mode) {
            let mode = stretch[0].mode;
            stretches[mode].push(database(stretch, &self.plant.modes[mode], first));
            first += stretch.len();
        }
        Ok(())
    }

    fn rows(&self, path: &Path, only: Option<usize>) -> Result<Vec<Row>, String> {
        let file = File::open(path)
            .map_err(|error| format!("cannot be opened ({error}): check the path"))?;
        let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(file);
        let header = reader.headers().map_err(|error| damaged(&error))?.clone();
        let columns = self.columns(&header)?;
        if columns.mode.is_none() && only.is_none() && self.plant.modes.len() > 1 {
            return Err(format!(
                "the plant has {} modes, but there is no column mode: add one, or list one file per mode",
                self.plant.modes.len()
            ));
        }
        let mut rows = Vec::new();
        let mut before = None;
        for record in reader.records() {
            let record = record.map_err(|error| damaged(&error))?;
            let place = Place {
                row: rows.len() + 1,
                line: record.position().map_or(0, csv::Position::line),
            };
            if rows.len() == LONGEST_LOG {
                return Err(format!("has more than {LONGEST_LOG} rows: shorten it"));
            }
            before = self.advance(&columns, &record, place, before)?;
            rows.push(self.row(&columns, &record, place, only)?);
        }
        match rows.is_empty() {
            true => Err("has no rows: record healthy operation".into()),
            false => Ok(rows),
        }
    }

    /// Finds the column of every signal.
    fn columns(&self, header: &StringRecord) -> Result<Columns, String> {
        let names: Vec<&str> = header.iter().collect();
        let known: Vec<&str> = [&self.signals.inputs, &self.signals.outputs]
            .into_iter()
            .flatten()
            .map(|signal| signal.name.as_str())
            .collect();
        let all = |letter: &str, signals: &[Signal]| -> Result<Vec<usize>, String> {
            let numbered = signals.iter().enumerate();
            numbered
                .map(|(index, signal)| {
                    let number = format!("{letter}[{}]", index + 1);
                    column(&names, &signal.name, &number, &known)
                })
                .collect()
        };
        let (inputs, outputs) = (
            all("u", &self.signals.inputs)?,
            all("y", &self.signals.outputs)?,
        );
        // A signal that is called t or mode keeps its column.
        let optional = |name: &str| -> Result<Option<usize>, String> {
            let found = once(&names, name)?;
            Ok(found.filter(|at| !inputs.contains(at) && !outputs.contains(at)))
        };
        Ok(Columns {
            time: optional("t")?,
            mode: optional("mode")?,
            names: names.iter().map(ToString::to_string).collect(),
            inputs,
            outputs,
        })
    }

    /// The time of a row; refuses a gap after the one before.
    fn advance(
        &self,
        columns: &Columns,
        record: &StringRecord,
        place: Place,
        before: Option<f64>,
    ) -> Result<Option<f64>, String> {
        let Some(at) = columns.time else {
            return Ok(None);
        };
        let now = columns.number(record, at, place)?;
        let step = self.plant.sample_time;
        match before {
            Some(before) if ((now - before) / step - 1.0).abs() > TIME_TOLERANCE => Err(format!(
                "{place}: t goes from {before} to {now}, but sample_time is {step}: \
                 record without gaps, one row per sample"
            )),
            _ => Ok(Some(now)),
        }
    }

    fn row(
        &self,
        columns: &Columns,
        record: &StringRecord,
        place: Place,
        only: Option<usize>,
    ) -> Result<Row, String> {
        let numbers = |at: &[usize]| -> Result<Vec<f64>, String> {
            at.iter()
                .map(|&at| columns.number(record, at, place))
                .collect()
        };
        Ok(Row {
            mode: self.mode(columns, record, place, only)?,
            inputs: numbers(&columns.inputs)?,
            outputs: numbers(&columns.outputs)?,
        })
    }

    /// The mode of a row: what its column says, and what the file is for.
    fn mode(
        &self,
        columns: &Columns,
        record: &StringRecord,
        place: Place,
        only: Option<usize>,
    ) -> Result<usize, String> {
        let Some(at) = columns.mode else {
            return Ok(only.unwrap_or(0));
        };
        let modes = self.plant.modes.len();
        let number = columns.number(record, at, place)?;
        let known = (1..=modes).find(|mode| *mode as f64 == number);
        match (known, only) {
            (Some(mode), Some(only)) if mode != only + 1 => Err(format!(
                "{place}: mode is {mode}, but this is the log of mode {}: keep to the order of the modes, \
                 or give one file with a mode column",
                only + 1
            )),
            (Some(mode), _) => Ok(mode - 1),
            (None, _) => Err(format!(
                "{place}: mode is {number}: modes are numbered from 1 to {modes}"
            )),
        }
    }
}

impl Columns {
    fn number(&self, record: &StringRecord, at: usize, place: Place) -> Result<f64, String> {
        let text = record.get(at).unwrap_or_default();
        let value = text.parse::<f64>().ok();
        value
            .filter(|value| check::number(*value).is_ok())
            .ok_or_else(|| {
                let found = match text.is_empty() {
                    true => "is empty".to_string(),
                    false => format!("holds '{}'", sentence::shorten(text)),
                };
                format!(
                    "{place}, column {}, {found}: a log needs a finite number in every cell",
                    self.names[at]
                )
            })
    }
}

/// The column of a signal, under the user's name or under its number. A column that bears the name
/// of another signal, among those `known`, was not meant.
fn column(names: &[&str], name: &str, number: &str, known: &[&str]) -> Result<usize, String> {
    if let Some(at) = once(names, name)?.map_or_else(|| once(names, number), |at| Ok(Some(at)))? {
        return Ok(at);
    }
    if let [single] = names
        && single.contains([';', '\t'])
    {
        return Err("has a single column: separate columns by commas".into());
    }
    let wanted = match name == number {
        true => name.to_string(),
        false => format!("{name} or {number}"),
    };
    let free: Vec<&str> = names
        .iter()
        .copied()
        .filter(|name| !known.contains(name))
        .collect();
    let advice = match free.is_empty() {
        true => "add it".into(),
        false => suggest::nearest(name, &free),
    };
    Err(format!("has no column {wanted}: {advice}"))
}

/// Where a name stands, if it does; refuses a name that stands twice.
fn once(names: &[&str], wanted: &str) -> Result<Option<usize>, String> {
    let mut found = (0..names.len()).filter(|&at| names[at] == wanted);
    match (found.next(), found.next()) {
        (_, Some(_)) => Err(format!("has two columns {wanted}: keep one of them")),
        (first, None) => Ok(first),
    }
}

fn damaged(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => format!(
            "line {} has {len} cells, but the header has {expected_len}: give every row a cell for each column",
            pos.as_ref().map_or(0, csv::Position::line)
        ),
        csv::ErrorKind::Utf8 { pos, .. } => format!(
            "line {} is not UTF-8: save the log as UTF-8 text",
            pos.as_ref().map_or(0, csv::Position::line)
        ),
        _ => format!("cannot be read ({error}): name a CSV file"),
    }
}

/// Rows of one mode, about its operating point; `first` is the number of the first one.
fn database(rows: &[Row], mode: &Mode, first: usize) -> Database {
    let about = |pick: fn(&Row) -> &Vec<f64>, point: &[f64]| {
        DMatrix::from_fn(rows.len(), point.len(), |k, i| pick(&rows[k])[i] - point[i])
    };
    Database {
        first,
        inputs: about(|row| &row.inputs, &mode.operating_point.u),
        outputs: about(|row| &row.outputs, &mode.operating_point.y),
    }
}
