//! The formats by the crates that read them, behind the feature `formats`: they take longer to compile than
//! the method itself.

mod archive;
mod hdf5;
mod level5;

use super::Found;
use crate::{EntryError, Error, MatrixError};
use nalgebra::DMatrix;

/// The most entries of an array that is taken for a matrix.
const MOST_ENTRIES: usize = 1 << 20;
/// How deep structures may be nested.
const DEEPEST: usize = 8;

/// What a file of one of the formats holds.
pub(super) fn parse(bytes: Vec<u8>) -> Result<Found, Error> {
    if bytes.starts_with(b"PK") {
        return archive::read(bytes);
    }
    if hdf5_pure::is_hdf5_bytes(&bytes) {
        return hdf5::read(bytes);
    }
    if bytes.starts_with(b"MATLAB 5.0") || bytes.get(126..128).is_some_and(is_level5_mark) {
        return level5::read(&bytes);
    }
    if bytes.starts_with(b"\x93NUMPY") {
        return Err(MatrixError::SingleArray.into());
    }
    Err(MatrixError::Format.into())
}

/// The byte order mark that ends the header of a level 5 file.
fn is_level5_mark(mark: &[u8]) -> bool {
    mark == b"IM" || mark == b"MI"
}

/// A matrix from its entries column by column, if it is one.
fn from_columns(shape: &[usize], entries: &[f64]) -> Result<DMatrix<f64>, EntryError> {
    check_shape(shape)?;
    match *shape {
        [rows, columns] if rows * columns == entries.len() => {
            Ok(DMatrix::from_column_slice(rows, columns, entries))
        }
        _ => Err(EntryError::Damaged),
    }
}

/// Says why an array of this shape is no matrix.
fn check_shape(shape: &[usize]) -> Result<(), EntryError> {
    let entries = shape.iter().try_fold(1usize, |all, &n| all.checked_mul(n));
    match shape.len() {
        2 if entries.is_some_and(|n| n <= MOST_ENTRIES) => Ok(()),
        2 => Err(EntryError::TooLarge(shape.to_vec())),
        0 | 1 => Err(EntryError::OneDimension(shape.to_vec())),
        _ => Err(EntryError::Dimensions(shape.to_vec())),
    }
}
