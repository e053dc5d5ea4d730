//! The time column of a table: which one it is, what it says, and whether it keeps to a sample time.

use crate::table::{Place, Row, Table, contents};
use crate::{Error, TimeColumnError, TimeError, quote};
use chrono::{DateTime, FixedOffset, NaiveDate, NaiveDateTime};

/// Names of a time column, in any case and without a unit behind them.
const NAMES: [&str; 8] = [
    "t",
    "time",
    "timestamp",
    "time stamp",
    "time_stamp",
    "datetime",
    "date time",
    "date/time",
];

/// How a local time is written.
const LOCAL: [&str; 4] = [
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y-%m-%dT%H:%M",
    "%Y-%m-%d %H:%M",
];

/// Units behind the name, in seconds.
const UNITS: [(&str, f64); 13] = [
    ("s", 1.0),
    ("sec", 1.0),
    ("second", 1.0),
    ("seconds", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("\u{b5}s", 1e-6),
    ("\u{3bc}s", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
    ("h", 3600.0),
    ("hour", 3600.0),
    ("hours", 3600.0),
];

/// How far one time step may be from the sample time, relative to it: clocks of loggers jitter.
const JITTER: f64 = 0.05;
/// How far a step may be off because times were rounded, in sample times: below half a sample, so that
/// a row lost or doubled is always noticed.
const ROUNDING: f64 = 0.499;
/// How far the mean step may be from the sample time, relative to it: quartz clocks are a tenth of that.
pub const DRIFT: f64 = 1e-3;

/// The column that tells the time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeColumn {
    /// Where it stands (0-based).
    pub index: usize,
    /// Its name.
    pub name: String,
    /// Seconds per unit of its numbers.
    unit: f64,
}

impl TimeColumn {
    /// Seconds per unit of its numbers.
    pub fn seconds(&self) -> f64 {
        self.unit
    }
}

/// A name without the unit behind it, in lower case, and the unit.
fn split_unit(name: &str) -> (String, Option<String>) {
    let lower = name.trim().to_lowercase();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some(inside) = lower.strip_suffix(close)
            && let Some((base, unit)) = inside.rsplit_once(open)
        {
            return (base.trim().to_string(), Some(unit.trim().to_string()));
        }
    }
    if let Some((base, unit)) = lower.rsplit_once([' ', '_', '/'])
        && matches!(base.trim(), "t" | "time")
        && UNITS.iter().any(|(known, _)| *known == unit)
    {
        return (base.trim().to_string(), Some(unit.to_string()));
    }
    (lower, None)
}

/// Whether a column is called as time columns are.
fn looks_like_time(name: &str) -> bool {
    let (base, _) = split_unit(name);
    NAMES.contains(&base.as_str())
}

fn described(name: &str, index: usize) -> Result<TimeColumn, TimeColumnError> {
    let unit = match split_unit(name).1 {
        None => 1.0,
        Some(unit) => UNITS
            .iter()
            .find(|(known, _)| *known == unit)
            .map(|(_, seconds)| *seconds)
            .ok_or_else(|| TimeColumnError::Unit(quote(name)))?,
    };
    Ok(TimeColumn {
        index,
        name: name.to_string(),
        unit,
    })
}

/// The time column: the one that is `said`, else the only one that bears a usual name; columns
/// `taken` by signals are none.
///
/// # Errors
/// A named column that is not there or is there twice, two columns that may be meant, and a unit
/// that is not known.
pub fn find_time_column(
    names: &[String],
    said: Option<&str>,
    taken: &[usize],
) -> Result<Option<TimeColumn>, TimeColumnError> {
    if let Some(said) = said {
        let mut found = (0..names.len()).filter(|&at| names[at] == said);
        return match (found.next(), found.next()) {
            (Some(at), None) => described(said, at).map(Some),
            (None, _) => Err(TimeColumnError::Missing {
                named: quote(said),
                names: names.to_vec(),
            }),
            (Some(_), Some(_)) => Err(TimeColumnError::Twice(said.to_string())),
        };
    }
    let candidates: Vec<usize> = (0..names.len())
        .filter(|at| !taken.contains(at) && looks_like_time(&names[*at]))
        .collect();
    match candidates[..] {
        [] => Ok(None),
        [one] => described(&names[one], one).map(Some),
        [one, other, ..] => Err(TimeColumnError::Ambiguous(
            names[one].clone(),
            names[other].clone(),
        )),
    }
}

/// The times of a table, as they are read.
#[derive(Clone, Debug)]
pub struct Clock {
    column: TimeColumn,
    /// Seconds; of time stamps, since the first row.
    times: Vec<f64>,
    lines: Vec<u64>,
    /// The first stamp in nanoseconds, where times are stamps.
    origin: Option<i128>,
    /// The finest step in which times are printed, in seconds.
    resolution: f64,
}

impl Clock {
    /// Nothing read yet.
    pub fn new(column: TimeColumn) -> Self {
        Self {
            column,
            times: Vec::new(),
            lines: Vec::new(),
            origin: None,
            resolution: f64::INFINITY,
        }
    }

    /// The times in seconds; time stamps count from the first.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Takes the time of a row.
    ///
    /// # Errors
    /// A cell that holds no time of the kind that the first row has.
    pub fn read(&mut self, table: &mut Table, row: &Row) -> Result<(), Error> {
        let text = row.text(self.column.index);
        let first = self.times.is_empty();
        let number = table.parse(text).filter(|value| value.is_finite());
        let time = match (number, stamp(text)) {
            (Some(value), _) if first || self.origin.is_none() => {
                table.agree_on_mark(row.place, text)?;
                self.note_resolution(self.column.unit * printed_step(text));
                value * self.column.unit
            }
            (None, Some(nanoseconds)) if first || self.origin.is_some() => {
                let origin = *self.origin.get_or_insert(nanoseconds);
                self.note_resolution(printed_step(text.rsplit(':').next().unwrap_or_default()));
                (nanoseconds - origin) as f64 * 1e-9
            }
            _ => return Err(self.no_time(row.place, text)),
        };
        self.times.push(time);
        self.lines.push(row.place.line);
        Ok(())
    }

