//! Files that engineers have, or one sentence: delimited text with or without time stamps
//! ([`Table`], [`Clock`]), and matrices in MATLAB and NumPy files ([`matrices`]).
//!
//! Only regular files of bounded size are read. Every [`Error`] reads as the end of a sentence that
//! begins with the file's name.

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
pub use time::{Clock, TimeColumn, find_time_column};

/// Longest quotation from the user's file.
const QUOTATION: usize = 60;

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
