//! The file with a row per run of a campaign, where `--rows` asks for it.

use crate::failure::Failure;
use campaign::Outcome;
#[cfg(feature = "formats")]
use campaign::rows::RowFile;
use std::path::Path;

/// Whether this build writes the file.
pub const BUILT: bool = cfg!(feature = "formats");

/// Refuses a file that is asked for in a build that does not write it.
pub fn check(asked: bool, built: bool) -> Result<(), Failure> {
    if asked && !built {
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

#[cfg(test)]
mod tests {
    use super::check;

    #[test]
    fn a_build_without_parquet_says_how_to_get_it() {
        assert!(check(false, false).is_ok() && check(true, true).is_ok());
        let refused = check(true, false).expect_err("nothing can write it");
        assert_eq!(refused.exit_code(), crate::INPUT);
        let sentence = refused.to_string();
        assert!(sentence.contains("--rows: this build leaves Parquet files out"));
        assert!(sentence.contains("build with `make build`"));
    }
}
