//! Which numbers may be asked for at all, whatever they stand for.

/// The largest magnitude of a weight, an operating point, a threshold or any other number that is asked for: no physical
/// quantity in reasonable units is larger, and beyond it products overflow.
pub const LARGEST: f64 = 1e15;

/// The smallest magnitude of a number that is to be positive: beyond it quotients overflow.
pub const SMALLEST: f64 = 1.0 / LARGEST;

/// Why a number is refused: the end of a sentence that begins with what it is.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NumberError {
    /// Infinite, no number, or beyond [`LARGEST`].
    #[error("is {0:e}: give a finite number of magnitude up to {LARGEST:e}")]
    NotFinite(f64),
    /// Positive, but below [`SMALLEST`].
    #[error("is {0:e}: give a number of at least {SMALLEST:e}")]
    TooSmall(f64),
    /// Zero or below, where only positive numbers make sense.
    #[error("is {0}: give a positive number")]
    NotPositive(f64),
    /// Below zero.
    #[error("is {0}: give 0 or a positive number")]
    Negative(f64),
    /// No share of a whole.
    #[error("is {0}: give a fraction from 0 to 1")]
    Fraction(f64),
}

/// A finite number of practical size.
///
/// # Errors
/// Any other.
pub fn number(value: f64) -> Result<(), NumberError> {
    match value.is_finite() && value.abs() <= LARGEST {
        true => Ok(()),
        false => Err(NumberError::NotFinite(value)),
    }
}

/// A number above zero.
///
/// # Errors
/// Any other, and one too small to divide by.
pub fn positive(value: f64) -> Result<(), NumberError> {
    number(value)?;
    if value >= SMALLEST {
        Ok(())
    } else if value > 0.0 {
        Err(NumberError::TooSmall(value))
    } else {
        Err(NumberError::NotPositive(value))
    }
}

/// A number that is not negative.
///
/// # Errors
/// Any other.
pub fn not_negative(value: f64) -> Result<(), NumberError> {
    number(value)?;
    match value >= 0.0 {
        true => Ok(()),
        false => Err(NumberError::Negative(value)),
    }
}

/// A share of a whole.
///
/// # Errors
/// Any other.
pub fn fraction(value: f64) -> Result<(), NumberError> {
    match (0.0..=1.0).contains(&value) {
        true => Ok(()),
        false => Err(NumberError::Fraction(value)),
    }
}

/// The first entry (from 0) of a list that fails a check.
pub(crate) fn first(
    values: &[f64],
    check: fn(f64) -> Result<(), NumberError>,
) -> Option<(usize, NumberError)> {
    let mut entries = values.iter().enumerate();
    entries.find_map(|(at, &value)| Some((at, check(value).err()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_out_of_its_range_is_told_what_it_may_be() {
        let said = |found: Result<(), NumberError>| found.unwrap_err().to_string();
        assert!(number(-LARGEST).is_ok() && positive(SMALLEST).is_ok());
        assert!(not_negative(0.0).is_ok() && fraction(1.0).is_ok());
        for value in [f64::NAN, f64::INFINITY, 2.0 * LARGEST] {
            assert!(
                said(positive(value)).ends_with("give a finite number of magnitude up to 1e15")
            );
        }
        assert_eq!(said(positive(0.0)), "is 0: give a positive number");
        assert_eq!(
            said(positive(1e-300)),
            "is 1e-300: give a number of at least 1e-15"
        );
        assert_eq!(
            said(not_negative(-2.0)),
            "is -2: give 0 or a positive number"
        );
        assert_eq!(said(fraction(3.0)), "is 3: give a fraction from 0 to 1");
        assert_eq!(
            first(&[1.0, -1.0], not_negative),
            Some((1, NumberError::Negative(-1.0)))
        );
    }
}
