//! NumPy archives, as `numpy.savez` and `numpy.savez_compressed` write them.

use super::numbers::{Kind, numbers};
use super::{Found, MOST_ENTRIES, check_shape, from_columns};
use crate::{EntryError, Error, MatrixError};
use nalgebra::DMatrix;
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// How an array begins.
pub(super) const MARK: &[u8] = b"\x93NUMPY";
/// The most arrays of an archive.
const MOST_ARRAYS: usize = 10_000;

pub(super) fn read(bytes: Vec<u8>) -> Result<Found, Error> {
    let damaged = |error: zip::result::ZipError| Error::Unreadable {
        kind: " as a NumPy archive",
        why: error.to_string(),
        advice: "save it again with numpy.savez",
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
    if archive.len() > MOST_ARRAYS {
        return Err(MatrixError::TooManyArrays(archive.len()).into());
    }
    let mut found = Found::new();
    for at in 0..archive.len() {
        let entry = archive.by_index(at).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.to_string();
        if let Some(name) = name.strip_suffix(".npy") {
            // A header and as many numbers as a matrix may have, whatever the archive promises.
            let bounded = entry.take(16 * MOST_ENTRIES as u64);
            found.insert(name.to_string(), dense(bounded));
        }
    }
    Ok(found)
}

fn dense(mut reader: impl Read) -> Result<DMatrix<f64>, EntryError> {
    let mut bytes = Vec::new();
    reader
        .read_to_end(&mut bytes)
        .map_err(|error| EntryError::Unreadable(error.to_string()))?;
    let (header, contents) = split(&bytes).ok_or(EntryError::Damaged)?;
    let header = Header::read(header)?;
    let shape = match &header.shape[..] {
        [] => vec![1, 1],
        sizes => sizes.to_vec(),
    };
    check_shape(&shape)?;
    let unread = || EntryError::Type(header.kind.to_string());
    let (order, kind) = header.kind.split_at_checked(1).ok_or_else(unread)?;
    let kind = match kind {
        "f8" => Kind::Float(8),
        "f4" => Kind::Float(4),
        "i8" => Kind::Signed(8),
        "i4" => Kind::Signed(4),
        "i2" => Kind::Signed(2),
        "i1" => Kind::Signed(1),
        "u8" => Kind::Unsigned(8),
        "u4" => Kind::Unsigned(4),
        "u2" => Kind::Unsigned(2),
        "u1" | "b1" => Kind::Unsigned(1),
        _ => return Err(unread()),
    };
    let entries = numbers(kind, contents, order == ">").ok_or_else(unread)?;
    if !header.is_fortran {
        let transposed: Vec<usize> = shape.iter().rev().copied().collect();
        return from_columns(&transposed, &entries).map(|matrix| matrix.transpose());
    }
    from_columns(&shape, &entries)
}

/// The header of an array, and its entries: behind the mark there is the version, whose first number says
/// how many bytes the header's length has.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (&[version, _], rest) = bytes.strip_prefix(MARK)?.split_first_chunk()?;
    let (length, rest) = match version {
        1 => {
            let (&length, rest) = rest.split_first_chunk()?;
            (usize::from(u16::from_le_bytes(length)), rest)
        }
        _ => {
            let (&length, rest) = rest.split_first_chunk()?;
            (u32::from_le_bytes(length) as usize, rest)
        }
    };
    let (header, contents) = rest.split_at_checked(length)?;
    Some((str::from_utf8(header).ok()?, contents))
}

/// What the header says, a dictionary as Python writes it: type, order and sizes.
struct Header<'a> {
    kind: &'a str,
    is_fortran: bool,
    shape: Vec<usize>,
}

impl<'a> Header<'a> {
    fn read(text: &'a str) -> Result<Self, EntryError> {
        let value = |key: &str| {
            let (_, rest) = text.split_once(key)?;
            let value = rest.trim_start_matches(['\'', '"']).trim_start();
            value.strip_prefix(':').map(str::trim_start)
        };
        let kind = value("descr").ok_or(EntryError::Damaged)?;
        if kind.starts_with('[') {
            return Err(EntryError::Fields);
        }
        let quoted = |text: &'a str| text.split(['\'', '"']).nth(1);
        let sizes = |text: &'a str| {
            let (sizes, _) = text.strip_prefix('(')?.split_once(')')?;
            let sizes = sizes.split(',').map(str::trim);
            let sizes = sizes.filter(|size| !size.is_empty());
            sizes.map(|size| size.parse().ok()).collect()
        };
        Ok(Self {
            kind: quoted(kind).ok_or(EntryError::Damaged)?,
            is_fortran: value("fortran_order").is_some_and(|value| value.starts_with("True")),
            shape: value("shape").and_then(sizes).ok_or(EntryError::Damaged)?,
        })
    }
}
