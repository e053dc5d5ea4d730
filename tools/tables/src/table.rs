//! Delimited text as spreadsheets, loggers and simulation tools write it.
//!
//! Columns are separated by commas, semicolons or tabs; what separates them is found from the
//! first rows, or said by a first line `sep=;`. A decimal comma is understood where commas do not
//! separate columns. UTF-8 with or without byte order mark, UTF-16 with one; any line end; quotes.

use crate::{Error, open_regular, quote};
use csv::{Reader, ReaderBuilder, StringRecord, Trim};
use encoding_rs_io::{DecodeReaderBytes, DecodeReaderBytesBuilder};
use std::fs::File;
use std::io::{Chain, Cursor, Read, Take};
use std::path::Path;

/// The most rows a table may have below its header.
pub const MOST_ROWS: usize = 1_000_000;
/// The most bytes of a table that are read.
const MOST_BYTES: u64 = 512 << 20;
/// What is looked at to find out what separates columns, in bytes.
const HEAD: u64 = 64 << 10;
/// What may separate columns; on a tie the first.
const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];

/// The table's text: its head, which was looked at, and the rest.
type Text = Chain<Cursor<Vec<u8>>, DecodeReaderBytes<Take<File>, Vec<u8>>>;

/// A table that is being read, row by row.
pub struct Table {
    reader: Reader<Text>,
    names: Vec<String>,
    /// Lines taken off the top of the file.
    skipped: u64,
    delimiter: u8,
    /// The decimal mark, once a number had one, and the row where.
    mark: Option<(char, usize)>,
    rows: usize,
}

/// Where a row stands in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Place {
    /// Below the header, from 1.
    pub row: usize,
    /// In the file, from 1.
    pub line: u64,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "row {} (line {})", self.row, self.line)
    }
}

/// One row below the header.
#[derive(Clone, Debug)]
pub struct Row {
    /// Where it stands.
    pub place: Place,
    cells: StringRecord,
}

impl Row {
    /// The text of a cell (0-based), without spaces around it.
    pub fn text(&self, column: usize) -> &str {
        self.cells.get(column).unwrap_or_default()
    }

    fn is_empty(&self) -> bool {
        self.cells.iter().all(str::is_empty)
    }
}

