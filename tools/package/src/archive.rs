//! Zip archives that are the same bytes whenever their contents are: FMUs and SSP packages.

use crate::Error;
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// The contents of an archive by path, in the order they are written.
pub type Contents = BTreeMap<String, Vec<u8>>;

/// Deflated, sorted, with one time stamp. `name` tells an error what it was about.
pub fn zip(name: &str, contents: &Contents) -> Result<Vec<u8>, Error> {
    write(contents).map_err(|error| Error::Contents {
        file: name.into(),
        what: format!("cannot be zipped ({error})"),
    })
}

fn write(contents: &Contents) -> zip::result::ZipResult<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(6))
        .last_modified_time(DateTime::default());
    for (path, bytes) in contents {
        let executable = path.starts_with("binaries/");
        let mode = if executable { 0o755 } else { 0o644 };
        archive.start_file(path.as_str(), options.unix_permissions(mode))?;
        archive.write_all(bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}
