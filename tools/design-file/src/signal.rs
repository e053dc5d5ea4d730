//! Signals over time, and faults of sensors, as the user writes them.

use crate::notes::Notes;
use ftc_plant::scenario::{FaultEvent, FaultKind, Waveform};
use ftc_tables::{Clock, Interpolation, Table, find_time_column, resample};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use std::fmt;
use std::path::Path;

/// A number, which stays the same for ever, or a table with a `kind`.
#[derive(Clone, Debug)]
pub struct Signal(Shape);

/// The kinds of signal; times are in seconds.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Shape {
    Constant {
        value: f64,
    },
    Steps {
        points: Vec<[f64; 2]>,
    },
    Square {
        amplitude: f64,
        period: f64,
        #[serde(default)]
        offset: f64,
    },
    Sine {
        amplitude: f64,
        period: f64,
        #[serde(default)]
        phase: f64,
        #[serde(default)]
        offset: f64,
    },
    Ramp {
        #[serde(default)]
        value: f64,
        slope: f64,
        #[serde(default)]
        from: f64,
        #[serde(default = "endless")]
        until: f64,
    },
    Table {
        file: String,
        column: String,
        #[serde(default)]
        time: Option<String>,
        #[serde(default)]
        interpolation: Between,
    },
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

/// Where tables are, and how they are played.
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

/// A fault of one sensor during `[from, until)`; sensors count from 1, times are in seconds.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Event {
    /// Adds `size`.
    Bias {
        #[serde(alias = "input")]
        sensor: i64,
        from: f64,
        #[serde(default = "endless")]
        until: f64,
        size: f64,
    },
    /// Adds `slope` per second.
    Drift {
        #[serde(alias = "input")]
        sensor: i64,
        from: f64,
        #[serde(default = "endless")]
        until: f64,
        slope: f64,
    },
    /// Loses the fraction `loss` of the reading.
    GainLoss {
        #[serde(alias = "input")]
        sensor: i64,
        from: f64,
        #[serde(default = "endless")]
        until: f64,
        loss: f64,
    },
    /// Keeps the last reading.
    Stuck {
        #[serde(alias = "input")]
        sensor: i64,
        from: f64,
        #[serde(default = "endless")]
        until: f64,
    },
    /// Adds `size` during the first half of each `period`.
    Intermittent {
        #[serde(alias = "input")]
        sensor: i64,
        from: f64,
        #[serde(default = "endless")]
        until: f64,
        size: f64,
        period: f64,
    },
    /// Gives no number.
    Dropout {
        #[serde(alias = "input")]
        sensor: i64,
        from: f64,
        #[serde(default = "endless")]
        until: f64,
    },
}

/// An end that never comes.
pub(crate) fn endless() -> f64 {
    f64::MAX
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
                Ok(Signal(Shape::Constant { value }))
            }
            fn visit_i64<E: Error>(self, value: i64) -> Result<Signal, E> {
                self.visit_f64(value as f64)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Signal, A::Error> {
                Shape::deserialize(MapAccessDeserializer::new(map)).map(Signal)
            }
        }
        deserializer.deserialize_any(NumberOrTable)
    }
}

impl Signal {
    /// The waveform; tables are read from CSV files beside the design file.
    ///
    /// # Errors
    /// One sentence, to be put after the signal's key.
    pub(crate) fn waveform(&self, tables: Tables) -> Result<Waveform, String> {
        let waveform = match &self.0 {
            Shape::Constant { value } => Waveform::Constant {
                value: finite("value", *value)?,
            },
            Shape::Steps { points } => Waveform::Steps {
                points: ascending(points)?,
            },
            Shape::Square {
                amplitude,
                period,
                offset,
            } => Waveform::Square {
                amplitude: finite("amplitude", *amplitude)?,
                period: positive("period", *period)?,
                offset: finite("offset", *offset)?,
            },
            Shape::Sine {
                amplitude,
                period,
                phase,
                offset,
            } => Waveform::Sine {
                amplitude: finite("amplitude", *amplitude)?,
                period: positive("period", *period)?,
                phase: finite("phase", *phase)?,
                offset: finite("offset", *offset)?,
            },
            Shape::Ramp {
                value,
                slope,
                from,
                until,
            } => {
                interval(*from, *until)?;
                Waveform::Ramp {
                    value: finite("value", *value)?,
                    slope: finite("slope", *slope)?,
                    from: *from,
                    until: *until,
                }
            }
            Shape::Table {
                file,
                column,
                time,
                interpolation,
            } => {
                let path = tables.folder.join(file);
                let values = tables
                    .read(&path, column, time.as_deref(), (*interpolation).into())
                    .map_err(|what| format!("{}: {what}", path.display()))?;
                Waveform::Table { values }
            }
        };
        Ok(waveform)
    }
}