impl Table {
    /// Opens a table and reads its header.
    ///
    /// # Errors
    /// A file that cannot be read, or is no text.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = open_regular(path, MOST_BYTES)?;
        let mut text = DecodeReaderBytesBuilder::new()
            .utf8_passthru(true)
            .strip_bom(true)
            .build(file);
        let mut head = Vec::new();
        (&mut text)
            .take(HEAD)
            .read_to_end(&mut head)
            .map_err(|error| Error::unreadable(&error))?;
        refuse_binary(&head)?;
        let (said, start) = said_delimiter(&head);
        let delimiter = said.unwrap_or_else(|| likely_delimiter(&head[start..]));
        let head = head.split_off(start);
        refuse_header(&head, delimiter, 1 + u64::from(start > 0))?;
        let mut reader = ReaderBuilder::new()
            .delimiter(delimiter)
            .trim(Trim::All)
            .flexible(true)
            .from_reader(Cursor::new(head).chain(text));
        let skipped = u64::from(start > 0);
        let names = reader
            .headers()
            .map_err(|error| damaged(&error, skipped))?
            .iter()
            .map(ToString::to_string)
            .collect();
        Ok(Self {
            reader,
            names,
            skipped,
            delimiter,
            mark: None,
            rows: 0,
        })
    }

    /// The header.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The next row; none after the last. Rows of empty cells at the end are no rows.
    ///
    /// # Errors
    /// A row that is no text, does not fit the header, or is one too many.
    pub fn next_row(&mut self) -> Result<Option<Row>, Error> {
        let Some(row) = self.next_record()? else {
            return Ok(None);
        };
        if !row.is_empty() {
            if row.place.row == 1 && !row.cells.iter().any(|cell| self.is_number_or_time(cell)) {
                return Err(Error::Words {
                    line: row.place.line,
                });
            }
            return self.whole(row).map(Some);
        }
        while let Some(later) = self.next_record()? {
            if !later.is_empty() {
                return Err(Error::EmptyLine {
                    line: row.place.line,
                    next: later.place.line,
                });
            }
        }
        Ok(None)
    }

    fn next_record(&mut self) -> Result<Option<Row>, Error> {
        let mut cells = StringRecord::new();
        let more = self.reader.read_record(&mut cells);
        if !more.map_err(|error| damaged(&error, self.skipped))? {
            return Ok(None);
        }
        let line = cells.position().map_or(0, csv::Position::line) + self.skipped;
        let row = self.rows + 1;
        if self.rows == MOST_ROWS && cells.iter().any(|cell| !cell.is_empty()) {
            return Err(Error::TooManyRows);
        }
        self.rows = row;
        let place = Place { row, line };
        Ok(Some(Row { place, cells }))
    }

    /// A row has a cell for each column; what spreadsheets add behind the last is empty.
    fn whole(&self, row: Row) -> Result<Row, Error> {
        let (found, needed) = (row.cells.len(), self.names.len());
        let surplus = row.cells.iter().skip(needed).any(|cell| !cell.is_empty());
        if found >= needed && !surplus {
            return Ok(row);
        }
        let advice = if self.delimiter == b',' && found > needed {
            "separate columns by semicolons where numbers have decimal commas, and give every row a cell for each column"
        } else {
            "give every row a cell for each column"
        };
        Err(Error::Cells {
            line: row.place.line,
            found,
            needed,
            advice,
        })
    }

    /// The number in a cell (0-based column), if it is one that is `valid`.
    ///
    /// # Errors
    /// A cell without such a number, or with another decimal mark than earlier ones.
    pub fn number(
        &mut self,
        row: &Row,
        column: usize,
        valid: impl Fn(f64) -> bool,
    ) -> Result<f64, Error> {
        let text = row.text(column);
        self.agree_on_mark(row.place, text)?;
        match self.parse(text).filter(|value| valid(*value)) {
            Some(value) => Ok(value),
            None => Err(self.no_number(row, column)),
        }
    }

    /// The number that a text is, under the file's decimal mark.
    pub(crate) fn parse(&self, text: &str) -> Option<f64> {
        if self.delimiter != b',' && text.contains(',') && !text.contains('.') {
            return parse(&text.replacen(',', ".", 1));
        }
        parse(text)
    }

    fn is_number_or_time(&self, text: &str) -> bool {
        self.parse(text).is_some() || text.starts_with(|c: char| c.is_ascii_digit())
    }

    /// One file has one decimal mark: 1,234 beside 1.5 may be a thousand.
    pub(crate) fn agree_on_mark(&mut self, place: Place, text: &str) -> Result<(), Error> {
        let looks_numeric = text.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c));
        let Some(mark) = text.chars().find(|c| ".,".contains(*c)) else {
            return Ok(());
        };
        if !looks_numeric || self.parse(text).is_none() {
            return Ok(());
        }
        match self.mark {
            Some((other, row)) if other != mark => Err(Error::DecimalMark {
                place,
                text: quote(text),
                row,
                mark: other,
            }),
            Some(_) => Ok(()),
            None => {
                self.mark = Some((mark, place.row));
                Ok(())
            }
        }
    }

    fn no_number(&self, row: &Row, column: usize) -> Error {
        let text = row.text(column);
        let advice = if self.delimiter == b',' && text.contains(',') {
            "write a decimal point, or separate columns by semicolons where numbers have decimal commas"
        } else {
            "give a finite number in every cell"
        };
        Error::Cell {
            place: row.place,
            column: self.names[column].clone(),
            found: contents(text),
            advice,
        }
    }
}

/// A number, also with Fortran's exponent (1.5D+02) or the minus sign of a word processor.
fn parse(text: &str) -> Option<f64> {
    text.parse().ok().or_else(|| {
        let plain = text.replace('\u{2212}', "-").replace(['D', 'd'], "e");
        plain.parse().ok().filter(|_| plain != text)
    })
}

