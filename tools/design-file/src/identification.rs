//! From logs of healthy operation to the text of a design file.

use crate::assemble::LARGEST_SIZE;
use crate::check::ValueError;
pub use ftc_control::parameters::MOST_HARMONICS;
use ftc_identify::{Identified, IdentifiedMode, Log, Settings};
use ftc_tables::{Clock, Table, find_time_column};
use std::fmt::{self, Write};
use std::path::{Path, PathBuf};

/// What is asked for.
#[derive(Clone, Debug, Default)]
#[expect(
    clippy::exhaustive_structs,
    reason = "whoever asks fills in every field"
)]
pub struct Asked {
    /// Logs (delimited text). A column `mode` (from 1) tells the active mode; without one, several
    /// logs are one mode each.
    pub logs: Vec<PathBuf>,
    /// The design file that will hold the text; its name names the design, its folder is where the
    /// logs are named from.
    pub out: PathBuf,
    /// Columns of the inputs; where empty `u[1]`, `u[2]` and so on.
    pub inputs: Vec<String>,
    /// Columns of the outputs; where empty `y[1]`, `y[2]` and so on.
    pub outputs: Vec<String>,
    /// Column of the time, where it has none of the usual names (t, time, timestamp).
    pub time: Option<String>,
    /// Seconds between two rows, where no column tells the time.
    pub sample_time: Option<f64>,
    /// Period, in seconds, of a disturbance that is in the logs and that was not measured.
    pub period: Option<f64>,
    /// Harmonics of that disturbance, the fundamental included.
    pub harmonics: u32,
    /// Number of states; by default the smallest that fits nearly as well as the best.
    pub order: Option<usize>,
}

/// What was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Found {
    /// The text of the design file.
    pub text: String,
    /// The models and how well they fit.
    pub identified: Identified,
    /// Names of the outputs.
    pub outputs: Vec<String>,
}

/// Why a log cannot be used: the end of a sentence that begins with its name.
type Unusable = Box<dyn std::error::Error + Send + Sync>;

/// Why nothing was identified.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// No design can have this file's name.
    Name(PathBuf, ValueError),
    /// A directory stands where the design file is to be written.
    Directory(PathBuf),
    /// No log was named.
    NoLog,
    /// A log cannot be used.
    Log(PathBuf, Unusable),
    /// A log has no column of that name.
    NoColumn {
        /// The log.
        log: PathBuf,
        /// The key that names the column: `inputs` or `outputs`.
        key: &'static str,
        /// The column.
        column: String,
        /// The columns it has.
        columns: Vec<String>,
    },
    /// A log has no column of the usual name, and no other was named.
    NoNumbered {
        /// The log.
        log: PathBuf,
        /// The key that names the columns: `inputs` or `outputs`.
        key: &'static str,
        /// The column.
        column: String,
        /// The columns it has.
        columns: Vec<String>,
    },
    /// No log tells the time.
    NoSampleTime,
    /// A log has another sample time than the others, in seconds.
    SampleTimes {
        /// The log.
        log: PathBuf,
        /// Its sample time.
        apart: f64,
        /// That of the others.
        others: f64,
    },
    /// A log has another sample time than was asked for.
    OtherSampleTime {
        /// The log.
        log: PathBuf,
        /// Its sample time.
        apart: f64,
        /// The one asked for.
        asked: f64,
    },
    /// A number that is asked for is out of its range.
    Value {
        /// Its key: `sample_time` or `period`.
        key: &'static str,
        /// Why not.
        what: ValueError,
    },
    /// A column is named twice.
    NamedTwice {
        /// The key that names it last: `inputs` or `outputs`.
        key: &'static str,
        /// The column.
        column: String,
    },
    /// The logs hold too little.
    Logs {
        /// The logs: all of them, or the one of the mode.
        logs: Vec<PathBuf>,
        /// Why nothing was found.
        error: ftc_identify::Error,
    },
}

