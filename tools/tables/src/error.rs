//! What can be wrong with a file, each as the end of a sentence that begins with the file's name.

use crate::table::{MOST_ROWS, Place};

/// Why a file, a row or a column cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no such file, or none that may be opened.
    #[error("cannot be opened ({why}): check the path and its permissions")]
    Unopened {
        /// What the operating system says.
        why: String,
    },
    /// A directory.
    #[error("is a directory: name a file in it")]
    Directory,
    /// A pipe or a device.
    #[error("is no regular file: save what it gives to a file and name that")]
    NotRegular,
    /// Larger than what is read.
    #[error("{} {megabytes} MB: {advice}", if *growing { "has more than" } else { "is larger than" })]
    TooLarge {
        /// The bound.
        megabytes: u64,
        /// Whether the file grew while it was read.
        growing: bool,
        /// What to do.
        advice: &'static str,
    },
    /// Reading failed half way.
    #[error("cannot be read{kind} ({why}): {advice}")]
    Unreadable {
        /// As what it was read: empty, or ` as a ...`.
        kind: &'static str,
        /// What the reader says.
        why: String,
        /// What to do.
        advice: &'static str,
    },
    /// A format from which no table is read.
    #[error("is {0}: save the table as CSV text")]
    NotText(&'static str),
    /// A line with bytes that are no UTF-8.
    #[error("line {line} is not UTF-8: save the table as UTF-8 text")]
    NotUtf8 {
        /// The line, from 1.
        line: u64,
    },
    /// A first line that is no header.
    #[error("{0}")]
    Header(String),
    /// A first row below the header in which no cell is a number or a time.
    #[error(
        "line {line} holds no number or time in any column: delete it if it tells units or comments, and keep one header \
         line"
    )]
    Words {
        /// The line, from 1.
        line: u64,
    },
    /// More rows than are read.
    #[error("has more than {MOST_ROWS} rows: shorten it")]
    TooManyRows,
    /// A line without cells among others.
    #[error(
        "line {line} is empty, but more follows in line {next}: fill the gap, or delete what follows"
    )]
    EmptyLine {
        /// The line, from 1.
        line: u64,
        /// The next one that is not empty.
        next: u64,
    },
    /// A row that does not fit the header.
    #[error("line {line} has {found} cells, but the header has {needed}: {advice}")]
    Cells {
        /// The line, from 1.
        line: u64,
        /// Cells found.
        found: usize,
        /// Cells of the header.
        needed: usize,
        /// What to do.
        advice: &'static str,
    },
    /// A number written with another decimal mark than an earlier one.
    #[error(
        "{place} holds {text}, but row {row} has the decimal mark '{mark}': \
         write every number with the same decimal mark and no mark between thousands"
    )]
    DecimalMark {
        /// Where.
        place: Place,
        /// The cell, quoted.
        text: String,
        /// The earlier number's row, from 1.
        row: usize,
        /// Its mark.
        mark: char,
    },
    /// A cell that holds no number, or no time.
    #[error("{place}, column {column}, {found}: {advice}")]
    Cell {
        /// Where.
        place: Place,
        /// Name of the column.
        column: String,
        /// What the cell holds.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// The time column is not found, or its unit is not known.
    #[error(transparent)]
    TimeColumn(#[from] TimeColumnError),
    /// Times that do not keep to the sample time, or do not ascend.
    #[error(transparent)]
    Time(#[from] TimeError),
    /// A file without matrices, or a matrix that cannot be used.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
}

impl Error {
    /// What the operating system says of a file that is being read.
    pub(crate) fn unreadable(error: &std::io::Error) -> Self {
        Self::Unreadable {
            kind: "",
            why: error.to_string(),
            advice: "check the file",
        }
    }
}

/// Why no column is taken for the time.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeColumnError {
    /// The column that was named is not there.
    #[error("has no column {named}, which time = names: use one of {}", names.join(", "))]
    Missing {
        /// The name, quoted.
        named: String,
        /// The header.
        names: Vec<String>,
    },
    /// Two columns bear the name.
    #[error("has two columns {0}: keep one of them")]
    Twice(String),
    /// Two columns have names of a time column.
    #[error("has two columns that may be the time, {0} and {1}: say which by time = \"...\"")]
    Ambiguous(String, String),
    /// The unit behind the name is none that is known.
    #[error("has the time column {0} whose unit is not known: use s, ms, us, ns, min or h")]
    Unit(String),
}

/// Times that no signal at equidistant samples has. Times are in seconds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeError {
    /// A gap, a doubled row or a wrong rate.
    #[error(
        "{place}: {column} goes from {before} to {now}, but sample_time is {sample_time}: \
         record without gaps, one row per sample{}{}{}",
        other_rate(*place, now - before),
        coarse(*resolution, *sample_time),
        other_unit(column, now - before, *sample_time)
    )]
    Step {
        /// Where.
        place: Place,
        /// Name of the time column.
        column: String,
        /// Time of the row before.
        before: f64,
        /// Time of the row.
        now: f64,
        /// The sample time.
        sample_time: f64,
        /// The finest step in which times are printed.
        resolution: f64,
    },
    /// Rows that drift away from the sample time.
    #[error(
        "{place}: {column} is {now}, {since} s after row 1, where {samples} samples of sample_time {sample_time} \
         make {} s; on average its rows are {mean:.6} s apart: set sample_time to that of the log, or resample the log",
        samples * sample_time
    )]
    Drift {
        /// Where.
        place: Place,
        /// Name of the time column.
        column: String,
        /// Time of the row.
        now: f64,
        /// Time since the first row.
        since: f64,
        /// Samples since the first row.
        samples: f64,
        /// The sample time.
        sample_time: f64,
        /// Mean time between two rows.
        mean: f64,
    },
    /// A row that is not later than the one before.
    #[error(
        "{place}: {column} goes from {before} to {now}: give the rows in ascending order of time, each time once"
    )]
    Order {
        /// Where.
        place: Place,
        /// Name of the time column.
        column: String,
        /// Time of the row before.
        before: f64,
        /// Time of the row.
        now: f64,
    },
}

