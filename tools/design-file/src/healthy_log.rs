//! Logs of healthy operation: from CSV files to the stretches of each mode, or one sentence.
//!
//! A row is one sample: the inputs that act from it on and the outputs measured at it, in physical
//! units. Columns have the user's signal names or `u[1]`, `y[1]` ...; a time column and `mode`
//! (from 1) are optional, every other column is ignored.

use crate::{check, notes::Notes, sentence, suggest, values::NameOrList};
use ftc_design::commissioning::Database;
use ftc_design::words::counted;
use ftc_design::{Signal, Signals};
use ftc_plant::{Mode, SwitchedPlant};
use ftc_tables::{Clock, Place, Row as Cells, Table, TimeColumn, find_time_column};
use nalgebra::DMatrix;
use std::path::Path;

/// Why a log cannot be used: the end of a sentence that begins with its name.
type Unusable = Box<dyn std::error::Error>;

/// What is logged, and where.
pub(crate) struct Logs<'a> {
    /// The plant that was logged.
    pub(crate) plant: &'a SwitchedPlant,
    /// Names of its signals.
    pub(crate) signals: &'a Signals,
    /// The design file's directory.
    pub(crate) folder: &'a Path,
    /// The name of the time column, where the user gives it.
    pub(crate) time: Option<&'a str>,
    /// What the user should know of what was read.
    pub(crate) notes: &'a Notes,
}

/// One sample of a log.
struct Row {
    mode: usize,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

/// Which column holds what.
struct Columns {
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    time: Option<TimeColumn>,
    mode: Option<usize>,
}

impl Logs<'_> {
    /// The stretches of each mode: from one file with a `mode` column, or from one file per mode.
    ///
    /// # Errors
    /// The end of a sentence that begins with the key: it names the file, the row and the column.
    pub(crate) fn read(&self, files: &NameOrList) -> Result<Vec<Vec<Database>>, String> {
        let modes = self.plant.modes.len();
        let mut stretches = vec![Vec::new(); modes];
        match files {
            NameOrList::Name(file) => self.add(file, None, &mut stretches)?,
            NameOrList::List(files) if files.len() != modes => {
                return Err(format!(
                    "lists {}: give one per mode, {modes}, or one file with a mode column",
                    counted(files.len(), "log", "logs")
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
                ": {}: has no sample of mode {} ({}): record healthy operation in every mode",
                sentence::shorten(files.of_mode(mode)),
                mode + 1,
                self.plant.modes[mode].name
            )),
            None => self.check_moving(files, &stretches).map(|()| stretches),
        }
    }

    /// Refuses a sensor that says the same throughout a mode.
    fn check_moving(&self, files: &NameOrList, stretches: &[Vec<Database>]) -> Result<(), String> {
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
                    ": {}: mode {} ({}): {} never changes: record with a sensor that works",
                    sentence::shorten(files.of_mode(mode)),
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
            .map_err(|what| format!(": {}: {what}", sentence::shorten(file)))?;
        let mut first = 0;
        for stretch in rows.chunk_by(|one, next| one.mode == next.mode) {
            let mode = stretch[0].mode;
            stretches[mode].push(database(stretch, &self.plant.modes[mode], first));
            first += stretch.len();
        }
        Ok(())
    }

    fn rows(&self, path: &Path, only: Option<usize>) -> Result<Vec<Row>, Unusable> {
        let mut table = Table::open(path)?;
        let columns = self.columns(table.names())?;
        if columns.mode.is_none() && only.is_none() && self.plant.modes.len() > 1 {
            return Err(format!(
                "the plant has {} modes, but there is no column mode: add one, or list one file per mode",
                self.plant.modes.len()
            )
            .into());
        }
        let mut clock = columns.time.clone().map(Clock::new);
        if clock.is_none() {
            self.notes.add(format!(
                "{}: no column is called t or time, so gaps cannot be noticed: name the time column by estimator.time",
                path.display()
            ));
        }
        let mut rows = Vec::new();
        while let Some(cells) = table.next_row()? {
            if let Some(clock) = &mut clock {
                clock.read(&mut table, &cells)?;
            }
            rows.push(self.row(&mut table, &columns, &cells, only)?);
        }
        if rows.is_empty() {
            return Err("has no rows: record healthy operation".into());
        }
        if let Some(clock) = clock {
            clock.check_uniform(self.plant.sample_time)?;
        }
        Ok(rows)
    }

    /// Finds the column of every signal.
    fn columns(&self, header: &[String]) -> Result<Columns, Unusable> {
        let names: Vec<&str> = header.iter().map(String::as_str).collect();
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
        let taken: Vec<usize> = inputs.iter().chain(&outputs).copied().collect();
        if let Some(at) = (1..taken.len()).find(|&at| taken[..at].contains(&taken[at])) {
            let name = names[taken[at]];
            return Err(format!(
                "its column {name} is that of two signals: give every one of signals.inputs and signals.outputs a name of \
                 its own"
            )
            .into());
        }
        let mode = once(&names, "mode")?.filter(|at| !taken.contains(at));
        Ok(Columns {
            time: find_time_column(header, self.time, &taken)?,
            mode,
            inputs,
            outputs,
        })
    }

    fn row(
        &self,
        table: &mut Table,
        columns: &Columns,
        cells: &Cells,
        only: Option<usize>,
    ) -> Result<Row, Unusable> {
        let mut numbers = |at: &[usize]| -> Result<Vec<f64>, ftc_tables::Error> {
            at.iter().map(|&at| number(table, cells, at)).collect()
        };
        let (inputs, outputs) = (numbers(&columns.inputs)?, numbers(&columns.outputs)?);
        let said = columns.mode.map(|at| number(table, cells, at));
        Ok(Row {
            mode: self.mode(said.transpose()?, cells.place, only)?,
            inputs,
            outputs,
        })
    }

    /// The mode of a row: what its column says, and what the file is for.
    fn mode(&self, said: Option<f64>, place: Place, only: Option<usize>) -> Result<usize, String> {
        let Some(number) = said else {
            return Ok(only.unwrap_or(0));
        };
        let modes = self.plant.modes.len();
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

/// The number in a cell.
fn number(table: &mut Table, cells: &Cells, at: usize) -> Result<f64, ftc_tables::Error> {
    table.number(cells, at, |value| check::number(value).is_ok())
}

/// The column of a signal, under the user's name or under its number. A column that has the name
/// of another signal, among those `known`, was not meant.
fn column(names: &[&str], name: &str, number: &str, known: &[&str]) -> Result<usize, String> {
    if let Some(at) = once(names, name)?.map_or_else(|| once(names, number), |at| Ok(Some(at)))? {
        return Ok(at);
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
    let advice = match suggest::similar(name, &free) {
        Some(near) => format!("did you mean {near}?"),
        None if free.is_empty() => "add it".into(),
        None => format!(
            "add it, or name the signal in [signals] as its column, one of {}",
            free.join(", ")
        ),
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

/// Rows of one mode, about its operating point; `first` is the number of the first one.
fn database(rows: &[Row], mode: &Mode, first: usize) -> Database {
    let about = |pick: fn(&Row) -> &Vec<f64>, point: &[f64]| {
        DMatrix::from_fn(rows.len(), point.len(), |k, i| pick(&rows[k])[i] - point[i])
    };
    let inputs = about(|row| &row.inputs, &mode.operating_point.u);
    let outputs = about(|row| &row.outputs, &mode.operating_point.y);
    Database::new(first, inputs, outputs).expect("each row of a log has both")
}
