//! Design files: from TOML and the tables and logs it names to a request the method understands, or
//! one sentence that says what is wrong with which key.
//!
//! [`schema`] is what a file may hold, [`defaults`] what an absent key means, [`check`] what a value
//! must satisfy; [`assemble`] turns all of it into a [`Request`], [`healthy_log`] reads logs.

pub mod assemble;
pub mod check;
pub mod defaults;
mod error;
pub mod healthy_log;
pub mod schema;
pub mod sentence;
mod signal;
pub mod suggest;
pub mod values;

pub use error::Error;
use ftc_design::assembly::Request;
use schema::DesignFile;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use values::NameOrList;

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
}

/// Reads a design file, and the tables and logs that it names relative to its own folder.
///
/// # Errors
/// What is wrong with it, with the key and line at fault.
pub fn read(path: &Path) -> Result<Loaded, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    load(path)
        .map_err(Error::of_file)
        .and_then(|text| parse(&text, folder))
        .map_err(|error| error.in_file(path))
}

/// Reads the text of a design file; tables and logs are sought in `folder`.
///
/// # Errors
/// What is wrong with it, with the key and line at fault.
pub fn parse(text: &str, folder: &Path) -> Result<Loaded, Error> {
    let file = deserialize(text)?;
    let request =
        assemble::request(&file, folder).map_err(|sentence| Error::of_request(text, sentence))?;
    Ok(Loaded { file, request })
}

fn deserialize(text: &str) -> Result<DesignFile, Error> {
    let document =
        toml::Deserializer::parse(text).map_err(|error| sentence::syntax(text, &error))?;
    serde_path_to_error::deserialize(document)
        .map_err(|error| sentence::mismatch(text, error.path(), error.inner()))
}

/// Whether thresholds rest on nothing: no noise, no threshold and no log is given.
pub fn noise_is_unknown(file: &DesignFile) -> bool {
    let estimator = &file.estimator;
    let logs = match &estimator.database {
        Some(NameOrList::Name(name)) => name != "commission" && name != "model",
        Some(NameOrList::List(_)) => true,
        None => false,
    };
    let unknown = file.scenario.noise.is_none() && estimator.threshold.is_none() && !logs;
    unknown && estimator.method != Some(schema::EstimatorMethod::None)
}

/// The text of a design file.
///
/// # Errors
/// The end of a sentence that begins with the file's name.
pub fn load(path: &Path) -> Result<String, String> {
    if path.is_dir() {
        return Err("this is a directory: name a design file (TOML) in it".into());
    }
    let file = File::open(path).map_err(|error| {
        format!("cannot be opened ({error}): check the path and its permissions")
    })?;
    let mut bytes = Vec::new();
    file.take(LARGEST_FILE + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| format!("cannot be read ({error}): check the path"))?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(format!(
            "this is larger than {} MB and no design file: name a TOML file, and put long tables into CSV files",
            LARGEST_FILE >> 20
        ));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        format!(
            "byte {} is not UTF-8: save the design file as UTF-8 text",
            error.utf8_error().valid_up_to() + 1
        )
    })?;
    if text.trim().is_empty() {
        return Err("the file is empty: start from one of the files in examples/".into());
    }
    Ok(text)
}
