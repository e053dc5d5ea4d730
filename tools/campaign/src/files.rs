//! A campaign's results in files: read, and written together.

use crate::Partial;
use crate::page::{self, ReadError};
use ftc_design::Design;
use output::Staging;
use std::path::{Path, PathBuf};

/// Name of the result that merges.
pub const RESULT: &str = "campaign.json";
/// Name of the page.
pub const PAGE: &str = "campaign.html";
/// The largest result that is read, in bytes: it holds counts, however many runs there were.
const LARGEST_RESULT: u64 = 256 << 20;

/// A result that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file.
    #[error("{}: {source}", file.display())]
    File {
        /// Its path.
        file: PathBuf,
        /// Why not.
        source: ftc_tables::Error,
    },
    /// What stands in it.
    #[error("{}: {source}", file.display())]
    Contents {
        /// Its path.
        file: PathBuf,
        /// Why not.
        source: ReadError,
    },
}

/// Reads a [`RESULT`], and the number of runs that were asked for.
///
/// # Errors
/// [`Error`]
pub fn read(file: &Path) -> Result<(Partial, u64), Error> {
    let bytes = ftc_tables::read_regular(file, LARGEST_RESULT).map_err(|source| Error::File {
        file: file.into(),
        source,
    })?;
    page::read(&String::from_utf8_lossy(&bytes)).map_err(|source| Error::Contents {
        file: file.into(),
        source,
    })
}

/// Writes the result and the page into a directory, both or none, and returns their paths, the
/// result first. `asked` is the number of runs that were wanted.
///
/// # Errors
/// One sentence that names the directory.
pub fn write(
    out: &Path,
    design: &Design,
    whole: &Partial,
    asked: u64,
) -> Result<[PathBuf; 2], output::Error> {
    let staging = Staging::new(out)?;
    let result = format!("{:#}\n", page::json(whole, asked));
    staging.add(RESULT, result.as_bytes())?;
    staging.add(PAGE, page::html(design, whole, asked).as_bytes())?;
    staging.commit()?;
    Ok([RESULT, PAGE].map(|name| out.join(name)))
}
