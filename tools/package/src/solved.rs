//! A solved design kept in a file, so that what has been solved need not be solved again.
//!
//! The file holds the design, a hash of everything that decided it (the whole request, logs and
//! tables included, and the program's version) and a hash of its own text. It is used only where all
//! of them fit, and every proof is checked again when it is read.

use ftc_design::assembly::Request;
use ftc_design::coverage::CoverageError;
use ftc_design::{Design, FORMAT, Solver};
use output::Replacement;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io::Write;
use std::path::Path;

/// The largest file that is read, in bytes.
const LARGEST_DESIGN: u64 = 1 << 30;

/// Why a design was not kept. Each reads as the end of a sentence that begins with the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The design does not become text.
    #[error(transparent)]
    Text(#[from] serde_json::Error),
    /// The file cannot be written.
    #[error("{}", output::unwritten(.0, "file"))]
    Write(#[from] std::io::Error),
}

/// Why a kept design is not used. Each reads as the end of a sentence that begins with the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ftc_tables::Error),
    /// The file must be made again.
    #[error(transparent)]
    Unusable(#[from] Unusable),
}

/// Why a file that was read must be made again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Unusable {
    /// It is something else.
    #[error("this is not a solved design")]
    Other,
    /// Its key is another one.
    #[error(
        "this was solved for another design file, with another solver or by another version of this program"
    )]
    Key,
    /// Its text is not that which was written.
    #[error("the file is damaged")]
    Damaged,
    /// It claims nothing.
    #[error("there is no proof in it")]
    NoProof,
    /// What it claims does not hold.
    #[error("its proof does not hold ({0})")]
    Proof(CoverageError),
}

/// What stands in the file.
#[derive(Deserialize, Serialize)]
struct Solved {
    /// Hash of what decided the design.
    key: String,
    /// Hash of the design's text.
    checksum: String,
    /// The design, as JSON text.
    design: String,
}

/// The hash of everything that decides a design.
pub fn key(request: &Request, solver: Solver) -> String {
    let version = env!("CARGO_PKG_VERSION");
    hash(&format!(
        "ftc-fmu {version}, format {FORMAT}, {solver:?}\n{request:?}"
    ))
}

fn hash(text: &str) -> String {
    let digest = Sha256::digest(text.as_bytes());
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes a solved design, whole or not at all.
///
/// # Errors
/// [`SaveError`]
pub fn save(path: &Path, key: String, design: &Design) -> Result<(), SaveError> {
    let text = serde_json::to_string(design)?;
    let solved = Solved {
        key,
        checksum: hash(&text),
        design: text,
    };
    let bytes = serde_json::to_vec(&solved)?;
    let replacement = Replacement::of(path)?;
    replacement.file()?.write_all(&bytes)?;
    Ok(replacement.keep()?)
}

/// Whether a design can be kept at this path.
///
/// # Errors
/// [`SaveError::Write`]
pub fn check_place(path: &Path) -> Result<(), SaveError> {
    Ok(Replacement::of(path).map(drop)?)
}

/// Reads a solved design that belongs to this key, and proves it again.
///
/// # Errors
/// [`LoadError`]
pub fn load(path: &Path, key: &str) -> Result<Design, LoadError> {
    let bytes = ftc_tables::read_regular(path, LARGEST_DESIGN)?;
    let solved: Solved = serde_json::from_slice(&bytes).map_err(|_| Unusable::Other)?;
    if solved.key != key {
        return Err(Unusable::Key.into());
    }
    if solved.checksum != hash(&solved.design) {
        return Err(Unusable::Damaged.into());
    }
    let design: Design = serde_json::from_str(&solved.design).map_err(|_| Unusable::Damaged)?;
    match ftc_design::coverage::prove(&design) {
        Ok(()) => Ok(design),
        Err(CoverageError::NoProof) => Err(Unusable::NoProof.into()),
        Err(error) => Err(Unusable::Proof(error).into()),
    }
}
