//! Matrices in MATLAB files (level 5, compressed or not, and 7.3, which is HDF5) and NumPy archives.
//!
//! Every real array is found under its name, a field of a structure under `structure.field`.

mod archive;
mod hdf5;
mod level5;

use crate::silent::caught;
use crate::{EntryError, Error, MatrixError, quote, read_regular};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::path::Path;

/// The most bytes of a file that are read: matrices of control models are small.
const MOST_BYTES: u64 = 64 << 20;
/// The most entries of an array that is taken for a matrix.
const MOST_ENTRIES: usize = 1 << 20;
/// How deep structures may be nested.
const DEEPEST: usize = 8;

/// What a file holds under a name: a matrix, or why it is none.
type Found = BTreeMap<String, Result<DMatrix<f64>, EntryError>>;

/// The matrices of one file.
#[derive(Clone, Debug)]
pub struct Matrices {
    found: Found,
}

impl Matrices {
    /// Reads a `.mat` or `.npz` file; which one it is, is told by its first bytes.
    ///
    /// # Errors
    /// A file that cannot be read, has no format that is known, or holds no matrix.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let bytes = read_regular(path, MOST_BYTES)?;
        // The readers of damaged files are not proof against every length that a file may claim.
        let found = caught(|| parse(bytes)).unwrap_or_else(|| Err(MatrixError::Damaged.into()))?;
        if found.is_empty() {
            return Err(MatrixError::Empty.into());
        }
        Ok(Self { found })
    }

    /// Whether something bears this name.
    pub fn holds(&self, name: &str) -> bool {
        self.found.contains_key(name)
    }

    /// The names of what is there, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.found.keys().map(String::as_str)
    }

    /// The matrix of this name (rows and columns as the user sees them).
    ///
    /// # Errors
    /// No variable of this name, or one that is no real matrix.
    pub fn matrix(&self, name: &str) -> Result<DMatrix<f64>, MatrixError> {
        match self.found.get(name) {
            Some(Ok(matrix)) => Ok(matrix.clone()),
            Some(Err(why)) => Err(MatrixError::Variable {
                name: name.to_string(),
                why: why.clone(),
            }),
            None => Err(MatrixError::Missing {
                name: quote(name),
                names: self.names().map(str::to_string).collect(),
            }),
        }
    }
}

fn parse(bytes: Vec<u8>) -> Result<Found, Error> {
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
