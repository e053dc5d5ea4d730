//! Reading an FMU that anybody may have made: bounded, every entry known and looked at once.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use zip::ZipArchive;
use zip::read::ZipFile;

/// No FMU of ours has more entries.
const MOST_ENTRIES: usize = 64;

/// No FMU of ours is larger, unpacked, in bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Length of an entry's own header without its name, where the name's length stands in it, and how
/// it begins.
const HEADER: usize = 30;
const NAME_LENGTH: usize = 26;
const SIGNATURE: &[u8] = b"PK\x03\x04";

/// Length of the record at the end, where the number of entries stands in it, and how it begins.
const END: usize = 22;
const COUNT: usize = 10;
const END_SIGNATURE: &[u8] = b"PK\x05\x06";

/// Every file of the archive by its path; reading one checks its checksum.
///
/// # Errors
/// One sentence: not a regular file, no archive, damaged, too large, or with an entry that is no
/// regular file, stands twice, leads out of the archive, bears two names or is not `known`.
pub(crate) fn files(
    path: &Path,
    known: impl Fn(&str) -> bool,
) -> Result<BTreeMap<String, Vec<u8>>, String> {
    let (mut file, mut archive) = open(path)?;
    let damaged = |what: String| format!("the archive is damaged ({what}): export it again");
    let told = told_entries(&mut file).map_err(damaged)?;
    if told > MOST_ENTRIES || archive.len() > MOST_ENTRIES {
        return Err(format!(
            "it has more than {MOST_ENTRIES} entries, and no FMU of ours has: export it again"
        ));
    }
    if told != archive.len() {
        return Err(damaged(
            "an entry stands twice, or something follows the last".into(),
        ));
    }
    let mut files = BTreeMap::new();
    let mut left = MOST_BYTES;
    for index in 0..archive.len() {
        let mut entry = archive
            .by_index(index)
            .map_err(|error| damaged(error.to_string()))?;
        let name = name(&entry, &mut file).map_err(damaged)?;
        if name == "SystemStructure.ssd" {
            let what = "this is an SSP package: name one of the FMUs in its resources, unpacked";
            return Err(what.into());
        }
        if !known(&name) {
            return Err(format!(
                "{} is no part of an FMU of ours: export it again",
                name.escape_debug()
            ));
        }
        if !entry.is_file()
            || entry
                .unix_mode()
                .is_some_and(|mode| mode & 0o170_000 & !0o100_000 != 0)
        {
            return Err(damaged(format!("{name} is no regular file")));
        }
        let mut bytes = Vec::new();
        let read = (&mut entry).take(left + 1).read_to_end(&mut bytes);
        let size = read.map_err(|error| damaged(format!("{name}: {error}")))? as u64;
        left = left.checked_sub(size).ok_or_else(|| {
            format!(
                "unpacked it is larger than {} MB, and no FMU of ours is: export it again",
                MOST_BYTES >> 20
            )
        })?;
        files.insert(name, bytes);
    }
    Ok(files)
}

fn open(path: &Path) -> Result<(File, ZipArchive<File>), String> {
    let unopened = |error: std::io::Error| format!("cannot be opened ({error}): name an FMU");
    let about = fs::metadata(path).map_err(unopened)?;
    if about.is_dir() {
        return Err("this is a directory: name an FMU in it".into());
    }
    if !about.is_file() {
        return Err("this is no regular file: name an FMU".into());
    }
    if about.len() > MOST_BYTES {
        return Err(format!(
            "this is larger than {} MB, and no FMU of ours is",
            MOST_BYTES >> 20
        ));
    }
    let mut file = File::open(path).map_err(unopened)?;
    let archive = File::open(path).map_err(unopened).map(ZipArchive::new)?;
    let archive = archive.map_err(|error| match is_zip(&mut file) {
        true => format!("the archive is damaged ({error}): export it again"),
        false => "this is no FMU: name one that ftc-fmu export wrote".into(),
    })?;
    Ok((file, archive))
}

/// Whether a file begins as zip archives do.
fn is_zip(file: &mut File) -> bool {
    let mut magic = [0; 2];
    file.read_exact(&mut magic).is_ok() && &magic == b"PK"
}

/// The number of entries that the archive says it has, in the record that must end it.
fn told_entries(file: &mut File) -> Result<usize, String> {
    let mut record = [0; END];
    file.seek(SeekFrom::End(-(END as i64)))
        .and_then(|_| file.read_exact(&mut record))
        .map_err(|error| error.to_string())?;
    if !record.starts_with(END_SIGNATURE) {
        return Err("something follows its last record".into());
    }
    Ok(usize::from(u16::from_le_bytes([
        record[COUNT],
        record[COUNT + 1],
    ])))
}

/// The name of an entry: the same in both of its headers, and a path that stays inside.
fn name(entry: &ZipFile<File>, file: &mut File) -> Result<String, String> {
    let raw = entry.name_raw();
    let name = std::str::from_utf8(raw).map_err(|_| "a name is not UTF-8".to_string())?;
    let shown = name.escape_debug();
    let mut header = vec![0; HEADER + raw.len()];
    file.seek(SeekFrom::Start(entry.header_start()))
        .and_then(|_| file.read_exact(&mut header))
        .map_err(|error| format!("{shown}: {error}"))?;
    let length = usize::from(u16::from_le_bytes([
        header[NAME_LENGTH],
        header[NAME_LENGTH + 1],
    ]));
    if !header.starts_with(SIGNATURE) || length != raw.len() || &header[HEADER..] != raw {
        return Err(format!("{shown} bears another name in its own header"));
    }
    let leads_out = |part: &str| part.is_empty() || part == "." || part == "..";
    if name.contains(['\0', '\\', ':']) || name.split('/').any(leads_out) {
        return Err(format!("{shown} is no path inside an archive"));
    }
    Ok(name.into())
}
