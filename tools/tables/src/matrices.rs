//! Matrices in MATLAB files (level 5, compressed or not, and 7.3, which is HDF5) and NumPy archives.
//!
//! Every real array is found under its name, a field of a structure under `structure.field`.

mod archive;
mod hdf5;
mod level5;

use crate::silent::caught;
use crate::{open_regular, quote};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// The most bytes of a file that are read: matrices of control models are small.
const MOST_BYTES: u64 = 64 << 20;
/// The most entries of an array that is taken for a matrix.
const MOST_ENTRIES: usize = 1 << 20;
/// How deep structures may be nested.
const DEEPEST: usize = 8;

/// What a file holds under a name: a matrix, or why it is none.
type Found = BTreeMap<String, Result<DMatrix<f64>, String>>;

/// The matrices of one file.
#[derive(Clone, Debug)]
pub struct Matrices {
    found: Found,
}

impl Matrices {
    /// Reads a `.mat` or `.npz` file; which one it is, is told by its first bytes.
    ///
    /// # Errors
    /// The end of a sentence that begins with the file's name.
    pub fn read(path: &Path) -> Result<Self, String> {
        let mut bytes = Vec::new();
        open_regular(path, MOST_BYTES)?
            .read_to_end(&mut bytes)
            .map_err(|error| format!("cannot be read ({error}): check the file"))?;
        if bytes.len() as u64 > MOST_BYTES {
            return Err(format!(
                "has more than {} MB: keep to the matrices of the model",
                MOST_BYTES >> 20
            ));
        }
        // The readers of damaged files are not proof against every length that a file may claim.
        let found =
            caught(|| parse(bytes)).unwrap_or_else(|| Err("is damaged: save it again".into()))?;
        if found.is_empty() {
            return Err("holds no matrix: save A, B and C into it".into());
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
    /// The end of a sentence that begins with the file's name.
    pub fn matrix(&self, name: &str) -> Result<DMatrix<f64>, String> {
        match self.found.get(name) {
            Some(Ok(matrix)) => Ok(matrix.clone()),
            Some(Err(what)) => Err(format!("{name} {what}")),
            None => {
                let names: Vec<&str> = self.names().collect();
                Err(format!(
                    "has no variable {}: name one of {}",
                    quote(name),
                    names.join(", ")
                ))
            }
        }
    }
}

fn parse(bytes: Vec<u8>) -> Result<Found, String> {
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
        return Err("is a single NumPy array: save A, B and C together with numpy.savez".into());
    }
    Err(
        "is neither a MATLAB file (level 5 or 7.3) nor a NumPy archive (.npz): \
         save it with save(...) in MATLAB, scipy.io.savemat or numpy.savez"
            .into(),
    )
}

/// The byte order mark that ends the header of a level 5 file.
fn is_level5_mark(mark: &[u8]) -> bool {
    mark == b"IM" || mark == b"MI"
}

/// A matrix from its entries column by column, if it is one.
fn from_columns(shape: &[usize], entries: &[f64]) -> Result<DMatrix<f64>, String> {
    check_shape(shape)?;
    match *shape {
        [rows, columns] if rows * columns == entries.len() => {
            Ok(DMatrix::from_column_slice(rows, columns, entries))
        }
        _ => Err("is damaged: save it again".into()),
    }
}

/// Says why an array of this shape is no matrix.
fn check_shape(shape: &[usize]) -> Result<(), String> {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let sizes = sizes.join(" x ");
    let entries = shape.iter().try_fold(1usize, |all, &n| all.checked_mul(n));
    match shape.len() {
        2 if entries.is_some_and(|n| n <= MOST_ENTRIES) => Ok(()),
        2 => Err(format!(
            "has {sizes} entries, more than a model has: name another variable"
        )),
        0 | 1 => Err(format!(
            "has one dimension ({sizes} entries): save it with two, as a row or a column"
        )),
        _ => Err(format!(
            "has {} dimensions ({sizes}): save one matrix per mode",
            shape.len()
        )),
    }
}
