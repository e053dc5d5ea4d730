//! A dense matrix as plain data: entries column after column.

mod serial;

pub(crate) use serial::upper_triangle;

use alloc::vec;
use alloc::vec::Vec;

/// A matrix of `f64`, column-major; what the on-line path multiplies with.
///
/// ```
/// let gain = ftc_control::Matrix::from_rows(&[[1.0, 2.0], [3.0, 4.0]]);
/// assert_eq!((gain.shape(), gain.get(1, 0)), ((2, 2), Some(3.0)));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    /// Column after column (rows x columns entries).
    entries: Vec<f64>,
}

/// The rows of a matrix differ in length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("row {row} has {found} entries where row 1 has {expected}")]
#[non_exhaustive]
pub struct UnequalRows {
    /// Number of the first row that differs, from 1.
    pub row: usize,
    /// How many entries it has.
    pub found: usize,
    /// How many the first row has.
    pub expected: usize,
}

impl Matrix {
    /// All entries zero.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            entries: vec![0.0; rows * columns],
        }
    }

    /// Ones on the diagonal, zeros elsewhere.
    pub fn identity(size: usize) -> Self {
        Self::from_fn(size, size, |row, column| f64::from(row == column))
    }

    /// Each entry from its row and column (0-based).
    pub fn from_fn(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let entry = &entry;
        let entries = (0..columns).flat_map(|column| (0..rows).map(move |row| entry(row, column)));
        Self {
            rows,
            columns,
            entries: entries.collect(),
        }
    }

    /// From rows of one length.
    pub fn from_rows<const ROWS: usize, const COLUMNS: usize>(
        rows: &[[f64; COLUMNS]; ROWS],
    ) -> Self {
        Self::from_fn(ROWS, COLUMNS, |row, column| rows[row][column])
    }

    /// From rows whose lengths are only known at run time.
    ///
    /// # Errors
    /// The first row whose length differs from that of the first.
    pub fn try_from_rows<R: AsRef<[f64]>>(rows: &[R]) -> Result<Self, UnequalRows> {
        let columns = rows.first().map_or(0, |row| row.as_ref().len());
        let lengths = rows.iter().map(|row| row.as_ref().len());
        if let Some((index, found)) = lengths.enumerate().find(|&(_, found)| found != columns) {
            return Err(UnequalRows {
                row: index + 1,
                found,
                expected: columns,
            });
        }
        Ok(Self::from_fn(rows.len(), columns, |row, column| {
            rows[row].as_ref()[column]
        }))
    }

    /// Number of rows.
    pub fn nrows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn ncols(&self) -> usize {
        self.columns
    }

    /// Rows and columns.
    pub fn shape(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Whether there are no entries.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// One entry (0-based), if there is such a row and column.
    pub fn get(&self, row: usize, column: usize) -> Option<f64> {
        match row < self.rows && column < self.columns {
            true => self.entries.get(column * self.rows + row).copied(),
            false => None,
        }
    }

    /// All entries, column after column.
    pub fn as_slice(&self) -> &[f64] {
        &self.entries
    }

    /// All entries, column after column, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.entries
    }

    /// The columns, each contiguous; none where there are no rows.
    pub fn columns(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.entries.chunks_exact(self.rows.max(1))
    }

    /// One row (0-based), entry by entry.
    pub fn row(&self, row: usize) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.columns).map(move |column| self.entries[column * self.rows + row])
    }

    /// Whether every entry is a finite number.
    pub fn is_finite(&self) -> bool {
        all_finite(&self.entries)
    }

    /// Every entry multiplied by `factor`.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.entries.iter_mut().for_each(|entry| *entry *= factor);
        self
    }
}

/// Whether every value is a finite number. All of them are looked at, so that several are at a time.
pub(crate) fn all_finite(values: &[f64]) -> bool {
    (values.iter()).fold(true, |finite, value| finite & value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_matrix_is_written_and_read_as_its_rows() {
        for text in ["[[1.0,2.0,3.0],[4.0,5.0,6.0]]", "[[],[]]", "[]"] {
            let matrix: Matrix = serde_json::from_str(text).unwrap();
            assert_eq!(serde_json::to_string(&matrix).unwrap(), text);
        }
        let matrix: Matrix = serde_json::from_str("[[1.0,2.0],[3.0,4.0]]").unwrap();
        assert_eq!(matrix.as_slice(), [1.0, 3.0, 2.0, 4.0]);
        assert!(matrix.get(0, 2).is_none() && matrix.get(2, 0).is_none());
    }

    #[test]
    fn rows_of_unequal_length_are_refused_by_number() {
        let error = serde_json::from_str::<Matrix>("[[1.0],[1.0,2.0]]").unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("row 2 has 2 entries where row 1 has 1")
        );
    }
}
