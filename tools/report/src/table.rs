//! Tables of numbers as CSV.

/// A table that is written row by row.
pub struct Table(csv::Writer<Vec<u8>>);

impl Table {
    /// A table with these columns.
    ///
    /// # Errors
    /// What the CSV writer says; so do all functions here.
    pub fn new(columns: impl IntoIterator<Item = impl AsRef<[u8]>>) -> csv::Result<Self> {
        let mut writer = csv::Writer::from_writer(Vec::new());
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

    /// The bytes of the whole table.
    ///
    /// # Errors
    /// See [`new`](Self::new).
    pub fn finish(self) -> csv::Result<Vec<u8>> {
        self.0
            .into_inner()
            .map_err(|error| error.into_error().into())
    }
}

/// The shortest text that reads back as the same double.
pub fn number(value: f64) -> String {
    format!("{value:?}")
}
