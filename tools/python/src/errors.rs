//! Exceptions of `ftc_fmu.errors`, with the parts of their sentences.

use crate::place;
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

/// What was given is at fault. `text` is the design file that the user wrote, `called` its name.
pub fn of_input(py: Python<'_>, sentence: &str, text: Option<&str>, called: Option<&str>) -> PyErr {
    let key = place::key(sentence);
    let line = place::line(sentence).or_else(|| place::line_of(text?, key.as_deref()?));
    let line = text.and(line);
    // Lines of a text that the user never saw say nothing.
    let sentence = match text {
        Some(_) => sentence,
        None => place::without_position(sentence),
    };
    let sentence = match called {
        Some(called) => format!("{called}: {sentence}"),
        None => sentence.to_string(),
    };
    make(py, "DesignFileError", (sentence, key, line))
}

/// There is no such controller.
pub fn of_design(
    py: Python<'_>,
    error: &DesignError,
    text: Option<&str>,
    called: Option<&str>,
) -> PyErr {
    let sentence = match called {
        Some(called) => format!("{called}: {error}"),
        None => error.to_string(),
    };
    let advice = |advice: &[ftc_design::Advice]| -> Vec<String> {
        advice.iter().map(ToString::to_string).collect()
    };
    match error {
        DesignError::Request(what) => of_input(py, &what.to_string(), text, called),
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
        package::Error::NoPlatform { .. } => make(py, "DesignFileError", (sentence, "platforms")),
        _ => make(py, "FtcError", (sentence,)),
    }
}
