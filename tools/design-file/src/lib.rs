//! Design files: from TOML and the tables and logs it names to a request the method understands, or
//! one sentence that says what is wrong with which key.
//!
//! [`schema`] is what a file may hold, [`defaults`] what an absent key means, [`check`] what a value
//! must satisfy; [`wording`] says why there is no design. [`identification`] writes a design file from logs, [`examples`] are some to start from.
//!
//! ```
//! use std::path::Path;
//!
//! let text = r#"
//! name = "heater"
//! sample_time = 10.0
//! [[mode]]
//! A = [[0.9]]
//! B = [[0.2]]
//! C = [[1.0]]
//! [controller]
//! decay = 1.5
//! "#;
//! let error = design_file::parse(text, Path::new("")).unwrap_err();
//! assert_eq!(error.key.as_deref(), Some("controller.decay"));
//! assert_eq!(error.line, Some(9));
//!
//! let loaded = design_file::parse(&text.replace("1.5", "0.95"), Path::new("")).unwrap();
//! assert_eq!(loaded.request.plant.modes.len(), 1);
//! ```

mod assemble;
pub mod check;
mod complaint;
pub mod defaults;
mod error;
mod estimator;
mod event;
pub mod examples;
mod experiment;
mod healthy_log;
pub mod identification;
mod notes;
mod plant;
pub mod schema;
pub mod sentence;
mod shape;
mod signal;
pub mod suggest;
mod true_plant;
pub mod values;
pub mod wording;

pub use complaint::{Complaint, Key};
pub use error::Error;
use ftc_design::assembly::Request;
use notes::Notes;
use schema::DesignFile;
use std::io::Read;
use std::path::Path;
use toml::de::DeTable;

/// The largest design file that is read; long tables belong in CSV files.
const LARGEST_FILE: u64 = 4 << 20;

/// A design file that was read.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Loaded {
    /// What stands in it.
    pub file: DesignFile,
    /// What it asks for, with every default filled in and every log read.
    pub request: Request,
    /// What its user should know of the files it names: one sentence each.
    pub notes: Vec<String>,
}

/// Reads a design file, and the tables and logs that it names relative to its own folder.
///
/// # Errors
/// What is wrong with it, with the key and line at fault.
pub fn read(path: &Path) -> Result<Loaded, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    load(path)
        .and_then(|text| parse(&text, folder))
        .map_err(|error| error.in_file(path))
}

/// Reads the text of a design file; tables and logs are sought in `folder`.
///
/// # Errors
/// What is wrong with it, with the key and line at fault.
pub fn parse(text: &str, folder: &Path) -> Result<Loaded, Error> {
    let file = deserialize(text)?;
    let notes = Notes::default();
    let request = assemble::request(&file, folder, &notes)
        .map_err(|complaint| Error::of_request(text, &complaint))?;
    Ok(Loaded {
        file,
        request,
        notes: notes.into_sentences(),
    })
}

fn deserialize(text: &str) -> Result<DesignFile, Error> {
    let document = DeTable::parse(text).map_err(|error| sentence::syntax(text, &error))?;
    shape::check(text, document.get_ref())?;
    serde_path_to_error::deserialize(toml::Deserializer::from(document))
        .map_err(|error| sentence::mismatch(text, error.path(), error.inner()))
}

/// Whether thresholds rest on nothing: no noise, no threshold and no log is given.
pub fn noise_is_unknown(file: &DesignFile) -> bool {
    let estimator = &file.estimator;
    let logs = estimator.logs().is_some();
    let unknown = file.scenario.noise.is_none() && estimator.threshold.is_none() && !logs;
    unknown && estimator.method != Some(schema::EstimatorMethod::None)
}

/// The text of a design file.
///
/// # Errors
/// A file that cannot be read, is larger than a design file, empty or not UTF-8.
pub fn load(path: &Path) -> Result<String, Error> {
    let mut bytes = Vec::new();
    ftc_tables::open_regular(path, LARGEST_FILE)
        .map_err(|what| match path.is_dir() {
            true => Error::of_file("this is a directory: name a design file (TOML) in it"),
            false => Error::of_file(what.to_string()),
        })?
        .read_to_end(&mut bytes)
        .map_err(|error| Error::of_file(format!("cannot be read ({error}): check the path")))?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(Error::of_file(format!(
            "is larger than {} MB: put long tables into CSV files",
            LARGEST_FILE >> 20
        )));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        Error::of_file(format!(
            "byte {} is not UTF-8: save the design file as UTF-8 text",
            error.utf8_error().valid_up_to() + 1
        ))
    })?;
    if text.trim().is_empty() {
        return Err(Error::of_file(
            "the file is empty: start from one of the files in examples/",
        ));
    }
    Ok(text)
}