impl Error {
    /// The sentence, with keys of [`Asked`] named as the user knows them.
    pub fn worded(&self, option: impl Fn(&str) -> String) -> String {
        match self {
            Self::Name(out, what) => {
                let out = format!("{} {}", option("out"), out.display());
                format!("{out}: the file's name {what}")
            }
            Self::Directory(out) => format!(
                "{} {}: this is a directory: name the design file to write in it, such as {}",
                option("out"),
                out.display(),
                out.join("plant.toml").display()
            ),
            Self::NoLog => "name at least one log".into(),
            Self::Log(log, what) => format!("{}: {what}", log.display()),
            Self::NoColumn {
                log,
                key,
                column,
                columns,
            } => format!(
                "{}: has no column \"{column}\": {} may name {}",
                log.display(),
                option(key),
                columns.join(", ")
            ),
            Self::NoNumbered {
                log,
                key,
                column,
                columns,
            } => format!(
                "{}: has no column {column}: say which are meant by {} NAME,NAME; it has {}",
                log.display(),
                option(key),
                columns.join(", ")
            ),
            Self::NoSampleTime => format!(
                "no column is called t or time: give the seconds between two rows by {}",
                option("sample_time")
            ),
            Self::SampleTimes { log, apart, others } => format!(
                "{}: its rows are {apart} s apart, not {others} s: give logs of one sample time",
                log.display()
            ),
            Self::OtherSampleTime { log, apart, asked } => format!(
                "{}: its rows are {apart} s apart, but {} is {asked}: leave that out",
                log.display(),
                option("sample_time")
            ),
            Self::Value { key, what } => format!("{} {what}", option(key)),
            Self::NamedTwice { key, column } => format!(
                "{} names the column \"{column}\" once more: name each column once, as an input or as an output",
                option(key)
            ),
            Self::Logs { logs, error } => match error {
                ftc_identify::Error::NoState => {
                    format!("{} is 0: give at least 1", option("order"))
                }
                ftc_identify::Error::Period(samples) => format!(
                    "{}: its last harmonic lasts {samples:.4} samples and cannot be told from others: give a longer \
                     period, or fewer {}",
                    option("period"),
                    option("harmonics")
                ),
                ftc_identify::Error::NoModel { order } => format!(
                    "{}: no model of order {order} explains it: record a run in which every input moves more, or give \
                     another {}",
                    listed(logs),
                    option("order")
                ),
                other => format!("{}: {other}", listed(logs)),
            },
        }
    }
}

fn listed(logs: &[PathBuf]) -> String {
    let names: Vec<String> = logs.iter().map(|log| log.display().to_string()).collect();
    names.join(", ")
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.worded(str::to_owned))
    }
}

impl std::error::Error for Error {}

/// One file that was read.
struct Read {
    log: Log,
    sample_time: Option<f64>,
    has_modes: bool,
    inputs: Vec<String>,
    outputs: Vec<String>,
}

/// Identifies a plant.
///
/// # Errors
/// [`Error`]
pub fn identify(asked: &Asked) -> Result<Found, Error> {
    let name = name_of(&asked.out)?;
    for (key, value) in [("sample_time", asked.sample_time), ("period", asked.period)] {
        let checked = value.map_or(Ok(()), crate::check::positive);
        checked.map_err(|what| Error::Value {
            key,
            what: what.into(),
        })?;
    }
    let files: Result<Vec<Read>, Error> = asked.logs.iter().map(|log| read(log, asked)).collect();
    let mut files = files?;
    let several = files.len() > 1 && files.iter().all(|file| !file.has_modes);
    if several {
        for (mode, file) in files.iter_mut().enumerate() {
            file.log.modes.fill(mode);
        }
    }
    let first = files.first().ok_or(Error::NoLog)?;
    let sample_time = sample_time(asked, &files)?;
    let logs: Vec<Log> = files.iter().map(|file| file.log.clone()).collect();
    let mut settings = Settings::default();
    settings.order = asked.order;
    if let Some(period) = asked.period {
        settings = settings.with_disturbance(period, asked.harmonics, sample_time);
    }
    let identified = ftc_identify::identify(&logs, &settings).map_err(|error| {
        use ftc_identify::Error::{NotFinite, Sizes, Still, TooShort};
        let one = match &error {
            Sizes { log, .. } | NotFinite { log, .. } => Some(log - 1),
            TooShort { mode, .. } | Still { mode, .. } if several => Some(mode - 1),
            _ => None,
        };
        let logs = one.and_then(|one| asked.logs.get(one..=one));
        let logs = logs.unwrap_or(&asked.logs).to_vec();
        Error::Logs { logs, error }
    })?;
    Ok(Found {
        text: design_file(&name, sample_time, &identified, first, asked, several)?,
        identified,
        outputs: first.outputs.clone(),
    })
}

