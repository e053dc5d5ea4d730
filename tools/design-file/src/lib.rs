//! Reading a design file: from bytes to the [`schema`], or one sentence.

pub mod assemble;
pub mod check;
pub mod defaults;
pub mod healthy_log;
pub mod schema;
pub mod sentence;
mod signal;
pub mod suggest;
pub mod values;

use schema::DesignFile;
use std::fs::File;
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
