//! Matrices as lists of rows, the form a person writes, in every serialised file.

use nalgebra::DMatrix;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

/// Builds a matrix from its rows; the error names the first row whose length differs.
pub fn from_rows(rows: &[Vec<f64>]) -> Result<DMatrix<f64>, String> {
    let columns = rows.first().map_or(0, Vec::len);
    if let Some(bad) = rows.iter().position(|row| row.len() != columns) {
        return Err(format!(
            "row {} has {} entries where row 1 has {columns}",
            bad + 1,
            rows[bad].len()
        ));
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
