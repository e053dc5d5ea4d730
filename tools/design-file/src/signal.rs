//! Signals over time, as the user writes them.

use crate::check;
use crate::complaint::{Complaint, Key, at};
use crate::notes::Notes;
use crate::wording::of_waveform;
use ftc_design::words::counted;
use ftc_plant::scenario::{NEVER, Waveform};
use ftc_tables::{Clock, Interpolation, Table, find_time_column, resample};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use std::fmt;
use std::path::Path;

/// A number, which stays the same for ever, or a table with a `kind`.
#[derive(Clone, Debug)]
pub struct Signal(Given);

#[derive(Clone, Debug)]
enum Given {
    Number(f64),
    Table(Box<SignalTable>),
}

/// A signal as a table; times are in seconds.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct SignalTable {
    kind: Kind,
    value: Option<f64>,
    points: Option<Vec<Vec<f64>>>,
    amplitude: Option<f64>,
    period: Option<f64>,
    phase: Option<f64>,
    offset: Option<f64>,
    slope: Option<f64>,
    from: Option<f64>,
    until: Option<f64>,
    file: Option<String>,
    column: Option<String>,
    time: Option<String>,
    interpolation: Option<Between>,
}

/// Values of a signal's `kind`.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Constant,
    Steps,
    Square,
    Sine,
    Ramp,
    Table,
}

impl Kind {
    /// Its name, and the keys that describe it.
    fn keys(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Constant => ("constant", &["value"]),
            Self::Steps => ("steps", &["points"]),
            Self::Square => ("square", &["amplitude", "period", "offset"]),
            Self::Sine => ("sine", &["amplitude", "period", "phase", "offset"]),
            Self::Ramp => ("ramp", &["value", "slope", "from", "until"]),
            Self::Table => ("table", &["file", "column", "time", "interpolation"]),
        }
    }
}

/// Values of a table's `interpolation`: what a signal is between two of its rows.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// What the earlier row says.
    #[default]
    Hold,
    /// A straight line.
    Linear,
}

impl From<Between> for Interpolation {
    fn from(between: Between) -> Self {
        match between {
            Between::Hold => Self::Hold,
            Between::Linear => Self::Linear,
        }
    }
}

/// Where tables are, and how they are interpolated.
#[derive(Clone, Copy, Debug)]
pub struct Tables<'a> {
    /// The design file's directory.
    pub folder: &'a Path,
    /// Seconds between two samples.
    pub sample_time: f64,
    /// The longest scenario in samples.
    pub most_samples: usize,
    /// What the user should know of what was read.
    pub notes: &'a Notes,
}

/// The end of what has none.
pub(crate) fn never() -> f64 {
    NEVER
}

impl<'de> Deserialize<'de> for Signal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrTable;
        impl<'de> Visitor<'de> for NumberOrTable {
            type Value = Signal;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a table with a kind")
            }
            fn visit_f64<E: Error>(self, value: f64) -> Result<Signal, E> {
                Ok(Signal(Given::Number(value)))
            }
            fn visit_i64<E: Error>(self, value: i64) -> Result<Signal, E> {
                self.visit_f64(value as f64)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Signal, A::Error> {
                let table = SignalTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Signal(Given::Table(Box::new(table))))
            }
        }
        deserializer.deserialize_any(NumberOrTable)
    }
}

impl Signal {
    /// The waveform; tables are read from CSV files beside the design file.
    ///
    /// # Errors
    /// What is wrong with which of its keys.
    pub(crate) fn waveform(&self, tables: Tables) -> Result<Waveform, Complaint> {
        match &self.0 {
            Given::Number(value) => Ok(Waveform::Constant {
                value: at(Key::default(), check::number(*value).map(|()| *value))?,
            }),
            Given::Table(table) => {
                let (name, keys) = table.kind.keys();
                only(name, keys, &table.given())?;
                let waveform = table.waveform(tables)?;
                waveform.check().map_err(|error| of_waveform(&error))?;
                Ok(waveform)
            }
        }
    }
}

