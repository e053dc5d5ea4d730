//! MATLAB's level 5 format, which `save` writes unless told otherwise, and `scipy.io.savemat`: a header of
//! 128 bytes, then elements, each with its type and its size in front.

use super::numbers::{Kind, numbers};
use super::{DEEPEST, Found, MOST_BYTES, check_shape, from_columns};
use crate::{EntryError, Error};
use flate2::read::ZlibDecoder;
use nalgebra::DMatrix;
use std::io::Read;

const HEADER: usize = 128;

// Types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

// Classes of arrays: numbers are those from double to uint64.
const STRUCTURE: u32 = 2;
const TEXT: u32 = 4;
const DOUBLE: u32 = 6;
const UINT64: u32 = 15;
/// An object of a newer class, which has no dimensions.
const OPAQUE: u32 = 17;

const COMPLEX: u32 = 0x800;

pub(super) fn read(bytes: &[u8]) -> Result<Found, Error> {
    let damaged = |why: String| Error::Unreadable {
        kind: " as a MATLAB file",
        why,
        advice: "save it again, plain arrays or a structure of them",
    };
    let cut_short = || damaged("it ends within a variable".into());
    let (header, body) = bytes.split_at_checked(HEADER).ok_or_else(cut_short)?;
    let mut elements = Elements {
        bytes: body,
        big_endian: header.ends_with(b"MI"),
    };
    let mut found = Found::new();
    while !elements.bytes.is_empty() {
        let (kind, contents) = elements.next().ok_or_else(cut_short)?;
        let mut unpacked = Vec::new();
        let contents = match kind {
            MATRIX => contents,
            COMPRESSED => {
                ZlibDecoder::new(contents)
                    .take(MOST_BYTES)
                    .read_to_end(&mut unpacked)
                    .map_err(|error| damaged(error.to_string()))?;
                // A variable, whose type and size are in front again; of one that is too large the
                // beginning says so.
                match unpacked.get(8..) {
                    Some(contents) if elements.word(&unpacked) == Some(MATRIX) => contents,
                    _ => return Err(damaged("it holds what is no variable".into())),
                }
            }
            _ => continue,
        };
        let array = Array::read(elements.of(contents)).ok_or_else(cut_short)?;
        array.add(&mut found, "", DEEPEST).ok_or_else(cut_short)?;
    }
    Ok(found)
}

/// Elements that follow each other.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl<'a> Elements<'a> {
    /// The elements within another one.
    fn of(self, bytes: &[u8]) -> Elements<'_> {
        Elements {
            bytes,
            big_endian: self.big_endian,
        }
    }

    fn word(&self, bytes: &[u8]) -> Option<u32> {
        let word = *bytes.first_chunk()?;
        Some(match self.big_endian {
            true => u32::from_be_bytes(word),
            false => u32::from_le_bytes(word),
        })
    }

    /// Type and contents of the next element; none where the bytes end before it does. Up to four bytes of
    /// contents may stand in the place of the size; others are filled up to eight bytes, unless compressed.
    fn next(&mut self) -> Option<(u32, &'a [u8])> {
        let (tag, rest) = self.bytes.split_at_checked(8)?;
        let (front, back) = tag.split_at(4);
        let kind = self.word(front)?;
        if kind >> 16 != 0 {
            self.bytes = rest;
            return Some((kind & 0xffff, back.get(..(kind >> 16) as usize)?));
        }
        let size = self.word(back)? as usize;
        let contents = rest.get(..size)?;
        let filled = match kind {
            COMPRESSED => size,
            _ => size.next_multiple_of(8),
        };
        self.bytes = rest.get(filled..).unwrap_or_default();
        Some((kind, contents))
    }

    /// The words of the next element.
    fn words(&mut self) -> Option<Vec<u32>> {
        let (_, contents) = self.next()?;
        contents
            .chunks_exact(4)
            .map(|word| self.word(word))
            .collect()
    }

    fn text(&mut self) -> Option<String> {
        let (_, contents) = self.next()?;
        Some(text(contents))
    }
}

/// A text that may be filled up with zeros.
fn text(bytes: &[u8]) -> String {
    let used = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(used).into_owned()
}

/// An array of any class: what stands in front of its contents, and these.
struct Array<'a> {
    class: u32,
    is_complex: bool,
    shape: Vec<usize>,
    name: String,
    contents: Elements<'a>,
}

impl<'a> Array<'a> {
    fn read(mut elements: Elements<'a>) -> Option<Self> {
        if elements.bytes.is_empty() {
            // A field that was never set.
            return Some(Self {
                class: DOUBLE,
                is_complex: false,
                shape: vec![0, 0],
                name: String::new(),
                contents: elements,
            });
        }
        let flags = *elements.words()?.first()?;
        let class = flags & 0xff;
        let shape = match class {
            OPAQUE => Vec::new(),
            _ => elements.words()?.into_iter().map(|n| n as usize).collect(),
        };
        Some(Self {
            class,
            is_complex: flags & COMPLEX != 0,
            shape,
            name: elements.text()?,
            contents: elements,
        })
    }

    /// Adds this variable under its own name, or the fields that it has, if it is one structure.
    fn add(self, found: &mut Found, prefix: &str, depth: usize) -> Option<()> {
        let name = format!("{prefix}{}", self.name);
        if self.class == STRUCTURE && self.shape == [1, 1] && depth > 0 {
            return self.add_fields(found, &name, depth - 1);
        }
        let matrix = match self.class {
            DOUBLE..=UINT64 => self.dense()?,
            TEXT => Err(EntryError::Text),
            _ => Err(EntryError::NotReal(None)),
        };
        // What MATLAB keeps for itself has no name.
        if !name.is_empty() {
            found.insert(name, matrix);
        }
        Some(())
    }

    /// All names have the same length; the fields themselves have none.
    fn add_fields(self, found: &mut Found, name: &str, depth: usize) -> Option<()> {
        let mut elements = self.contents;
        let length = *elements.words()?.first()? as usize;
        let (_, names) = elements.next()?;
        if length == 0 {
            return names.is_empty().then_some(());
        }
        for field in names.chunks_exact(length) {
            let (_, contents) = elements.next()?;
            let mut array = Array::read(elements.of(contents))?;
            array.name = text(field);
            array.add(found, &format!("{name}."), depth)?;
        }
        Some(())
    }

    /// Numbers column by column, in whatever type is the smallest that holds them.
    fn dense(mut self) -> Option<Result<DMatrix<f64>, EntryError>> {
        if self.is_complex {
            return Some(Err(EntryError::Complex));
        }
        if let Err(why) = check_shape(&self.shape) {
            return Some(Err(why));
        }
        if self.shape.contains(&0) {
            return Some(from_columns(&self.shape, &[]));
        }
        let (kind, contents) = self.contents.next()?;
        let kind = match kind {
            1 => Kind::Signed(1),
            2 => Kind::Unsigned(1),
            3 => Kind::Signed(2),
            4 => Kind::Unsigned(2),
            5 => Kind::Signed(4),
            6 => Kind::Unsigned(4),
            7 => Kind::Float(4),
            9 => Kind::Float(8),
            12 => Kind::Signed(8),
            13 => Kind::Unsigned(8),
            _ => return Some(Err(EntryError::Damaged)),
        };
        let entries = numbers(kind, contents, self.contents.big_endian);
        Some(
            entries
                .ok_or(EntryError::Damaged)
                .and_then(|entries| from_columns(&self.shape, &entries)),
        )
    }
}
