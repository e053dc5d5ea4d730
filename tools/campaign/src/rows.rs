//! One row per run, as a Parquet file.

use crate::Outcome;
use crate::parquet::{Kind, Values, Writer};
use std::io::{self, Write};

/// Columns in their order.
const COLUMNS: [(&str, Kind); 12] = [
    ("run", Kind::Whole),
    ("error", Kind::Real),
    ("error_without", Kind::Real),
    ("error_told", Kind::Real),
    ("faults", Kind::Whole),
    ("detected", Kind::Whole),
    ("false_alarms", Kind::Whole),
    ("switches", Kind::Whole),
    ("model_error", Kind::Real),
    ("noise", Kind::Real),
    ("kinds", Kind::Text),
    ("events", Kind::Text),
];

/// Writes the outcomes of runs, batch by batch.
pub struct RowWriter<W: Write>(Writer<W>);

impl<W: Write> RowWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// What the file says.
    pub fn new(file: W) -> io::Result<Self> {
        Writer::new(file, &COLUMNS).map(Self)
    }

    /// Appends a row for each outcome; `events` as JSON.
    ///
    /// # Errors
    /// What the file says.
    pub fn write(&mut self, outcomes: &[Outcome]) -> io::Result<()> {
        if outcomes.is_empty() {
            return Ok(());
        }
        let rows = || outcomes.iter();
        self.0.write(&COLUMNS.map(|(name, kind)| match kind {
            Kind::Whole => Values::whole(rows().map(|row| whole(row, name))),
            Kind::Real => Values::real(rows().map(|row| real(row, name))),
            Kind::Text => Values::text(rows().map(|row| text(row, name))),
        }))
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What the file says.
    pub fn finish(self) -> io::Result<()> {
        let author = concat!("ftc-fmu version ", env!("CARGO_PKG_VERSION"));
        self.0.finish("run", author)
    }
}

fn whole(row: &Outcome, name: &str) -> i64 {
    let count = |count: usize| count as i64;
    match name {
        "run" => row.run as i64,
        "faults" => count(row.faults.len()),
        "detected" => count(
            row.faults
                .iter()
                .filter(|fault| fault.delay.is_some())
                .count(),
        ),
        "false_alarms" => row.false_alarms.iter().sum::<u64>() as i64,
        _ => row.switches as i64,
    }
}

fn real(row: &Outcome, name: &str) -> f64 {
    match name {
        "error" => row.error[0],
        "error_without" => row.error[1],
        "error_told" => row.error[2],
        "model_error" => row.model_error,
        _ => row.noise,
    }
}

fn text(row: &Outcome, name: &str) -> String {
    if name == "kinds" {
        let kinds: Vec<&str> = row.faults.iter().map(|fault| fault.kind.as_str()).collect();
        return kinds.join(",");
    }
    serde_json::to_string(&row.faults).unwrap_or_default()
}
