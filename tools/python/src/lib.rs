//! The compiled half of the Python package `ftc_fmu`.
//!
//! Python builds the text of a design file, and everything from there on is what the command line
//! does: the same reader, the same refusals, the same bits. Only plain values cross over: texts,
//! lists of numbers, bytes of doubles. Documentation for users is in the Python sources and stubs.

mod campaigns;
mod controller;
mod design;
mod errors;
mod identification;
mod run;
mod waiting;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::campaigns::{campaign_json, campaign_merge, campaign_missing, campaign_text};
    #[pymodule_export]
    use super::controller::Controller;
    #[pymodule_export]
    use super::design::{Design, read_text, restore, solve};
    #[pymodule_export]
    use super::identification::{discretise, identify, time_column};
    #[pymodule_export]
    use super::run::Run;
    /// Runs of a campaign, where no number is given.
    #[pymodule_export]
    const RUNS: u64 = campaign::RUNS;
    /// How far a log's mean step may be from its sample time, relative to it.
    #[pymodule_export]
    const DRIFT: f64 = ftc_tables::DRIFT;
    #[pymodule_export]
    use super::{example, examples, main, platforms, verify, version};
}

/// The command line; returns its exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>, binaries: PathBuf, itself: Vec<OsString>) -> u8 {
    py.detach(|| ftc_fmu::main(arguments, Some(binaries), Some(itself)))
}

/// Proves an FMU again; returns the proof as JSON. `runner` is the command that runs its binary.
#[pyfunction]
fn verify(
    py: Python<'_>,
    path: PathBuf,
    key: Option<PathBuf>,
    runner: Option<Vec<OsString>>,
) -> PyResult<String> {
    let proved = py.detach(|| {
        let key = key.as_deref().map(package::signature::VerifyingKey::read);
        let checks = package::Checks {
            key: key.transpose()?,
            runner: runner.map(package::binary::Runner),
        };
        package::verify_with(&path, &checks)
    });
    proved
        .map(|verification| report::summary::pretty(&verification.json()))
        .map_err(|error| errors::of_package(py, error))
}

/// Platforms whose FMU binaries are in a folder.
#[pyfunction]
fn platforms(binaries: PathBuf) -> Vec<&'static str> {
    let holds = |platform: &package::platform::Platform| {
        let folder = binaries.join("fmu-binaries").join(platform.name);
        let library = |name: &str| folder.join(format!("{name}.{}", platform.extension));
        ["ftc_controller", "ftc_plant"]
            .iter()
            .all(|name| Path::is_file(&library(name)))
    };
    let all = package::platform::PLATFORMS.iter();
    all.filter(|platform| holds(platform))
        .map(|platform| platform.name)
        .collect()
}

/// Names of the examples.
#[pyfunction]
fn examples() -> Vec<&'static str> {
    design_file::examples::names()
}

/// Name and contents of an example's files, the one to start from first.
#[pyfunction]
fn example(py: Python<'_>, name: &str) -> PyResult<Vec<(String, Py<PyBytes>)>> {
    let files = design_file::examples::files(name).map_err(|what| errors::of_sentence(py, what))?;
    let bytes = |(name, bytes): (String, Vec<u8>)| (name, PyBytes::new(py, &bytes).unbind());
    Ok(files.into_iter().map(bytes).collect())
}

/// Version of the package.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}
