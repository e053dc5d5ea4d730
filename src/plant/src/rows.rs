//! Matrices as lists of rows, the form a person writes, in every serialised file.

use nalgebra::DMatrix;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

/// A matrix given by rows of different lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("row {row} has the length {found}, but row 1 has {needed}")]
#[non_exhaustive]
pub struct RaggedRows {
    /// The first row that differs, from 1.
    pub row: usize,
    /// Its length.
    pub found: usize,
    /// The length of the first row.
    pub needed: usize,
}

/// Builds a matrix from its rows.
///
/// # Errors
/// The first row whose length differs.
pub fn from_rows(rows: &[Vec<f64>]) -> Result<DMatrix<f64>, RaggedRows> {
    let columns = rows.first().map_or(0, Vec::len);
    if let Some(bad) = rows.iter().position(|row| row.len() != columns) {
        return Err(RaggedRows {
            row: bad + 1,
            found: rows[bad].len(),
            needed: columns,
        });
    }
    Ok(DMatrix::from_fn(rows.len(), columns, |r, c| rows[r][c]))
}

/// The rows of a matrix.
pub fn to_rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

/// Serialises a matrix as its rows (`#[serde(with = "rows")]`).
pub fn serialize<S: Serializer>(matrix: &DMatrix<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    to_rows(matrix).serialize(serializer)
}

/// Reads a matrix from its rows.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<DMatrix<f64>, D::Error> {
    let rows = Vec::<Vec<f64>>::deserialize(deserializer)?;
    from_rows(&rows).map_err(D::Error::custom)
}
