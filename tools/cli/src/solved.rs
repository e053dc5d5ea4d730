//! A solved design kept in a file, so that what has been solved need not be solved again.
//!
//! The file holds the design, a hash of everything that decided it (the whole request, logs and
//! tables included, and the program's version) and a hash of its own text. It is used only where all
//! of them fit, and every proof is checked again when it is read.

use crate::failure::Failure;
use ftc_design::assembly::Request;
use ftc_design::coverage::CoverageError;
use ftc_design::{Design, FORMAT, Solver};
use package::Replacement;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io::Write;
use std::path::Path;

/// The largest file that is read, in bytes.
const LARGEST_DESIGN: u64 = 1 << 30;

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
pub fn save(path: &Path, key: String, design: &Design) -> Result<(), Failure> {
    let failed = |what: String| Failure::Input(format!("--save {}: {what}", path.display()));
    let text = serde_json::to_string(design).map_err(|error| failed(error.to_string()))?;
    let solved = Solved {
        key,
        checksum: hash(&text),
        design: text,
    };
    let bytes = serde_json::to_vec(&solved).map_err(|error| failed(error.to_string()))?;
    let written = Replacement::of(path).and_then(|replacement| {
        replacement.file()?.write_all(&bytes)?;
        replacement.keep()
    });
    written.map_err(|error| failed(package::output::unwritten(&error, "file")))
}

/// Reads a solved design that belongs to this key, and proves it again.
pub fn load(path: &Path, key: &str) -> Result<Design, Failure> {
    let refused = |what: &str| {
        Failure::Input(format!(
            "--solved {}: {what}: make it again with ftc-fmu design --save",
            path.display()
        ))
    };
    let bytes = ftc_tables::read_regular(path, LARGEST_DESIGN)
        .map_err(|error| Failure::Input(format!("--solved {}: {error}", path.display())))?;
    let solved: Solved =
        serde_json::from_slice(&bytes).map_err(|_| refused("this is not a solved design"))?;
    if solved.key != key {
        return Err(refused(
            "this was solved for another design file, with another solver or by another version of this program",
        ));
    }
    if solved.checksum != hash(&solved.design) {
        return Err(refused("the file is damaged"));
    }
    let design: Design =
        serde_json::from_str(&solved.design).map_err(|_| refused("the file is damaged"))?;
    match ftc_design::coverage::prove(&design) {
        Ok(()) => Ok(design),
        Err(CoverageError::NoProof) => Err(refused("there is no proof in it")),
        Err(error) => Err(refused(&format!("its proof does not hold ({error})"))),
    }
}