/// Units in which times may be meant, and their seconds.
const UNITS: [(&str, f64); 5] = [
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
    ("h", 3600.0),
];

/// The unit in which a time step would be right, where there is one.
fn other_unit(column: &str, step: f64, sample_time: f64) -> String {
    let fits = |unit: &f64| (step * unit / sample_time - 1.0).abs() < 0.01;
    let unit = UNITS.iter().find(|(_, seconds)| fits(seconds));
    unit.map_or(String::new(), |(unit, _)| {
        format!("; if its times are in {unit}, name the column {column} [{unit}]")
    })
}

/// Where the very first step is another, that of the whole log may be meant.
fn other_rate(place: Place, step: f64) -> &'static str {
    match place.row == 2 && step > 0.0 {
        true => ", or set sample_time to that of the log",
        false => "",
    }
}

fn coarse(resolution: f64, sample_time: f64) -> String {
    if resolution > 0.5 * sample_time {
        format!(
            "; its times are printed in steps of {resolution} s, log more digits if that is why"
        )
    } else {
        String::new()
    }
}

/// Why a file gives no matrix.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MatrixError {
    /// The reader failed on the file's contents, or a matrix has not the entries its header tells.
    #[error("is damaged: save it again")]
    Damaged,
    /// A file that ends before its contents do.
    #[error("is cut short, a MATLAB 7.3 file without its end: copy or save it again")]
    CutShort,
    /// No array is in it.
    #[error("holds no matrix: save A, B and C into it")]
    Empty,
    /// A single array without a name.
    #[error("is a single NumPy array: save A, B and C together with numpy.savez")]
    SingleArray,
    /// No format that is read.
    #[error(
        "is neither a MATLAB file (level 5 or 7.3) nor a NumPy archive (.npz): \
         save it with save(...) in MATLAB, scipy.io.savemat or numpy.savez"
    )]
    Format,
    /// The crate was built without its feature `formats`.
    #[error(
        "is not read by this build, which leaves MATLAB and NumPy files out: build with `make build`, \
         or with cargo's feature `formats`"
    )]
    NotBuilt,
    /// More arrays than are read.
    #[error("has {0} entries: keep to the matrices of the model")]
    TooManyArrays(usize),
    /// No variable bears the name.
    #[error("has no variable {name}: name one of {}", names.join(", "))]
    Missing {
        /// The name, quoted.
        name: String,
        /// The names there are.
        names: Vec<String>,
    },
    /// The variable is there, but is no matrix.
    #[error("{name} {why}")]
    Variable {
        /// Its name.
        name: String,
        /// Why not.
        why: EntryError,
    },
}

/// Why a variable is no matrix; the end of a sentence that begins with its name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EntryError {
    /// Its entries do not fit its sizes.
    #[error("is damaged: save it again")]
    Damaged,
    /// The file's reader failed on it.
    #[error("cannot be read ({0}): save it again")]
    Unreadable(String),
    /// More entries than a model has.
    #[error("has {} entries, more than a model has: name another variable", sizes(.0))]
    TooLarge(Vec<usize>),
    /// One dimension.
    #[error("has one dimension ({} entries): save it with two, as a row or a column", sizes(.0))]
    OneDimension(Vec<usize>),
    /// More than two dimensions.
    #[error("has {} dimensions ({}): save one matrix per mode", .0.len(), sizes(.0))]
    Dimensions(Vec<usize>),
    /// A record of fields.
    #[error("has fields: save plain matrices")]
    Fields,
    /// Entries that are no real numbers.
    #[error("has entries of type {0}: save real numbers, as float64")]
    Type(String),
    /// Complex entries.
    #[error("is complex: save real matrices")]
    Complex,
    /// A text.
    #[error("is a text, not a matrix: name another variable")]
    Text,
    /// An object, or a text in a 7.3 file.
    #[error("is an object or a text: save plain matrices")]
    Object,
    /// A cell, an object, a sparse array or another class; with the reader's reason where it gives one.
    #[error(
        "is no real matrix{}: save it with full(...), as double, not in a cell or an object",
        .0.as_ref().map_or(String::new(), |why| format!(" ({why})"))
    )]
    NotReal(Option<String>),
}

fn sizes(shape: &[usize]) -> String {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    sizes.join(" x ")
}