/// The design's name: the file's, which must be a C identifier.
fn name_of(out: &Path) -> Result<String, Error> {
    if out.is_dir() || out.file_name().is_none() {
        return Err(Error::Directory(out.into()));
    }
    let stem = out
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or_default();
    crate::check::identifier(stem)
        .map(|()| stem.to_string())
        .map_err(|what| Error::Name(out.into(), what))
}

fn read(path: &Path, asked: &Asked) -> Result<Read, Error> {
    let unusable = |what: ftc_tables::Error| Error::Log(path.into(), what.into());
    let table = Table::open(path).map_err(unusable)?;
    let inputs = columns(path, table.names(), &asked.inputs, ("u", "inputs"))?;
    let outputs = columns(path, table.names(), &asked.outputs, ("y", "outputs"))?;
    let all: Vec<usize> = inputs.iter().chain(&outputs).copied().collect();
    if let Some(at) = (1..all.len()).find(|&at| all[..at].contains(&all[at])) {
        let key = if at < inputs.len() {
            "inputs"
        } else {
            "outputs"
        };
        let column = table.names()[all[at]].clone();
        return Err(Error::NamedTwice { key, column });
    }
    rows(table, &inputs, &outputs, asked.time.as_deref())
        .map_err(|what| Error::Log(path.into(), what))
}

fn rows(
    mut table: Table,
    inputs: &[usize],
    outputs: &[usize],
    time: Option<&str>,
) -> Result<Read, Unusable> {
    let names = table.names().to_vec();
    let taken: Vec<usize> = inputs.iter().chain(outputs).copied().collect();
    let mode = names
        .iter()
        .position(|name| name.eq_ignore_ascii_case("mode"));
    let time = find_time_column(&names, time, &taken)?;
    let mut clock = time.map(Clock::new);
    let (mut u, mut y, mut modes) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(row) = table.next_row()? {
        if let Some(clock) = &mut clock {
            clock.read(&mut table, &row)?;
        }
        for &column in inputs {
            u.push(table.number(&row, column, f64::is_finite)?);
        }
        for &column in outputs {
            y.push(table.number(&row, column, f64::is_finite)?);
        }
        let whole =
            |value: f64| (1.0..=LARGEST_SIZE as f64).contains(&value) && value.fract() == 0.0;
        modes.push(match mode {
            Some(column) => table.number(&row, column, whole)? as usize - 1,
            None => 0,
        });
    }
    let sample_time = clock.map(|clock| even(&clock)).transpose()?;
    let matrix = |values: &[f64], width: usize| {
        nalgebra::DMatrix::from_row_slice(modes.len(), width, values)
    };
    let named = |columns: &[usize]| columns.iter().map(|&at| names[at].clone()).collect();
    Ok(Read {
        sample_time,
        has_modes: mode.is_some(),
        inputs: named(inputs),
        outputs: named(outputs),
        log: Log::new(matrix(&u, inputs.len()), matrix(&y, outputs.len())).in_modes(modes),
    })
}

/// The mean step of an even clock.
fn even(clock: &Clock) -> Result<f64, Unusable> {
    let times = clock.times();
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Err("it has no rows: record healthy operation".into());
    };
    let step = (last - first) / (times.len().max(2) - 1) as f64;
    // Printed times are rounded: a step of 4.9999999 s is one of 5 s.
    let step = format!("{step:.6e}").parse().unwrap_or(step);
    clock.check_ascending()?;
    clock.check_uniform(step)?;
    Ok(step)
}

