//! Exceptions of `ftc_fmu.errors`, with the parts of their sentences.

use design_file::values::NameOrList;
use design_file::wording;
use ftc_design::DesignError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// An exception of the package.
fn make<'py>(
    py: Python<'py>,
    class: &str,
    arguments: impl IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error = PyErr>,
) -> PyErr {
    let made = arguments.into_pyobject(py).and_then(|arguments| {
        py.import("ftc_fmu.errors")?
            .getattr(class)?
            .call1(arguments)
    });
    match made {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// Who wrote the text of a design file.
#[derive(Clone, Copy)]
pub enum Author<'a> {
    /// The user, in the file of this name.
    User(&'a str),
    /// This package: its user never saw a line.
    Package,
}

/// What was given is at fault.
pub fn of_input(py: Python<'_>, error: design_file::Error, author: Author<'_>) -> PyErr {
    let (sentence, line) = match author {
        Author::User(file) => (format!("{file}: {}", error.sentence), error.line),
        Author::Package => (without_position(&error.sentence).to_string(), None),
    };
    make(py, "DesignFileError", (sentence, error.key, line))
}

/// What was given is at fault, and no text of a design file holds it.
pub fn of_sentence(py: Python<'_>, sentence: impl ToString) -> PyErr {
    make(py, "DesignFileError", (sentence.to_string(),))
}

/// A sentence without the `line 3, column 7: ` that it may begin with.
fn without_position(sentence: &str) -> &str {
    let rest = sentence
        .strip_prefix("line ")
        .and_then(|rest| rest.split_once(", column "));
    rest.and_then(|(_, rest)| rest.split_once(": "))
        .map_or(sentence, |(_, rest)| rest)
}

/// There is no such controller.
///
/// `text` is that of the design file, `logs` are those that it names.
pub fn of_design(
    py: Python<'_>,
    error: &DesignError,
    text: &str,
    logs: Option<&NameOrList>,
    author: Author<'_>,
) -> PyErr {
    let sentence = match author {
        Author::User(file) => format!("{file}: {}", wording::of_error(error)),
        Author::Package => wording::of_error(error),
    };
    let advice = |advice: &[ftc_design::Advice]| -> Vec<String> {
        advice.iter().map(wording::of_advice).collect()
    };
    match error {
        DesignError::Request(what) => of_input(
            py,
            design_file::Error::of_request(text, &wording::of_request(what, logs)),
            author,
        ),
        DesignError::Infeasible(found) => {
            let blocks: Vec<(String, f64)> = found
                .blocks
                .iter()
                .map(|block| (block.name.to_string(), block.weight))
                .collect();
            make(py, "Infeasible", (sentence, blocks, advice(&found.advice)))
        }
        DesignError::Uncertified(found) => {
            make(py, "Uncertified", (sentence, advice(&found.advice)))
        }
        _ => make(py, "NoDesign", (sentence,)),
    }
}

/// An FMU could not be written, or not be proved.
pub fn of_package(py: Python<'_>, error: package::Error) -> PyErr {
    let sentence = error.to_string();
    match error {
        package::Error::Unproved { .. } => make(py, "Unproved", (sentence,)),
        package::Error::Output(_) => make(py, "DesignFileError", (sentence, "out")),
        package::Error::Key { option, .. } => make(py, "DesignFileError", (sentence, option)),
        package::Error::NoPlatform { .. } => make(py, "DesignFileError", (sentence, "platforms")),
        _ => make(py, "FtcError", (sentence,)),
    }
}
