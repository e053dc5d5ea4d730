//! One row per run, as a Parquet file.

use crate::Outcome;
use output::Replacement;
use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

/// Name of the file with a row per run.
pub const ROWS: &str = "runs.parquet";

/// Columns in their order.
const COLUMNS: [(&str, Physical); 12] = [
    ("run", Physical::INT64),
    ("error", Physical::DOUBLE),
    ("error_without", Physical::DOUBLE),
    ("error_told", Physical::DOUBLE),
    ("faults", Physical::INT64),
    ("detected", Physical::INT64),
    ("false_alarms", Physical::INT64),
    ("switches", Physical::INT64),
    ("model_error", Physical::DOUBLE),
    ("noise", Physical::DOUBLE),
    ("kinds", Physical::BYTE_ARRAY),
    ("events", Physical::BYTE_ARRAY),
];

/// Writes the outcomes of runs, batch by batch.
pub struct RowWriter<W: Write + Send>(SerializedFileWriter<W>);

impl<W: Write + Send> RowWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// What the file says.
    pub fn new(file: W) -> Result<Self, ParquetError> {
        let fields: Result<Vec<Arc<Type>>, ParquetError> = COLUMNS
            .iter()
            .map(|&(name, kind)| {
                let text = kind == Physical::BYTE_ARRAY;
                let logical = text.then_some(parquet::basic::LogicalType::String);
                Type::primitive_type_builder(name, kind)
                    .with_repetition(Repetition::REQUIRED)
                    .with_logical_type(logical)
                    .build()
                    .map(Arc::new)
            })
            .collect();
        let schema = Type::group_type_builder("run")
            .with_fields(fields?)
            .build()?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::UNCOMPRESSED)
            .build();
        SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).map(Self)
    }

    /// Appends a row for each outcome; `events` as JSON.
    ///
    /// # Errors
    /// What the file says.
    pub fn write(&mut self, outcomes: &[Outcome]) -> Result<(), ParquetError> {
        if outcomes.is_empty() {
            return Ok(());
        }
        let mut group = self.0.next_row_group()?;
        for (name, kind) in COLUMNS {
            let Some(mut column) = group.next_column()? else {
                break;
            };
            match kind {
                Physical::INT64 => {
                    let values: Vec<i64> = outcomes.iter().map(|row| whole(row, name)).collect();
                    column
                        .typed::<Int64Type>()
                        .write_batch(&values, None, None)?;
                }
                Physical::DOUBLE => {
                    let values: Vec<f64> = outcomes.iter().map(|row| real(row, name)).collect();
                    column
                        .typed::<DoubleType>()
                        .write_batch(&values, None, None)?;
                }
                _ => {
                    let values: Vec<ByteArray> = outcomes
                        .iter()
                        .map(|row| ByteArray::from(text(row, name).into_bytes()))
                        .collect();
                    column
                        .typed::<ByteArrayType>()
                        .write_batch(&values, None, None)?;
                }
            }
            column.close()?;
        }
        group.close().map(drop)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What the file says.
    pub fn finish(self) -> Result<(), ParquetError> {
        self.0.close().map(drop)
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

/// The file with a row per run, under another name until it is complete.
pub struct RowFile {
    writer: RowWriter<File>,
    replacement: Replacement,
}

impl RowFile {
    /// Begins a file in a directory, which is made where there is none.
    ///
    /// # Errors
    /// One sentence that names the file.
    pub fn new(out: &Path) -> Result<Self, output::Error> {
        let target = &out.join(ROWS);
        let made = std::fs::create_dir_all(out).and_then(|()| {
            let replacement = Replacement::of(target)?;
            Ok((replacement.file()?, replacement))
        });
        let (file, replacement) = made.map_err(|error| output::Error::of_file(target, &error))?;
        let writer = RowWriter::new(file).map_err(|error| unwritten(target, error))?;
        Ok(Self {
            writer,
            replacement,
        })
    }

    /// Appends a row for each outcome.
    ///
    /// # Errors
    /// One sentence that names the file.
    pub fn write(&mut self, outcomes: &[Outcome]) -> Result<(), output::Error> {
        self.writer
            .write(outcomes)
            .map_err(|error| unwritten(self.replacement.target(), error))
    }

    /// Ends the file and puts it in its place.
    ///
    /// # Errors
    /// One sentence that names the file.
    pub fn keep(self) -> Result<(), output::Error> {
        let target = self.replacement.target().to_path_buf();
        self.writer
            .finish()
            .map_err(|error| unwritten(&target, error))?;
        self.replacement
            .keep()
            .map_err(|error| output::Error::of_file(&target, &error))
    }
}

/// What the file system said, where the Parquet writer passes it on.
fn unwritten(path: &Path, error: ParquetError) -> output::Error {
    let error = match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(error) => io::Error::other(error),
        },
        error => io::Error::other(error),
    };
    output::Error::of_file(path, &error)
}
