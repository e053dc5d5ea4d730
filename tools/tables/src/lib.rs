//! Files that engineers have, or one sentence: delimited text with or without time stamps
//! ([`Table`], [`Clock`]), and matrices in MATLAB and NumPy files ([`matrices`]).
//!
//! Only regular files of bounded size are read. Every [`Error`] reads as the end of a sentence that
//! begins with the file's name.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use ftc_tables::{Clock, Table, find_time_column};
//!
//! let mut table = Table::open("../../examples/logged_open.csv".as_ref())?;
//! let time = find_time_column(table.names(), None, &[])?.ok_or("no column is called t")?;
//! let (mut clock, mut level) = (Clock::new(time), Vec::new());
//! while let Some(row) = table.next_row()? {
//!     clock.read(&mut table, &row)?;
//!     level.push(table.number(&row, 3, f64::is_finite)?);
//! }
//! clock.check_uniform(5.0)?;
//! assert_eq!(level[..2], [36.082, 34.674]);
//! # Ok(())
//! # }
//! ```

mod error;
pub mod matrices;
mod regular;
mod resample;
mod silent;
mod table;
mod time;

pub use error::{EntryError, Error, MatrixError, TimeColumnError, TimeError};
pub use regular::{open_regular, read_regular};
pub use resample::{Interpolation, resample};
pub use table::{MOST_ROWS, Place, Row, Table};
pub use time::{Clock, DRIFT, TimeColumn, find_time_column};

/// Longest quotation from the user's file.
pub const QUOTATION: usize = 60;

/// A quotation from the user's file: printable and short.
pub(crate) fn quote(text: &str) -> String {
    let clean: String = text
        .chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    match clean.char_indices().nth(QUOTATION) {
        Some((cut, _)) => format!("'{}...'", &clean[..cut]),
        None => format!("'{clean}'"),
    }
}
