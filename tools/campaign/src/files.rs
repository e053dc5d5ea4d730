//! A campaign's results in files: read, written together, and a row per run.

use crate::page::{self, ReadError};
use crate::rows::{self, RowWriter};
use crate::{Outcome, Partial};
use ftc_design::Design;
use output::{Replacement, Staging};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the result that merges.
pub const RESULT: &str = "campaign.json";
/// Name of the page.
pub const PAGE: &str = "campaign.html";
/// Name of the file with a row per run.
pub const ROWS: &str = "runs.parquet";
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

/// The file with a row per run, under another name until it is complete.
pub struct RowFile {
    writer: RowWriter<File>,
    replacement: Replacement,
}

impl RowFile {
    /// Begins a file in a directory, which is made where there is none.
    ///
    /// # Errors
    /// One sentence that names the file.
    pub fn new(out: &Path) -> Result<Self, output::Error> {
        let target = &out.join(ROWS);
        let made = std::fs::create_dir_all(out).and_then(|()| {
            let replacement = Replacement::of(target)?;
            Ok((replacement.file()?, replacement))
        });
        let (file, replacement) = made.map_err(|error| output::Error::of_file(target, &error))?;
        let writer = RowWriter::new(file).map_err(|error| unwritten(target, error))?;
        Ok(Self {
            writer,
            replacement,
        })
    }

    /// Appends a row for each outcome.
    ///
    /// # Errors
    /// One sentence that names the file.
    pub fn write(&mut self, outcomes: &[Outcome]) -> Result<(), output::Error> {
        self.writer
            .write(outcomes)
            .map_err(|error| unwritten(self.replacement.target(), error))
    }

    /// Ends the file and puts it in its place.
    ///
    /// # Errors
    /// One sentence that names the file.
    pub fn keep(self) -> Result<(), output::Error> {
        let target = self.replacement.target().to_path_buf();
        self.writer
            .finish()
            .map_err(|error| unwritten(&target, error))?;
        self.replacement
            .keep()
            .map_err(|error| output::Error::of_file(&target, &error))
    }
}

/// What the file system said, where the Parquet writer passes it on.
fn unwritten(path: &Path, error: rows::Error) -> output::Error {
    let error = match error {
        rows::Error::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(error) => io::Error::other(error),
        },
        error => io::Error::other(error),
    };
    output::Error::of_file(path, &error)
}
