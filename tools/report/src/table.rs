//! Tables of numbers as CSV.

use std::io::Write;

/// A table that is written row by row.
pub struct Table<W: Write = Vec<u8>>(csv::Writer<W>);

impl Table {
    /// A table with these columns, in memory.
    ///
    /// # Errors
    /// What the CSV writer says; so do all functions here.
    pub fn new(columns: impl IntoIterator<Item = impl AsRef<[u8]>>) -> csv::Result<Self> {
        Self::into_sink(Vec::new(), columns)
    }
}

impl<W: Write> Table<W> {
    /// A table with these columns that goes where it is told as it grows.
    ///
    /// # Errors
    /// See [`new`](Table::new).
    pub fn into_sink(
        sink: W,
        columns: impl IntoIterator<Item = impl AsRef<[u8]>>,
    ) -> csv::Result<Self> {
        let mut writer = csv::Writer::from_writer(sink);
        writer.write_record(columns)?;
        Ok(Self(writer))
    }

    /// Adds a row.
    ///
    /// # Errors
    /// A row that has not as many cells as there are columns.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl AsRef<[u8]>>) -> csv::Result<()> {
        self.0.write_record(cells)
    }

    /// Where the whole table went: its bytes, where it was made in memory.
    ///
    /// # Errors
    /// See [`new`](Table::new).
    pub fn finish(self) -> csv::Result<W> {
        self.0
            .into_inner()
            .map_err(|error| error.into_error().into())
    }
}

/// The shortest text that reads back as the same double.
pub fn number(value: f64) -> String {
    format!("{value:?}")
}