/// A first line that is a comment, numbers, markup or one long word is no header.
fn refuse_header(head: &[u8], delimiter: u8, number: u64) -> Result<(), Error> {
    let text = String::from_utf8_lossy(head);
    let mut lines = text.split(['\n', '\r']).filter(|line| !line.is_empty());
    let Some(first) = lines.next().map(str::trim) else {
        return Err(Error::Header(
            "is empty: name a file that holds a table".into(),
        ));
    };
    if first.starts_with('<') {
        return Err(Error::NotText("a web page or XML"));
    }
    if first.starts_with(['#', '%']) || first.starts_with("//") {
        let what = format!("line {number} is a comment, {}", quote(first));
        return Err(Error::Header(format!(
            "{what}: delete what stands above the header"
        )));
    }
    let mark = char::from(delimiter);
    let numeric = |cell: &str| {
        let cell = cell.trim().trim_matches('"');
        parse(&cell.replacen(',', ".", 1)).is_some_and(f64::is_finite)
    };
    if first.split(mark).all(numeric) {
        return Err(Error::Header(format!(
            "line {number} holds numbers where the names of the columns stand: add a header above it"
        )));
    }
    let alone = !first.contains(mark);
    let second = lines.next().unwrap_or_default();
    let cells = second.split(['|', ' ']).filter(|cell| !cell.is_empty());
    if alone
        && second.contains(['|', ' '])
        && cells.clone().count() > 1
        && cells.clone().all(numeric)
    {
        return Err(Error::Header(
            "has columns that neither commas, semicolons nor tabs separate: separate them by one of these".into(),
        ));
    }
    Ok(())
}

/// What a cell holds, as a sentence tells it.
pub(crate) fn contents(text: &str) -> String {
    match text.is_empty() {
        true => "is empty".to_string(),
        false => format!("holds {}", quote(text)),
    }
}

/// Workbooks and databases are no text.
fn refuse_binary(head: &[u8]) -> Result<(), Error> {
    let kinds: [(&[u8], &'static str); 5] = [
        (b"PK\x03\x04", "an Excel workbook or another archive"),
        (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
        (b"PAR1", "a Parquet file"),
        (b"MDF ", "an MDF measurement file"),
        (b"MATLAB ", "a MATLAB file"),
    ];
    match kinds.iter().find(|(magic, _)| head.starts_with(magic)) {
        Some((_, kind)) => Err(Error::NotText(kind)),
        // Text in UTF-16 has been decoded.
        None if head.contains(&0) => Err(Error::NotText("a binary file")),
        None => Ok(()),
    }
}

/// What a first line `sep=;` says, and where the table begins behind it.
fn said_delimiter(head: &[u8]) -> (Option<u8>, usize) {
    let end = head.iter().position(|&byte| byte == b'\n');
    let line = &head[..end.unwrap_or(head.len())];
    let line = String::from_utf8_lossy(line);
    let line = line.trim_end_matches('\r').trim_matches('"');
    let Some(said) = line
        .get(..4)
        .filter(|start| start.eq_ignore_ascii_case("sep="))
        .and(line.get(4..))
    else {
        return (None, 0);
    };
    match said.as_bytes() {
        [one] if one.is_ascii() => (Some(*one), end.map_or(head.len(), |at| at + 1)),
        _ if said.eq_ignore_ascii_case("\\t") => (Some(b'\t'), end.map_or(head.len(), |at| at + 1)),
        _ => (None, 0),
    }
}

/// The delimiter that gives the most columns, among those under which the first row below the
/// header has a cell for each and there is more than one column; where there is none, the one with
/// the most columns.
fn likely_delimiter(head: &[u8]) -> u8 {
    let columns = |delimiter: &u8| {
        let mut reader = ReaderBuilder::new()
            .delimiter(*delimiter)
            .flexible(true)
            .from_reader(head);
        let header = reader.byte_headers().map_or(0, csv::ByteRecord::len);
        let first = reader.byte_records().next();
        let first = first.and_then(Result::ok).map_or(header, |row| row.len());
        (first == header && header > 1, header)
    };
    let best = DELIMITERS.iter().rev().max_by_key(|one| columns(one));
    best.copied().unwrap_or(b',')
}

fn damaged(error: &csv::Error, skipped: u64) -> Error {
    match error.kind() {
        csv::ErrorKind::Utf8 { pos, .. } => Error::NotUtf8 {
            line: pos.as_ref().map_or(0, csv::Position::line) + skipped,
        },
        _ => Error::Unreadable {
            kind: "",
            why: error.to_string(),
            advice: "name a CSV file",
        },
    }
}
