//! What a value must satisfy, whatever key it stands under.

use crate::sentence::shorten;
use ftc_design::words::counted;
pub use ftc_plant::number::{NumberError, fraction, not_negative, number, positive};

/// Longest name of a design, in bytes.
const LONGEST_NAME: usize = 64;

/// Why a value is refused: the end of a sentence that begins with the key.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// One that nothing may have.
    #[error(transparent)]
    Number(#[from] NumberError),
    /// A number beyond its bounds.
    #[error("is {value}: give a number from {} to {}", short(*.least), short(*.most))]
    Range {
        /// The number.
        value: f64,
        /// The least allowed.
        least: f64,
        /// The most allowed.
        most: f64,
    },
    /// A count beyond its bounds.
    #[error("is {value}: give a whole number from {least} to {most}")]
    Count {
        /// The count.
        value: i64,
        /// The least allowed.
        least: usize,
        /// The most allowed.
        most: usize,
    },
    /// A negative seed.
    #[error("is {0}: give a whole number, 0 or more")]
    Seed(i64),
    /// A number of a thing that does not exist.
    #[error("is {number}: {things} are numbered from 1 to {total}")]
    Index {
        /// The number, meant to count from 1.
        number: i64,
        /// How many things there are.
        total: usize,
        /// What they are, in the plural.
        things: String,
    },
    /// A name of nothing.
    #[error("is \"{}\", the name of none of the {things}: {advice}", shorten(name))]
    NoSuchName {
        /// The name.
        name: String,
        /// What things are called, in the plural.
        things: String,
        /// Which names there are.
        advice: String,
    },
    /// A name of more than one thing.
    #[error(
        "is \"{}\", the name of several {things}: give the number, from 1 to {total}",
        shorten(name)
    )]
    SharedName {
        /// The name.
        name: String,
        /// What things are called, in the plural.
        things: String,
        /// How many there are.
        total: usize,
    },
    /// A list with another length than there are channels.
    #[error("has {}: give one number, or a list of {needed}", counted(*.found, "entry", "entries"))]
    Entries {
        /// Entries found.
        found: usize,
        /// Channels.
        needed: usize,
    },
    /// No name of a design.
    #[error(
        "is \"{}\": give at most {LONGEST_NAME} letters, digits and underscores, not starting with a digit, since it names files and FMUs",
        shorten(.0)
    )]
    Identifier(String),
}

/// A number without many zeros.
fn short(value: f64) -> String {
    match value == 0.0 || (1e-4..1e6).contains(&value.abs()) {
        true => value.to_string(),
        false => format!("{value:e}"),
    }
}

/// A count between two bounds.
///
/// # Errors
/// Any other.
pub fn count(value: i64, least: usize, most: usize) -> Result<usize, ValueError> {
    usize::try_from(value)
        .ok()
        .filter(|count| (least..=most).contains(count))
        .ok_or(ValueError::Count { value, least, most })
}

/// A seed of random numbers.
///
/// # Errors
/// One below zero.
pub fn seed(value: i64) -> Result<u64, ValueError> {
    u64::try_from(value).map_err(|_| ValueError::Seed(value))
}

/// A number counted from 1, as an index counted from 0.
///
/// # Errors
/// A number of nothing.
pub fn index(number: i64, total: usize, things: &str) -> Result<usize, ValueError> {
    count(number, 1, total)
        .map(|number| number - 1)
        .map_err(|_| ValueError::Index {
            number,
            total,
            things: things.to_string(),
        })
}

/// Applies a check to every entry.
///
/// # Errors
/// The first that fails.
pub fn each(values: &[f64], check: fn(f64) -> Result<(), NumberError>) -> Result<(), NumberError> {
    values.iter().try_for_each(|&value| check(value))
}

/// A name that can be a C identifier and a file name.
///
/// # Errors
/// Any other.
pub fn identifier(name: &str) -> Result<(), ValueError> {
    let mut letters = name.chars();
    let first = letters
        .next()
        .is_some_and(|c| c == '_' || c.is_ascii_alphabetic());
    let others = letters.all(|c| c == '_' || c.is_ascii_alphanumeric());
    match first && others && name.len() <= LONGEST_NAME {
        true => Ok(()),
        false => Err(ValueError::Identifier(name.to_string())),
    }
}

/// Whether a text can stand in every file that is written, XML among them.
pub fn printable(text: &str) -> bool {
    !text
        .chars()
        .any(|c| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'))
}
