//! Archives as `verify` reads them: any bytes, and intact ones that were damaged in their entries or as a whole.

use crate::{description, reading};
use libfuzzer_sys::arbitrary::{self, Arbitrary};
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// What is handed to the reader.
#[derive(Arbitrary, Clone, Debug)]
pub enum Damage {
    /// These bytes.
    Bytes(Vec<u8>),
    /// An archive of these entries, then bytes changed in it, and cut.
    Archive(Vec<Entry>, Vec<Patch>, Option<u16>),
}

/// An entry, beside those of an intact FMU.
#[derive(Arbitrary, Clone, Debug)]
pub struct Entry {
    /// One of the intact names, or the next field.
    known: Option<u8>,
    name: String,
    contents: Vec<u8>,
    /// How often the contents are repeated: small archives of much.
    times: u16,
    deflated: bool,
    mode: u32,
}

/// A byte that is replaced.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub struct Patch {
    /// Where, of the bytes there are; from the end where it is odd.
    at: u32,
    /// By what.
    byte: u8,
}

const DESCRIPTION: &str = "modelDescription.xml";

const KNOWN: [&str; 4] = [
    DESCRIPTION,
    "resources/design.cbor",
    "binaries/linux64/f_controller.so",
    "documentation/index.html",
];

static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let name = format!("fmu-fuzz-archive-{}.fmu", std::process::id());
    std::env::temp_dir().join(name)
});

fn is_known(name: &str) -> bool {
    KNOWN.contains(&name) || name.starts_with("binaries/")
}

/// An archive of the entries; none where the writer itself refuses them.
fn zipped(entries: &[Entry]) -> Option<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let intact = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let named = |entry: &Entry| match entry.known {
        Some(which) => KNOWN[usize::from(which) % KNOWN.len()].to_owned(),
        None => entry.name.clone(),
    };
    let replaced: Vec<String> = entries.iter().map(named).collect();
    for name in KNOWN.iter().filter(|name| !replaced.contains(&(**name).to_owned())) {
        archive.start_file(*name, intact).ok()?;
        archive.write_all(b"<fmiModelDescription guid=\"{1}\"/>").ok()?;
    }
    for (entry, name) in entries.iter().zip(replaced) {
        let method = match entry.deflated {
            true => CompressionMethod::Deflated,
            false => CompressionMethod::Stored,
        };
        let options = intact.compression_method(method).unix_permissions(entry.mode);
        archive.start_file(name, options).ok()?;
        for _ in 0..entry.times % 256 {
            archive.write_all(&entry.contents).ok()?;
        }
    }
    Some(archive.finish().ok()?.into_inner())
}

fn damaged(damage: &Damage) -> Option<Vec<u8>> {
    let (entries, patches, cut) = match damage {
        Damage::Bytes(bytes) => return Some(bytes.clone()),
        Damage::Archive(entries, patches, cut) => (entries, patches, cut),
    };
    let mut bytes = zipped(&entries[..entries.len().min(80)])?;
    for patch in patches {
        let at = (patch.at / 2) as usize % bytes.len();
        let place = match patch.at % 2 {
            0 => at,
            _ => bytes.len() - 1 - at,
        };
        bytes[place] = patch.byte;
    }
    if let Some(cut) = cut {
        bytes.truncate(bytes.len().saturating_sub(usize::from(*cut)));
    }
    Some(bytes)
}

/// What is read is a set of files that an FMU may have; what is refused is refused in one line.
pub fn read(damage: &Damage) {
    let Some(bytes) = damaged(damage) else {
        return;
    };
    std::fs::write(&*FILE, &bytes).unwrap();
    match reading::files(&FILE, is_known) {
        Ok(files) => check(&files),
        Err(what) => assert!(!what.contains(['\n', '\0']), "{what:?}"),
    }
}

fn check(files: &BTreeMap<String, Vec<u8>>) {
    let total: usize = files.values().map(Vec::len).sum();
    assert!(files.len() <= 64 && total <= 256 << 20);
    for name in files.keys() {
        let outside = |part: &str| part.is_empty() || part == "." || part == "..";
        assert!(is_known(name) && !name.contains(['\0', '\\', ':']));
        assert!(!name.split('/').any(outside), "{name}");
    }
    let text = files.get(DESCRIPTION).and_then(|bytes| std::str::from_utf8(bytes).ok());
    if let Some(Err(what)) = text.map(description::guid) {
        assert!(!what.is_empty());
    }
}