/// Where the signals of a kind stand: those that are named, else `letter[1]`, `letter[2]`, ...
fn columns(
    log: &Path,
    names: &[String],
    said: &[String],
    (letter, key): (&str, &'static str),
) -> Result<Vec<usize>, Error> {
    let find = |wanted: &String| names.iter().position(|name| name == wanted);
    if !said.is_empty() {
        let missing = |column: &String| Error::NoColumn {
            log: log.into(),
            key,
            column: column.clone(),
            columns: names.to_vec(),
        };
        let found = said
            .iter()
            .map(|name| find(name).ok_or_else(|| missing(name)));
        return found.collect();
    }
    let numbered = |number: usize| format!("{letter}[{number}]");
    let found: Vec<usize> = (1..).map_while(|number| find(&numbered(number))).collect();
    match found.is_empty() {
        true => Err(Error::NoNumbered {
            log: log.into(),
            key,
            column: numbered(1),
            columns: names.to_vec(),
        }),
        false => Ok(found),
    }
}

fn sample_time(asked: &Asked, files: &[Read]) -> Result<f64, Error> {
    let told = files.iter().find_map(|file| file.sample_time);
    let step = asked.sample_time.or(told).ok_or(Error::NoSampleTime)?;
    let differs = |file: &Read| {
        file.sample_time
            .is_some_and(|other| (other - step).abs() > 0.01 * step)
    };
    let Some(index) = files.iter().position(differs) else {
        return Ok(step);
    };
    let log = asked.logs[index].clone();
    let apart = files[index].sample_time.unwrap_or(step);
    Err(match asked.sample_time {
        Some(asked) => Error::OtherSampleTime { log, apart, asked },
        None => Error::SampleTimes {
            log,
            apart,
            others: step,
        },
    })
}

/// The text of the design file.
fn design_file(
    name: &str,
    sample_time: f64,
    found: &Identified,
    first: &Read,
    asked: &Asked,
    several: bool,
) -> Result<String, Error> {
    let mut text = format!(
        "# Identified from logs of healthy operation by ftc-fmu identify: order {}, chosen by the fit.\n\
         # Say in [controller] what the loop shall do; examples/paper.toml explains every key.\n\n\
         name = \"{name}\"\nsample_time = {sample_time:?} # seconds\n",
        found.order
    );
    for mode in &found.modes {
        text.push_str(&mode_table(mode));
    }
    let names = |names: &[String]| {
        let each: Vec<String> = names
            .iter()
            .map(|name| format!("{{ name = {name:?} }}"))
            .collect();
        each.join(", ")
    };
    let _ = write!(
        text,
        "\n[signals]\ninputs = [{}]\noutputs = [{}]\n",
        names(&first.inputs),
        names(&first.outputs)
    );
    if let Some(period) = asked.period {
        let _ = write!(
            text,
            "\n[disturbance]\nperiod = {period:?} # seconds\nharmonics = {}\n",
            asked.harmonics
        );
    }
    let folder = asked.out.parent().unwrap_or(Path::new(""));
    let paths: Vec<String> = asked
        .logs
        .iter()
        .map(|log| relative(log, folder).map(|path| format!("{path:?}")))
        .collect::<Result<_, _>>()?;
    let one_log = paths.len() == 1;
    if one_log || several {
        let files = match one_log {
            true => paths.join(""),
            false => format!("[{}]", paths.join(", ")),
        };
        let _ = write!(text, "\n[estimator]\ndatabase = {files}\n");
        if let Some(time) = &asked.time {
            let _ = writeln!(text, "time = {time:?}");
        }
    }
    Ok(text)
}

fn mode_table(mode: &IdentifiedMode) -> String {
    let list = |values: &[f64]| {
        let numbers: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
        format!("[{}]", numbers.join(", "))
    };
    let rows = |matrix: &nalgebra::DMatrix<f64>| {
        let rows: Vec<String> = matrix
            .row_iter()
            .map(|row| list(&row.iter().copied().collect::<Vec<_>>()))
            .collect();
        format!("[{}]", rows.join(", "))
    };
    format!(
        "\n[[mode]]\nA = {}\nB = {}\nC = {}\noperating_point = {{ x = {}, u = {}, y = {} }}\n",
        rows(&mode.a),
        rows(&mode.b),
        rows(&mode.c),
        list(mode.x0.as_slice()),
        list(mode.u0.as_slice()),
        list(mode.y0.as_slice())
    )
}

/// A log's path as the design file in `folder` names it.
fn relative(log: &Path, folder: &Path) -> Result<String, Error> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let full = |path: &Path| {
        path.canonicalize().map_err(|error| {
            let what = format!("cannot be found ({error}): check the path");
            Error::Log(path.into(), what.into())
        })
    };
    let (log, folder) = (full(log)?, full(folder)?);
    let path = log.strip_prefix(&folder).unwrap_or(&log);
    let no_text = || Error::Log(log.clone(), "the path is no UTF-8 text: rename it".into());
    path.to_str().map(str::to_string).ok_or_else(no_text)
}
