//! Parquet: as much of the format as rows of numbers and texts need. Each column of a group of rows is one
//! page of plain values, neither compressed nor optional.
//!
//! The structures and the numbers of their fields: `parquet.thrift` of the Parquet format, written in
//! Thrift's compact protocol.

use std::io::{self, Write};

const MARK: &[u8] = b"PAR1";
/// `Encoding::PLAIN`.
const PLAIN: i64 = 0;
/// `Encoding::RLE`, said of the levels, of which required columns have none.
const RLE: i64 = 3;

/// What a column holds; the numbers are `Type`'s.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    Whole = 2,
    Real = 5,
    Text = 6,
}

/// The values of a column, plain.
#[derive(Default)]
pub(crate) struct Values {
    bytes: Vec<u8>,
    count: i64,
}

impl Values {
    pub(crate) fn whole(values: impl Iterator<Item = i64>) -> Self {
        Self::of(values, |bytes, value| {
            bytes.extend_from_slice(&value.to_le_bytes());
        })
    }

    pub(crate) fn real(values: impl Iterator<Item = f64>) -> Self {
        Self::of(values, |bytes, value| {
            bytes.extend_from_slice(&value.to_le_bytes());
        })
    }

    pub(crate) fn text(values: impl Iterator<Item = String>) -> Self {
        Self::of(values, |bytes, value| {
            bytes.extend_from_slice(&(value.len() as u32).to_le_bytes());
            bytes.extend_from_slice(value.as_bytes());
        })
    }

    fn of<T>(values: impl Iterator<Item = T>, add: impl Fn(&mut Vec<u8>, T)) -> Self {
        let mut all = Self::default();
        for value in values {
            add(&mut all.bytes, value);
            all.count += 1;
        }
        all
    }
}

/// Where the page of a column begins, its bytes and its values.
struct Chunk {
    at: i64,
    bytes: i64,
    count: i64,
}

/// A file that is being written, group by group.
pub(crate) struct Writer<W: Write> {
    file: W,
    at: i64,
    columns: &'static [(&'static str, Kind)],
    groups: Vec<Vec<Chunk>>,
}

impl<W: Write> Writer<W> {
    pub(crate) fn new(mut file: W, columns: &'static [(&'static str, Kind)]) -> io::Result<Self> {
        file.write_all(MARK)?;
        Ok(Self {
            file,
            at: MARK.len() as i64,
            columns,
            groups: Vec::new(),
        })
    }

    /// Appends a group of rows: as many values of every column.
    pub(crate) fn write(&mut self, columns: &[Values]) -> io::Result<()> {
        let mut group = Vec::with_capacity(columns.len());
        for values in columns {
            let size = i32::try_from(values.bytes.len()).map_err(io::Error::other)?;
            let mut page = Structure::default();
            // PageHeader: a DATA_PAGE, its size without and with compression, its DataPageHeader.
            page.i32(1, 0).i32(2, size.into()).i32(3, size.into());
            page.structure(5, |data| {
                data.i32(1, values.count).i32(2, PLAIN);
                data.i32(3, RLE).i32(4, RLE);
            });
            let header = page.end();
            self.file.write_all(&header)?;
            self.file.write_all(&values.bytes)?;
            let bytes = (header.len() + values.bytes.len()) as i64;
            group.push(Chunk {
                at: self.at,
                bytes,
                count: values.count,
            });
            self.at += bytes;
        }
        self.groups.push(group);
        Ok(())
    }

    /// Ends the file.
    pub(crate) fn finish(mut self, name: &str, author: &str) -> io::Result<()> {
        let rows = |group: &[Chunk]| group.first().map_or(0, |chunk| chunk.count);
        let mut footer = Structure::default();
        // FileMetaData: version, schema, rows, groups of rows, author.
        footer.i32(1, 1);
        footer.list(2, 1 + self.columns.len(), |at, element| match at {
            0 => {
                element.text(4, name).i32(5, self.columns.len() as i64);
            }
            _ => schema(self.columns[at - 1], element),
        });
        footer.i64(3, self.groups.iter().map(|group| rows(group)).sum());
        footer.list(4, self.groups.len(), |at, element| {
            let group = &self.groups[at];
            element.list(1, group.len(), |at, element| {
                chunk(self.columns[at], &group[at], element);
            });
            element.i64(2, group.iter().map(|chunk| chunk.bytes).sum());
            element.i64(3, rows(group));
        });
        footer.text(6, author);
        let footer = footer.end();
        let length = u32::try_from(footer.len()).map_err(io::Error::other)?;
        self.file.write_all(&footer)?;
        self.file.write_all(&length.to_le_bytes())?;
        self.file.write_all(MARK)?;
        self.file.flush()
    }
}