impl SignalTable {
    /// The keys beside `kind`, and whether they are there.
    fn given(&self) -> [(&'static str, bool); 13] {
        [
            ("value", self.value.is_some()),
            ("points", self.points.is_some()),
            ("amplitude", self.amplitude.is_some()),
            ("period", self.period.is_some()),
            ("phase", self.phase.is_some()),
            ("offset", self.offset.is_some()),
            ("slope", self.slope.is_some()),
            ("from", self.from.is_some()),
            ("until", self.until.is_some()),
            ("file", self.file.is_some()),
            ("column", self.column.is_some()),
            ("time", self.time.is_some()),
            ("interpolation", self.interpolation.is_some()),
        ]
    }

    fn waveform(&self, tables: Tables) -> Result<Waveform, Complaint> {
        let period = || present("period", self.period);
        Ok(match self.kind {
            Kind::Constant => Waveform::Constant {
                value: present("value", self.value)?,
            },
            Kind::Steps => Waveform::Steps {
                points: pairs(present("points", self.points.as_ref())?)?,
            },
            Kind::Square => Waveform::Square {
                amplitude: present("amplitude", self.amplitude)?,
                period: period()?,
                offset: self.offset.unwrap_or(0.0),
            },
            Kind::Sine => Waveform::Sine {
                amplitude: present("amplitude", self.amplitude)?,
                period: period()?,
                phase: self.phase.unwrap_or(0.0),
                offset: self.offset.unwrap_or(0.0),
            },
            Kind::Ramp => Waveform::Ramp {
                value: self.value.unwrap_or(0.0),
                slope: present("slope", self.slope)?,
                from: self.from.unwrap_or(0.0),
                until: self.until.unwrap_or(NEVER),
            },
            Kind::Table => {
                let path = tables.folder.join(present("file", self.file.as_ref())?);
                let column = present("column", self.column.as_ref())?;
                let between = self.interpolation.unwrap_or_default();
                let values = tables
                    .read(&path, column, self.time.as_deref(), between.into())
                    .map_err(|what| {
                        Complaint::of("file", format!(": {}: {what}", path.display()))
                    })?;
                Waveform::Table { values }
            }
        })
    }
}

/// The value of a key that has to be there.
pub(crate) fn present<T>(key: &str, value: Option<T>) -> Result<T, Complaint> {
    value.ok_or_else(|| Complaint::of(key, "is missing: add it"))
}

/// Refuses a key that a kind does not have.
pub(crate) fn only(kind: &str, known: &[&str], given: &[(&str, bool)]) -> Result<(), Complaint> {
    let mut strangers = given
        .iter()
        .filter(|(key, there)| *there && !known.contains(key));
    match strangers.next() {
        None => Ok(()),
        Some((key, _)) if known.is_empty() => Err(Complaint::of(
            *key,
            format!("says nothing about kind = \"{kind}\": leave it out"),
        )),
        Some((key, _)) => Err(Complaint::of(
            *key,
            format!(
                "says nothing about kind = \"{kind}\", which has {}: leave it out, or choose another kind",
                known.join(", ")
            ),
        )),
    }
}

/// The entries of a list of points, each a time and a value.
fn pairs(points: &[Vec<f64>]) -> Result<Vec<[f64; 2]>, Complaint> {
    let pair = |(index, point): (usize, &Vec<f64>)| {
        <[f64; 2]>::try_from(point.as_slice()).map_err(|_| {
            Complaint::of(
                Key::from("points").entry(index),
                format!(
                    "has {}: give a pair, [time, value]",
                    counted(point.len(), "number", "numbers")
                ),
            )
        })
    };
    points.iter().enumerate().map(pair).collect()
}

impl Tables<'_> {
    /// One column of a table, a value for each sample. With a time column the signal is what the
    /// table says at the sample's time; without one a row is a sample.
    fn read(
        self,
        path: &Path,
        column: &str,
        time: Option<&str>,
        interpolation: Interpolation,
    ) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
        let mut table = Table::open(path)?;
        let names = table.names();
        let Some(at) = names.iter().position(|name| name == column) else {
            let known: Vec<&str> = names.iter().map(String::as_str).collect();
            let nearest = super::suggest::nearest(column, &known);
            return Err(format!("has no column {column}: {nearest}").into());
        };
        let mut clock = find_time_column(names, time, &[at])?.map(Clock::new);
        let mut values = Vec::new();
        while let Some(row) = table.next_row()? {
            if let Some(clock) = &mut clock {
                clock.read(&mut table, &row)?;
            }
            values.push(table.number(&row, at, |value| check::number(value).is_ok())?);
        }
        if values.is_empty() {
            return Err("has no rows: give at least one".into());
        }
        let Some(clock) = clock else {
            self.notes.add(format!(
                "{}: no column is called t or time, so each row is taken for one sample of {} s: \
                 name the time column by time = \"...\"",
                path.display(),
                self.sample_time
            ));
            return Ok(values);
        };
        clock.check_ascending()?;
        if clock.times().last().is_some_and(|&last| last < 0.0) {
            return Err(
                "ends before time 0: let its times count from the start of the scenario".into(),
            );
        }
        let (times, step) = (clock.times(), self.sample_time);
        Ok(resample(
            times,
            &values,
            step,
            interpolation,
            self.most_samples,
        ))
    }
}