    fn note_resolution(&mut self, step: f64) {
        self.resolution = self.resolution.min(step);
    }

    fn no_time(&self, place: Place, text: &str) -> Error {
        let advice = match (self.times.is_empty(), self.origin) {
            (true, _) => "give numbers in seconds or ISO time stamps such as 2026-03-01T12:00:00.5",
            (false, None) => "give numbers throughout, as the first row has",
            (false, Some(_)) => "give ISO time stamps throughout, as the first row has",
        };
        Error::Cell {
            place,
            column: self.column.name.clone(),
            found: contents(text),
            advice,
        }
    }

    fn place(&self, index: usize) -> Place {
        Place {
            row: index + 1,
            line: self.lines[index],
        }
    }

    /// Refuses gaps, doubled rows and a sampling rate that is not that of `sample_time` seconds.
    ///
    /// # Errors
    /// The first row where they do not.
    pub fn check_uniform(&self, sample_time: f64) -> Result<(), TimeError> {
        let rounding = (self.resolution / sample_time).min(ROUNDING);
        let tolerance = JITTER.max(rounding) * (1.0 + 1e-9) + 1e-9;
        for (at, pair) in self.times.windows(2).enumerate() {
            let &[before, now] = pair else { continue };
            let place = self.place(at + 1);
            if ((now - before) / sample_time - 1.0).abs() > tolerance {
                return Err(TimeError::Step {
                    place,
                    column: self.column.name.clone(),
                    before,
                    now,
                    sample_time,
                    resolution: self.resolution,
                });
            }
            let samples = (at + 1) as f64;
            let since = now - self.times[0];
            let off = (since / sample_time - samples).abs();
            if off > DRIFT * samples + 2.0 * tolerance {
                return Err(TimeError::Drift {
                    place,
                    column: self.column.name.clone(),
                    now,
                    since,
                    samples,
                    sample_time,
                    mean: self.mean_step(),
                });
            }
        }
        Ok(())
    }

    /// The mean time between two rows.
    fn mean_step(&self) -> f64 {
        match (self.times.first(), self.times.last()) {
            (Some(first), Some(last)) if self.times.len() > 1 => {
                (last - first) / (self.times.len() - 1) as f64
            }
            _ => 0.0,
        }
    }

    /// Refuses times that do not ascend.
    ///
    /// # Errors
    /// The first row that is not later than the one before.
    pub fn check_ascending(&self) -> Result<(), TimeError> {
        let bad = self.times.windows(2).position(|pair| pair[1] <= pair[0]);
        bad.map_or(Ok(()), |at| {
            Err(TimeError::Order {
                place: self.place(at + 1),
                column: self.column.name.clone(),
                before: self.times[at],
                now: self.times[at + 1],
            })
        })
    }
}

/// The step in which a number is printed: 0.01 for `7.25`, 1 for `7`.
fn printed_step(text: &str) -> f64 {
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let digits = mantissa
        .split_once(['.', ','])
        .map_or("", |(_, after)| after)
        .chars()
        .take_while(char::is_ascii_digit)
        .count();
    let exponent: i32 = exponent.parse().unwrap_or(0);
    10f64.powi(exponent.saturating_sub(digits as i32).clamp(-300, 300))
}

/// An ISO time stamp in nanoseconds: an instant, or a local time without a zone, or a day.
fn stamp(text: &str) -> Option<i128> {
    let text = &text.trim().replace(',', ".");
    let instant = || text.parse::<DateTime<FixedOffset>>().ok();
    let local = |format| NaiveDateTime::parse_from_str(text, format).ok();
    let day = || text.parse::<NaiveDate>().ok()?.and_hms_opt(0, 0, 0);
    let time = LOCAL.iter().find_map(|format| local(format)).or_else(day);
    let time = time
        .map(|time| time.and_utc().fixed_offset())
        .or_else(instant)?;
    let nanoseconds = i128::from(time.timestamp_subsec_nanos());
    Some(i128::from(time.timestamp()) * 1_000_000_000 + nanoseconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_stamp_counts_the_same_however_it_is_written() {
        let noon = stamp("2026-03-01T12:00:00").unwrap();
        for text in [
            "2026-03-01 12:00:00",
            "2026-03-01 12:00",
            "2026-03-01T12:00",
            "2026-03-01T12:00:00Z",
            "2026-03-01T13:00:00+01:00",
            "2026-03-01T13:00:00.000+01:00",
            "2026-03-01 06:30:00-05:30",
        ] {
            assert_eq!(stamp(text), Some(noon), "{text}");
        }
        for text in ["2026-03-01T12:00:00.5", "2026-03-01 12:00:00,5"] {
            assert_eq!(stamp(text), Some(noon + 500_000_000), "{text}");
        }
        assert_eq!(stamp("2026-03-02").unwrap() - noon, 43_200_000_000_000);
        assert_eq!(stamp("1969-12-31T23:59:59.75"), Some(-250_000_000));
        for text in [
            "",
            "12",
            "12.5",
            "noon",
            "2026-13-01T12:00:00",
            "2026-03-01T25:00:00",
        ] {
            assert_eq!(stamp(text), None, "{text}");
        }
    }
}