/// A SchemaElement: its type, REQUIRED, its name; of a text that it is one, as readers old (UTF8) and new
/// (the union's StringType) ask for.
fn schema((name, kind): (&str, Kind), element: &mut Structure) {
    element.i32(1, kind as i64).i32(3, 0).text(4, name);
    if kind == Kind::Text {
        element.i32(6, 0);
        element.structure(10, |logical| {
            logical.structure(1, |_| {});
        });
    }
}

/// A ColumnChunk: where it stands, and its ColumnMetaData.
fn chunk((name, kind): (&str, Kind), chunk: &Chunk, element: &mut Structure) {
    element.i64(2, chunk.at);
    element.structure(3, |data| {
        data.i32(1, kind as i64);
        data.list_of(2, I32, 2, |list| {
            list.number(PLAIN);
            list.number(RLE);
        });
        data.list_of(3, BINARY, 1, |list| list.bytes(name.as_bytes()));
        // UNCOMPRESSED, values, bytes without and with compression, the first page.
        data.i32(4, 0).i64(5, chunk.count);
        data.i64(6, chunk.bytes).i64(7, chunk.bytes);
        data.i64(9, chunk.at);
    });
}

// Thrift's compact types.
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A structure of Thrift's compact protocol; fields are added in the order of their numbers.
#[derive(Default)]
struct Structure {
    bytes: Vec<u8>,
    last: u8,
}

impl Structure {
    fn field(&mut self, number: u8, kind: u8) {
        self.bytes.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    fn i32(&mut self, field: u8, value: i64) -> &mut Self {
        self.field(field, I32);
        self.number(value);
        self
    }

    fn i64(&mut self, field: u8, value: i64) -> &mut Self {
        self.field(field, I64);
        self.number(value);
        self
    }

    fn text(&mut self, field: u8, text: &str) -> &mut Self {
        self.field(field, BINARY);
        self.bytes(text.as_bytes());
        self
    }

    fn structure(&mut self, field: u8, fill: impl FnOnce(&mut Self)) {
        self.field(field, STRUCT);
        self.inner(fill);
    }

    fn list(&mut self, field: u8, count: usize, fill: impl Fn(usize, &mut Self)) {
        self.list_of(field, STRUCT, count, |list| {
            for at in 0..count {
                list.inner(|element| fill(at, element));
            }
        });
    }

    fn list_of(&mut self, field: u8, kind: u8, count: usize, fill: impl FnOnce(&mut Self)) {
        self.field(field, LIST);
        match count {
            0..15 => self.bytes.push((count as u8) << 4 | kind),
            _ => {
                self.bytes.push(0xf0 | kind);
                self.variable(count as u64);
            }
        }
        fill(self);
    }

    fn inner(&mut self, fill: impl FnOnce(&mut Self)) {
        let outer = std::mem::take(&mut self.last);
        fill(self);
        self.bytes.push(0);
        self.last = outer;
    }

    /// A number of a list or a field, small where its magnitude is (zigzag).
    fn number(&mut self, value: i64) {
        self.variable(((value << 1) ^ (value >> 63)) as u64);
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.variable(bytes.len() as u64);
        self.bytes.extend_from_slice(bytes);
    }

    /// Seven bits a byte, the lowest first.
    fn variable(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}
