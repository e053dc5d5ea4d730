//! What can be wrong with the data a controller is made of, and with a sample it is given.

use alloc::string::String;

/// Parameters from which no controller can be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControllerError {
    /// A list has another length than the rest asks for.
    #[error("the length of {field} is {found}, but the controller needs {needed}")]
    Length {
        /// Path of the field, such as `estimator.thresholds`; indices count from 0.
        field: String,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// A matrix has another size than the rest asks for.
    #[error("{field} is {} x {}, but the controller needs {} x {}", found.0, found.1, needed.0, needed.1)]
    Shape {
        /// Path of the field, such as `feedback.modes[0].integral`.
        field: String,
        /// Rows and columns found.
        found: (usize, usize),
        /// Rows and columns needed.
        needed: (usize, usize),
    },
    /// A number is infinite or none.
    #[error("{field} has a value that is not finite")]
    NotFinite {
        /// Path of the field.
        field: String,
    },
    /// A number is beyond fixed bounds.
    #[error("{field} must be a number from {least} to {most}")]
    Bounds {
        /// Path of the field.
        field: String,
        /// The least it may be.
        least: f64,
        /// The most it may be.
        most: f64,
    },
    /// A value is out of its range.
    #[error("{field} {rule}")]
    Range {
        /// Path of the field.
        field: String,
        /// What it must be: the end of a sentence that begins with the field.
        rule: String,
    },
}

/// A sample that does not fit its controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SampleError {
    /// A vector has another length than the controller needs.
    #[error("the length of the {signal} is {found}, but the controller needs {needed}")]
    Length {
        /// Which signal.
        signal: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// There is no such mode.
    #[error("mode {mode} (counted from 0) is beyond the controller's {modes}")]
    Mode {
        /// The mode, 0-based.
        mode: usize,
        /// How many there are.
        modes: usize,
    },
}
