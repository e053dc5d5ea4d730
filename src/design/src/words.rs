//! Parts of sentences about a design, for this crate's errors and for those who word them for their users.

use nalgebra::Complex;

/// So many of a thing, `one` or `many`.
///
/// ```
/// use ftc_design::words::counted;
///
/// assert_eq!(counted(1, "entry", "entries"), "1 entry");
/// assert_eq!(counted(0, "entry", "entries"), "0 entries");
/// ```
pub fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// The values between two ends, either of which may be open.
pub fn interval(min: Option<f64>, max: Option<f64>) -> String {
    match (min, max) {
        (Some(min), Some(max)) => format!("{min} to {max}"),
        (Some(min), None) => format!("{min} or more"),
        (None, Some(max)) => format!("{max} or less"),
        (None, None) => "any value".into(),
    }
}

/// When a `successor` follows a mode, both from 1; nothing where the mode stays.
pub fn entering(mode: usize, successor: usize) -> String {
    match mode == successor {
        true => String::new(),
        false => format!(" when mode {successor} follows"),
    }
}

/// An eigenvalue to four digits.
pub fn eigenvalue(value: Complex<f64>) -> String {
    match value.im == 0.0 {
        true => format!("{:.4}", value.re),
        false => format!("{:.4}{:+.4}i", value.re, value.im),
    }
}

/// The least decay that an eigenvalue of this `magnitude` bears, to the four digits that are shown.
pub fn least_decay(magnitude: f64) -> f64 {
    (magnitude * 1e4).ceil() / 1e4
}
