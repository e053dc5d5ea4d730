//! Matrices in MATLAB files (level 5, compressed or not, and 7.3, which is HDF5) and NumPy archives.
//!
//! Every real array is found under its name, a field of a structure under `structure.field`.

#[cfg(feature = "formats")]
mod formats;

#[cfg(feature = "formats")]
use formats::parse;

use crate::silent::caught;
use crate::{EntryError, Error, MatrixError, quote, read_regular};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::path::Path;

/// The most bytes of a file that are read: matrices of control models are small.
const MOST_BYTES: u64 = 64 << 20;

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

/// Without the readers, every file is refused.
#[cfg(not(feature = "formats"))]
fn parse(_: Vec<u8>) -> Result<Found, Error> {
    Err(MatrixError::NotBuilt.into())
}

#[cfg(all(test, not(feature = "formats")))]
mod tests {
    use super::Matrices;

    #[test]
    fn a_build_without_the_readers_says_how_to_get_them() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), b"MATLAB 5.0 MAT-file").expect("written");
        let refused = Matrices::read(file.path()).expect_err("nothing can read it");
        assert!(refused.to_string().contains("build with `make build`"));
    }
}
