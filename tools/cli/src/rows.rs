//! The file with a row per run of a campaign, where `--rows` asks for it.

use crate::failure::Failure;
use campaign::Outcome;
#[cfg(feature = "formats")]
use campaign::rows::RowFile;
use std::path::Path;

/// Says whether this build writes the file.
pub fn check(asked: bool) -> Result<(), Failure> {
    if asked && cfg!(not(feature = "formats")) {
        let what = "--rows: this build leaves Parquet files out: build with `make build`, or with \
                    cargo's feature `formats`";
        return Err(Failure::Input(what.into()));
    }
    Ok(())
}

/// The rows of a campaign that is running.
pub struct Rows {
    #[cfg(feature = "formats")]
    file: Option<RowFile>,
}

#[cfg_attr(not(feature = "formats"), allow(unused_variables, unused_mut))]
impl Rows {
    /// Begins the file, if it is asked for, in a directory.
    pub fn begin(asked: bool, out: &Path) -> Result<Self, output::Error> {
        Ok(Self {
            #[cfg(feature = "formats")]
            file: asked.then(|| RowFile::new(out)).transpose()?,
        })
    }

    /// Appends a row for each outcome.
    pub fn write(&mut self, outcomes: &[Outcome]) -> Result<(), output::Error> {
        #[cfg(feature = "formats")]
        if let Some(file) = &mut self.file {
            return file.write(outcomes);
        }
        Ok(())
    }

    /// Ends the file and puts it in its place.
    pub fn keep(self) -> Result<(), output::Error> {
        #[cfg(feature = "formats")]
        if let Some(file) = self.file {
            return file.keep();
        }
        Ok(())
    }
}
