//! Campaigns in parts that merge exactly.

use crate::errors;
use crate::waiting::wait;
use campaign::{Options, Partial, Watch};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use report::Made;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Options from JSON.
///
/// # Errors
/// One sentence that names the option.
pub fn options(py: Python<'_>, text: &str, design: &ftc_design::Design) -> PyResult<Options> {
    let options: Options = serde_json::from_str(text)
        .map_err(|error| errors::of_sentence(py, format!("campaign: {error}")))?;
    // A key that is left out has a default; one that is there is meant.
    let given: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
    let said = given.get("model_error").is_some();
    options
        .check()
        .and_then(|()| match said {
            true => options.check_model_error(design),
            false => Ok(()),
        })
        .map_err(|what| errors::of_sentence(py, what))?;
    Ok(options)
}

/// Does the runs of a range on `threads` threads (all processors when absent).
///
/// # Errors
/// What interrupted it.
pub fn run(
    py: Python<'_>,
    made: Arc<Made>,
    options: Options,
    range: Range<u64>,
    (threads, listener): (Option<usize>, Option<&Py<PyAny>>),
) -> PyResult<Vec<u8>> {
    let watch = Arc::new(Watch::default());
    let (seen, total) = (watch.clone(), range.end.saturating_sub(range.start));
    let what = move || format!("{} of {total} runs", seen.done.load(Ordering::Relaxed));
    let inner = watch.clone();
    let done = wait(py, &what, listener, move || {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .build();
        let work =
            || campaign::run_watched(&made.design, &options, range, &inner, |_| Ok::<(), ()>(()));
        pool.map(|pool| pool.install(work))
    });
    if done.is_err() {
        watch.stop.store(true, Ordering::Relaxed);
    }
    let part = done?
        .map_err(|error| PyValueError::new_err(format!("no threads can be started: {error}")))?
        .map_err(|()| PyValueError::new_err("the campaign kept no runs"))?;
    written(&part)
}

fn written(part: &Partial) -> PyResult<Vec<u8>> {
    serde_json::to_vec(part).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// A part that was written by [`run`] or [`campaign_merge`].
///
/// # Errors
/// Where it is none.
pub fn read(part: &[u8]) -> PyResult<Partial> {
    serde_json::from_slice(part)
        .map_err(|error| PyValueError::new_err(format!("no part of a campaign: {error}")))
}

/// Parts as one.
#[pyfunction]
pub fn campaign_merge<'py>(py: Python<'py>, parts: Vec<Vec<u8>>) -> PyResult<Bound<'py, PyBytes>> {
    let parts: Vec<Partial> = parts
        .iter()
        .map(|part| read(part))
        .collect::<PyResult<_>>()?;
    let whole = campaign::merge(parts).map_err(|error| errors::of_sentence(py, error))?;
    written(&whole).map(|bytes| PyBytes::new(py, &bytes))
}

/// Runs of `0..runs` that a part lacks.
#[pyfunction]
pub fn campaign_missing(part: &[u8], runs: u64) -> PyResult<Vec<(u64, u64)>> {
    let missing = read(part)?.missing(0..runs);
    Ok(missing
        .into_iter()
        .map(|range| (range.start, range.end))
        .collect())
}

/// `campaign.json`.
#[pyfunction]
pub fn campaign_json(part: &[u8], asked: u64) -> PyResult<String> {
    Ok(report::summary::pretty(&campaign::page::json(
        &read(part)?,
        asked,
    )))
}

/// The table of a campaign.
#[pyfunction]
pub fn campaign_text(part: &[u8]) -> PyResult<String> {
    Ok(campaign::page::text(&read(part)?))
}
