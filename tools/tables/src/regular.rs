//! Opening files: regular ones only, and never more bytes than were bargained for.

use std::fs::{self, File};
use std::io::{Read, Take};
use std::path::Path;

/// Opens a regular file of at most `most` bytes. A pipe or a device is refused before it is opened,
/// since opening one may wait for ever; the reader ends after `most + 1` bytes whatever the file does.
///
/// # Errors
/// The end of a sentence that begins with the file's name.
pub fn open_regular(path: &Path, most: u64) -> Result<Take<File>, String> {
    let blame = |error: std::io::Error| {
        format!("cannot be opened ({error}): check the path and its permissions")
    };
    let kind = fs::metadata(path).map_err(blame)?;
    if kind.is_dir() {
        return Err("is a directory: name a file in it".into());
    }
    if !kind.is_file() {
        return Err("is no regular file: save what it gives to a file and name that".into());
    }
    let file = File::open(path).map_err(blame)?;
    let opened = file.metadata().map_err(blame)?;
    if !opened.is_file() {
        return Err("is no regular file: save what it gives to a file and name that".into());
    }
    if opened.len() > most {
        return Err(format!(
            "is larger than {} MB: shorten it, or name another file",
            most >> 20
        ));
    }
    Ok(file.take(most + 1))
}
