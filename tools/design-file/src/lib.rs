//! Reading a design file: from bytes to the [`schema`], or one sentence.

pub mod assemble;
pub mod check;
pub mod defaults;
pub mod healthy_log;
pub mod notes;
mod plant;
pub mod schema;
pub mod sentence;
mod signal;
pub mod suggest;
mod true_plant;
pub mod values;

use schema::DesignFile;
use std::io::Read;
use std::path::Path;

/// The largest design file that is read; long tables belong in CSV files.
const LARGEST_FILE: u64 = 4 << 20;

/// Reads a design file.
///
/// # Errors
/// One sentence that names the file, the place and key, and what to do.
pub fn read(path: &Path) -> Result<DesignFile, String> {
    load(path)
        .and_then(|text| parse(&text))
        .map_err(|what| format!("{}: {what}", path.display()))
}

fn load(path: &Path) -> Result<String, String> {
    let mut bytes = Vec::new();
    ftc_tables::open_regular(path, LARGEST_FILE)
        .map_err(|what| match path.is_dir() {
            true => "this is a directory: name a design file (TOML) in it".into(),
            false => what,
        })?
        .read_to_end(&mut bytes)
        .map_err(|error| format!("cannot be read ({error}): check the path"))?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(format!(
            "is larger than {} MB: put long tables into CSV files",
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

/// Parses the text of a design file.
///
/// # Errors
/// One sentence that names the place and key, and what to do.
pub fn parse(text: &str) -> Result<DesignFile, String> {
    let document =
        toml::Deserializer::parse(text).map_err(|error| sentence::syntax(text, &error))?;
    serde_path_to_error::deserialize(document)
        .map_err(|error| sentence::mismatch(text, error.path(), error.inner()))
}