impl Event {
    /// The event for a plant with `sensors` outputs.
    ///
    /// # Errors
    /// One sentence, to be put after the event's key.
    pub(crate) fn fault(&self, sensors: usize) -> Result<FaultEvent, String> {
        self.fault_of("sensor", sensors, "outputs")
    }

    /// The event for an actuator of a plant with `inputs` inputs.
    ///
    /// # Errors
    /// One sentence, to be put after the event's key.
    pub(crate) fn actuator_fault(&self, inputs: usize) -> Result<FaultEvent, String> {
        self.fault_of("input", inputs, "inputs")
    }

    fn fault_of(&self, what: &str, count: usize, things: &str) -> Result<FaultEvent, String> {
        let (sensor, from, until, kind) = match *self {
            Self::Bias {
                sensor,
                from,
                until,
                size,
            } => {
                let size = finite("size", size)?;
                (sensor, from, until, FaultKind::Bias { size })
            }
            Self::Drift {
                sensor,
                from,
                until,
                slope,
            } => {
                let slope = finite("slope", slope)?;
                (sensor, from, until, FaultKind::Drift { slope })
            }
            Self::GainLoss {
                sensor,
                from,
                until,
                loss,
            } => {
                crate::check::fraction(loss).map_err(|what| format!("loss {what}"))?;
                (sensor, from, until, FaultKind::GainLoss { loss })
            }
            Self::Stuck {
                sensor,
                from,
                until,
            } => (sensor, from, until, FaultKind::Stuck),
            Self::Intermittent {
                sensor,
                from,
                until,
                size,
                period,
            } => {
                let size = finite("size", size)?;
                let period = positive("period", period)?;
                (
                    sensor,
                    from,
                    until,
                    FaultKind::Intermittent { size, period },
                )
            }
            Self::Dropout {
                sensor,
                from,
                until,
            } => (sensor, from, until, FaultKind::Dropout),
        };
        interval(from, until)?;
        let sensor = crate::check::index(what, sensor, count, things)?;
        Ok(FaultEvent {
            sensor,
            from,
            until,
            kind,
        })
    }
}

pub(crate) fn finite(key: &str, value: f64) -> Result<f64, String> {
    crate::check::number(value)
        .map(|()| value)
        .map_err(|what| format!("{key} {what}"))
}

fn positive(key: &str, value: f64) -> Result<f64, String> {
    crate::check::positive(value)
        .map(|()| value)
        .map_err(|what| format!("{key} {what}"))
}

pub(crate) fn interval(from: f64, until: f64) -> Result<(), String> {
    if !(from.is_finite() && from >= 0.0) {
        return Err(format!(
            "from is {from}: give a time in seconds, 0 or later"
        ));
    }
    if !(until.is_finite() && until > from) {
        return Err(format!(
            "until is {until}: give a time in seconds after from = {from}, or leave until out"
        ));
    }
    Ok(())
}

/// The points of a step list, checked.
fn ascending(points: &[[f64; 2]]) -> Result<Vec<[f64; 2]>, String> {
    if points.is_empty() {
        return Err("points is empty: give at least one [time, value] pair".into());
    }
    for [time, value] in points {
        if !(time.is_finite() && *time >= 0.0) {
            return Err(format!(
                "points has the time {time}: give seconds, 0 or later"
            ));
        }
        finite("points", *value)?;
    }
    match points.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
        Some(pair) => Err(format!(
            "points go from time {} to {}: give the times in ascending order",
            pair[0][0], pair[1][0]
        )),
        None => Ok(points.to_vec()),
    }
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
            values.push(table.number(&row, at, |value| super::check::number(value).is_ok())?);
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
