//! Signals over time, and faults of sensors, as the user writes them.

use ftc_plant::scenario::{FaultEvent, FaultKind, Waveform};
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
        #[serde(default = "for_ever")]
        until: f64,
    },
    Table {
        file: String,
        column: String,
    },
}

/// A fault of one sensor during `[from, until)`; sensors count from 1, times are in seconds.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Event {
    /// Adds `size`.
    Bias {
        sensor: i64,
        from: f64,
        #[serde(default = "for_ever")]
        until: f64,
        size: f64,
    },
    /// Adds `slope` per second.
    Drift {
        sensor: i64,
        from: f64,
        #[serde(default = "for_ever")]
        until: f64,
        slope: f64,
    },
    /// Loses the fraction `loss` of the reading.
    GainLoss {
        sensor: i64,
        from: f64,
        #[serde(default = "for_ever")]
        until: f64,
        loss: f64,
    },
    /// Keeps the last reading.
    Stuck {
        sensor: i64,
        from: f64,
        #[serde(default = "for_ever")]
        until: f64,
    },
    /// Adds `size` during the first half of each `period`.
    Intermittent {
        sensor: i64,
        from: f64,
        #[serde(default = "for_ever")]
        until: f64,
        size: f64,
        period: f64,
    },
    /// Gives no number.
    Dropout {
        sensor: i64,
        from: f64,
        #[serde(default = "for_ever")]
        until: f64,
    },
}

/// An end that never comes.
fn for_ever() -> f64 {
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
    pub fn waveform(&self, folder: &Path) -> Result<Waveform, String> {
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
            Shape::Table { file, column } => Waveform::Table {
                values: read_column(&folder.join(file), column)?,
            },
        };
        Ok(waveform)
    }
}

impl Event {
    /// The event for a plant with `sensors` outputs.
    ///
    /// # Errors
    /// One sentence, to be put after the event's key.
    pub fn fault(&self, sensors: usize) -> Result<FaultEvent, String> {
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
        let sensor = crate::check::index("sensor", sensor, sensors, "outputs")?;
        Ok(FaultEvent {
            sensor,
            from,
            until,
            kind,
        })
    }
}

fn finite(key: &str, value: f64) -> Result<f64, String> {
    crate::check::number(value)
        .map(|()| value)
        .map_err(|what| format!("{key} {what}"))
}

fn positive(key: &str, value: f64) -> Result<f64, String> {
    crate::check::positive(value)
        .map(|()| value)
        .map_err(|what| format!("{key} {what}"))
}

fn interval(from: f64, until: f64) -> Result<(), String> {
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

/// The most rows a CSV file may have.
const LONGEST_TABLE: usize = 1_000_000;

/// One column of a CSV file with a header, one row per sample.
fn read_column(path: &Path, column: &str) -> Result<Vec<f64>, String> {
    let shown = path.display();
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|error| format!("cannot read the CSV file {shown}: {error}"))?;
    let header = reader
        .headers()
        .map_err(|error| format!("the CSV file {shown} has no readable header: {error}"))?
        .clone();
    let Some(at) = header.iter().position(|name| name == column) else {
        let names: Vec<&str> = header.iter().collect();
        let nearest = crate::suggest::nearest(column, &names);
        return Err(format!(
            "the CSV file {shown} has no column {column}: {nearest}"
        ));
    };
    let mut values = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|error| format!("the CSV file {shown} is damaged: {error}"))?;
        let text = record.get(at).unwrap_or_default();
        let value = text
            .parse::<f64>()
            .ok()
            .filter(|v| crate::check::number(*v).is_ok());
        values.push(value.ok_or_else(|| {
            format!(
                "the CSV file {shown} has '{}' in column {column}, row {}: give a finite number",
                crate::sentence::shorten(text),
                row + 1
            )
        })?);
        if values.len() > LONGEST_TABLE {
            return Err(format!(
                "the CSV file {shown} has more than {LONGEST_TABLE} rows: shorten it"
            ));
        }
    }
    if values.is_empty() {
        return Err(format!(
            "the CSV file {shown} has no rows: give at least one"
        ));
    }
    Ok(values)
}
