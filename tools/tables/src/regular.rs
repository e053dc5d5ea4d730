//! Opening files: regular ones only, and never more bytes than are allowed.

use crate::Error;
use std::fs::{self, File};
use std::io::{Read, Take};
use std::path::Path;

/// Opens a regular file of at most `most` bytes. A pipe or a device is refused before it is opened,
/// since opening one may wait for ever; the reader ends after `most + 1` bytes whatever the file does.
///
/// # Errors
/// A file that cannot be opened, is no regular file, or is larger.
pub fn open_regular(path: &Path, most: u64) -> Result<Take<File>, Error> {
    let unopened = |error: std::io::Error| Error::Unopened {
        why: error.to_string(),
    };
    let kind = fs::metadata(path).map_err(unopened)?;
    if kind.is_dir() {
        return Err(Error::Directory);
    }
    if !kind.is_file() {
        return Err(Error::NotRegular);
    }
    let file = File::open(path).map_err(unopened)?;
    let opened = file.metadata().map_err(unopened)?;
    if !opened.is_file() {
        return Err(Error::NotRegular);
    }
    if opened.len() > most {
        return Err(Error::TooLarge {
            megabytes: most >> 20,
            growing: false,
            advice: "shorten it, or name another file",
        });
    }
    Ok(file.take(most + 1))
}

/// The bytes of a regular file of at most `most`.
///
/// # Errors
/// As [`open_regular`], and where reading fails half way or the file grows meanwhile.
pub fn read_regular(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    open_regular(path, most)?
        .read_to_end(&mut bytes)
        .map_err(|error| Error::unreadable(&error))?;
    match bytes.len() as u64 > most {
        false => Ok(bytes),
        true => Err(Error::TooLarge {
            megabytes: most >> 20,
            growing: true,
            advice: "shorten it, or name another file",
        }),
    }
}
