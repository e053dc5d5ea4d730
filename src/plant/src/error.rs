//! What can be wrong with a plant.

use super::number::NumberError;

/// Why a plant is refused. Modes, rows and columns count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// There is no mode.
    #[error("the plant has no mode: give at least one")]
    NoMode,
    /// The sample time (seconds) is not positive.
    #[error("the sample time, in seconds, {0}")]
    SampleTime(NumberError),
    /// A size is zero.
    #[error("mode 1 has no {0}: give at least one")]
    Empty(&'static str),
    /// A matrix of the first mode does not fit its `A`.
    #[error("mode 1: {matrix} {}", fitting(matrix, *found, *needed, *states))]
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
    #[error("mode {mode}: {matrix} {}", as_in_the_first(*found, *needed))]
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
        "mode {mode}: {part} of the operating point has {found} where the plant needs {needed}: give as many"
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

impl PlantError {
    /// What is wrong with the size of a matrix: the end of a sentence that begins with its name. None of
    /// another error.
    pub fn misfit(&self) -> Option<String> {
        match self {
            Self::Shape {
                matrix,
                found,
                needed,
                states,
            } => Some(fitting(matrix, *found, *needed, *states)),
            Self::OtherShape { found, needed, .. } => Some(as_in_the_first(*found, *needed)),
            _ => None,
        }
    }
}

/// What size a matrix of a later mode must have.
fn as_in_the_first(found: (usize, usize), needed: (usize, usize)) -> String {
    let transposed = (found.1, found.0) == needed;
    format!(
        "is {} x {}, but in mode 1 it is {} x {}: {}",
        found.0,
        found.1,
        needed.0,
        needed.1,
        if transposed {
            "transpose it"
        } else {
            "give every mode the same sizes"
        }
    )
}

/// What size a matrix must have beside `A`, and whether it has it once transposed.
fn fitting(matrix: &str, found: (usize, usize), needed: (usize, usize), states: usize) -> String {
    // The other size of these matrices was taken from their own, so a transposed one tells it wrongly.
    let transposed = match matrix {
        "B" | "E" if found.1 == states => Some((states, found.0)),
        "C" if found.0 == states => Some((found.1, states)),
        _ => None,
    };
    let is = format!("is {} x {}, but", found.0, found.1);
    let wanted = format!("{is} with A of {states} x {states} it has to be");
    match transposed {
        Some((rows, columns)) => format!(
            "{wanted} {rows} x {columns}: it seems to be transposed, give its columns as rows"
        ),
        None if matrix == "A" => {
            format!("{is} has to be square: give a row and a column for each state")
        }
        None => format!("{wanted} {} x {}: give it that size", needed.0, needed.1),
    }
}

#[cfg(test)]
mod tests {
    use super::fitting;

    #[test]
    fn a_transposed_matrix_is_told_from_one_of_a_wrong_size() {
        let says = |found: String, words: &str| {
            found.contains(&format!(", but with A of 3 x 3 it has to be {words}"))
        };
        assert!(says(fitting("B", (2, 3), (3, 3), 3), "3 x 2: it seems"));
        assert!(says(fitting("C", (3, 2), (3, 3), 3), "2 x 3: it seems"));
        assert!(says(
            fitting("B", (2, 2), (3, 2), 3),
            "3 x 2: give it that size"
        ));
        assert!(fitting("A", (2, 3), (2, 2), 2).contains("square"));
    }
}
