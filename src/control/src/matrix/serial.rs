//! A matrix is serialised as a list of rows, in binary formats as bytes: numbers of rows and columns (32 bits each), then the entries (64 bits
//! each) column after column, all little-endian. Of a triangular matrix only the triangle is written.

use super::Matrix;
use alloc::vec::Vec;
use core::fmt;
use serde::de::{Deserialize, Deserializer, Error, Visitor};
use serde::ser::{self, Serialize, SerializeSeq, Serializer};

/// One row of a matrix, to be serialised.
struct Row<'a>(&'a Matrix, usize);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.row(self.1))
    }
}

impl Serialize for Matrix {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if !serializer.is_human_readable() {
            let entries = self.entries.iter().copied();
            return serialize(self.shape(), entries, serializer);
        }
        let mut rows = serializer.serialize_seq(Some(self.rows))?;
        for row in 0..self.rows {
            rows.serialize_element(&Row(self, row))?;
        }
        rows.end()
    }
}

impl<'de> Deserialize<'de> for Matrix {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if !deserializer.is_human_readable() {
            return deserializer.deserialize_bytes(Reader::<false>);
        }
        let rows = Vec::<Vec<f64>>::deserialize(deserializer)?;
        Self::try_from_rows(&rows).map_err(D::Error::custom)
    }
}

/// Writes the sizes and these entries.
fn serialize<S: Serializer>(
    (rows, columns): (usize, usize),
    entries: impl Iterator<Item = f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut bytes = Vec::new();
    for size in [rows, columns] {
        let size = u32::try_from(size).map_err(ser::Error::custom)?;
        bytes.extend(size.to_le_bytes());
    }
    bytes.extend(entries.flat_map(f64::to_le_bytes));
    serializer.serialize_bytes(&bytes)
}

/// Reads a matrix of which every entry, or with `TRIANGLE` the upper triangle, was written.
struct Reader<const TRIANGLE: bool>;

impl<const TRIANGLE: bool> Visitor<'_> for Reader<TRIANGLE> {
    type Value = Matrix;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the bytes of a matrix")
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Matrix, E> {
        read::<TRIANGLE>(bytes)
            .ok_or_else(|| E::custom("a matrix has not as many entries as its size asks for"))
    }
}

fn read<const TRIANGLE: bool>(bytes: &[u8]) -> Option<Matrix> {
    let (rows, rest) = bytes.split_first_chunk()?;
    let (columns, rest) = rest.split_first_chunk()?;
    let [rows, columns] = [*rows, *columns].map(|size| u32::from_le_bytes(size) as usize);
    let (entries, []) = rest.as_chunks() else {
        return None;
    };
    let needed = match TRIANGLE {
        true if rows == columns => rows.checked_mul(rows.checked_add(1)?)? / 2,
        true => return None,
        false => rows.checked_mul(columns)?,
    };
    if entries.len() != needed {
        return None;
    }
    let number = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
    if !TRIANGLE {
        let entries = entries.iter().map(number).collect();
        return Some(Matrix {
            rows,
            columns,
            entries,
        });
    }
    let mut matrix = Matrix::zeros(rows, columns);
    let mut rest = entries;
    for (column, places) in (matrix.entries.chunks_exact_mut(rows.max(1))).enumerate() {
        let (these, others) = rest.split_at_checked(column + 1)?;
        (places.iter_mut().zip(these)).for_each(|(place, entry)| *place = number(entry));
        rest = others;
    }
    Some(matrix)
}

/// An upper triangular matrix (`#[serde(with = "upper_triangle")]`): in binary formats its triangle, in
/// others all rows.
pub(crate) mod upper_triangle {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(
        matrix: &Matrix,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            return matrix.serialize(serializer);
        }
        let columns = matrix.columns().enumerate();
        let triangle = columns.flat_map(|(column, entries)| entries.iter().take(column + 1));
        super::serialize(matrix.shape(), triangle.copied(), serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Matrix, D::Error> {
        match deserializer.is_human_readable() {
            true => Matrix::deserialize(deserializer),
            false => deserializer.deserialize_bytes(Reader::<true>),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(sizes: [u32; 2], entries: &[f64]) -> Vec<u8> {
        let sizes = sizes.iter().flat_map(|size| size.to_le_bytes());
        sizes
            .chain(entries.iter().flat_map(|entry| entry.to_le_bytes()))
            .collect()
    }

    #[test]
    fn entries_stand_column_after_column() {
        let matrix = Matrix::from_rows(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let written = bytes([2, 3], &[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        assert_eq!(read::<false>(&written), Some(matrix));
        assert_eq!(
            read::<false>(&bytes([2, 0], &[])),
            Some(Matrix::zeros(2, 0))
        );
        let triangle = Matrix::from_rows(&[[1.0, 2.0, 4.0], [0.0, 3.0, 5.0], [0.0, 0.0, 6.0]]);
        let written = bytes([3, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(read::<true>(&written), Some(triangle));
    }

    #[test]
    fn sizes_that_do_not_fit_the_entries_are_refused() {
        let four = [1.0; 4];
        let most = u32::MAX;
        for sizes in [[1, 3], [most, most], [most, 1], [0, most], [3, 2]] {
            assert_eq!(read::<false>(&bytes(sizes, &four)), None, "{sizes:?}");
            assert_eq!(read::<true>(&bytes(sizes, &four)), None, "{sizes:?}");
        }
        let whole = bytes([2, 2], &four);
        assert!(read::<false>(&whole).is_some());
        for length in (0..whole.len()).chain([whole.len() + 1]) {
            let mut cut = whole.clone();
            cut.resize(length, 0);
            assert_eq!(read::<false>(&cut), None, "{length} bytes");
        }
        assert_eq!(read::<true>(&[]), None);
    }
}
