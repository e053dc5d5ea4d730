//! What can be wrong with a plant.

/// Why a plant is refused. Modes, rows and columns count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// There is no mode.
    #[error("the plant has no mode: give at least one")]
    NoMode,
    /// The sample time (seconds) is not positive.
    #[error("the sample time is {0}: give a positive number of seconds")]
    SampleTime(f64),
    /// A size is zero.
    #[error("mode 1 has no {0}: give at least one")]
    Empty(&'static str),
    /// A matrix of the first mode does not fit its `A`.
    #[error(
        "mode 1: {matrix} is {} x {}, {}",
        found.0, found.1, fitting(matrix, *found, *needed, *states)
    )]
    Shape {
        /// `A`, `B`, `C`, `E` or `F`.
        matrix: &'static str,
        /// Rows and columns.
        found: (usize, usize),
        /// Rows and columns.
        needed: (usize, usize),
        /// Rows of `A`.
        states: usize,
    },
    /// A matrix of a later mode does not have the size it has in the first.
    #[error(
        "mode {mode}: {matrix} is {} x {}, but mode 1 makes it {} x {}{}",
        found.0, found.1, needed.0, needed.1,
        if (found.1, found.0) == *needed { ": it is transposed" } else { "" }
    )]
    OtherShape {
        /// The mode.
        mode: usize,
        /// `A`, `B`, `C`, `E` or `F`.
        matrix: &'static str,
        /// Rows and columns.
        found: (usize, usize),
        /// Rows and columns.
        needed: (usize, usize),
    },
    /// An entry is infinite or no number.
    #[error("mode {mode}: {matrix} has a value that is not finite at row {row}, column {column}")]
    NotFinite {
        /// The mode.
        mode: usize,
        /// `A`, `B`, `C`, `E` or `F`.
        matrix: &'static str,
        /// The row.
        row: usize,
        /// The column.
        column: usize,
    },
    /// A part of an operating point has the wrong length.
    #[error(
        "mode {mode}: {part} of the operating point has {found} entries: give the {needed} that the plant needs"
    )]
    OperatingPointLength {
        /// The mode.
        mode: usize,
        /// `x`, `u` or `y`.
        part: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// A part of an operating point is infinite or no number.
    #[error("mode {mode}: {part} of the operating point is not finite: give numbers")]
    OperatingPointNotFinite {
        /// The mode.
        mode: usize,
        /// `x`, `u` or `y`.
        part: &'static str,
    },
}

/// What size a matrix must have beside `A`, and whether it has it once transposed.
fn fitting(matrix: &str, found: (usize, usize), needed: (usize, usize), states: usize) -> String {
    // The other size of these matrices was taken from their own, so a transposed one tells it wrongly.
    let transposed = match matrix {
        "B" | "E" if found.1 == states => Some((states, found.0)),
        "C" if found.0 == states => Some((found.1, states)),
        _ => None,
    };
    let wanted = format!("but with A of {states} x {states} it has to be");
    match transposed {
        Some((rows, columns)) => format!("{wanted} {rows} x {columns}: it seems to be transposed"),
        None if matrix == "A" => "but A has to be square, a row and a column for each state".into(),
        None => format!("{wanted} {} x {}", needed.0, needed.1),
    }
}

#[cfg(test)]
mod tests {
    use super::fitting;

    #[test]
    fn a_transposed_matrix_is_told_from_one_of_a_wrong_size() {
        let begin = "but with A of 3 x 3 it has to be";
        let says = |found: String, words: &str| found.starts_with(&format!("{begin} {words}"));
        assert!(says(fitting("B", (2, 3), (3, 3), 3), "3 x 2: it seems"));
        assert!(says(fitting("C", (3, 2), (3, 3), 3), "2 x 3: it seems"));
        assert_eq!(fitting("B", (2, 2), (3, 2), 3), format!("{begin} 3 x 2"));
        assert!(fitting("A", (2, 3), (2, 2), 2).contains("square"));
    }
}
