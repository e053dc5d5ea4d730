//! Why an FMU was not written, or not verified.

use std::path::PathBuf;

/// What went wrong. Each reads as one sentence that says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The design has no certificate, or one that does not check.
    #[error("{0}: design it again")]
    Uncertified(String),
    /// No platform has current binaries.
    #[error("no FMU binary is built: {} is missing: run make build", library.display())]
    NoBinaries {
        /// The library that was looked for.
        library: PathBuf,
    },
    /// A platform was asked for that has no binaries here.
    #[error("platforms: {platform} has no FMU binaries here: give one or more of {}", built.join(", "))]
    NoPlatform {
        /// The platform.
        platform: String,
        /// Those that have some.
        built: Vec<&'static str>,
    },
    /// A binary that was found cannot be read.
    #[error("cannot read {} ({source}): build it again", library.display())]
    Binary {
        /// The library.
        library: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A key that signs or verifies.
    #[error("{option} {} {what}", file.display())]
    Key {
        /// The option that names it: `sign` or `key`.
        option: &'static str,
        /// The key file.
        file: PathBuf,
        /// Why not.
        what: String,
    },
    /// The output directory.
    #[error(transparent)]
    Output(#[from] output::Error),
    /// A file's contents could not be made from this design.
    #[error("{file}: {what}")]
    Contents {
        /// The file.
        file: String,
        /// Why not.
        what: String,
    },
    /// The FMU cannot be read, or is not one that this program wrote.
    #[error("{}: {what}", fmu.display())]
    Unreadable {
        /// The FMU.
        fmu: PathBuf,
        /// Why not.
        what: String,
    },
    /// The FMU does not hold what it promises.
    #[error("{}: {what}", fmu.display())]
    Unproved {
        /// The FMU.
        fmu: PathBuf,
        /// What does not hold.
        what: String,
    },
}
