//! What a value must satisfy, whatever key it stands under.
//!
//! Each check answers with the end of a sentence that begins with the key.

/// No physical quantity in reasonable units is larger; beyond it products overflow.
const LARGEST: f64 = 1e15;

/// No positive one is smaller; beyond it quotients overflow.
const SMALLEST: f64 = 1.0 / LARGEST;

/// A finite number of bearable size.
pub fn number(value: f64) -> Result<(), String> {
    if value.is_finite() && value.abs() <= LARGEST {
        Ok(())
    } else {
        Err(format!(
            "is {value:e}: give a finite number of magnitude up to {LARGEST:e}"
        ))
    }
}

/// A number above zero.
pub fn positive(value: f64) -> Result<(), String> {
    number(value)?;
    if value >= SMALLEST {
        Ok(())
    } else if value > 0.0 {
        Err(format!(
            "is {value:e}: give a number of at least {SMALLEST:e}"
        ))
    } else {
        Err(format!("is {value}: give a positive number"))
    }
}

/// A number that is not negative.
pub fn not_negative(value: f64) -> Result<(), String> {
    number(value)?;
    if value >= 0.0 {
        Ok(())
    } else {
        Err(format!("is {value}: give 0 or a positive number"))
    }
}

/// A share of a whole.
pub fn fraction(value: f64) -> Result<(), String> {
    if (0.0..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(format!("is {value}: give a fraction from 0 to 1"))
    }
}

/// A decay rate per sample.
pub fn decay(value: f64) -> Result<(), String> {
    if value > 0.0 && value < 1.0 {
        Ok(())
    } else {
        Err(format!("is {value}: give a number above 0 and below 1"))
    }
}

/// A count between two bounds.
pub fn count(value: i64, least: usize, most: usize) -> Result<usize, String> {
    usize::try_from(value)
        .ok()
        .filter(|count| (least..=most).contains(count))
        .ok_or_else(|| format!("is {value}: give a whole number from {least} to {most}"))
}

/// A number counted from 1, as an index counted from 0.
pub fn index(what: &str, number: i64, total: usize, things: &str) -> Result<usize, String> {
    count(number, 1, total)
        .map(|number| number - 1)
        .map_err(|_| format!("{what} is {number}: {things} are numbered from 1 to {total}"))
}

/// Applies a check to every entry.
pub fn each(values: &[f64], check: fn(f64) -> Result<(), String>) -> Result<(), String> {
    values.iter().try_for_each(|&value| check(value))
}

/// A name that can be a C identifier and a file name.
pub fn identifier(name: &str) -> Result<(), String> {
    let mut letters = name.chars();
    let first = letters
        .next()
        .is_some_and(|c| c == '_' || c.is_ascii_alphabetic());
    if first && name.len() <= 64 && letters.all(|c| c == '_' || c.is_ascii_alphanumeric()) {
        Ok(())
    } else {
        Err(format!(
            "is \"{}\": give at most 64 letters, digits and underscores, not starting with a digit, since it names files and FMUs",
            crate::sentence::shorten(name)
        ))
    }
}
