//! What both experiments share: from an example to a design, from runs to numbers and curves.

use crate::Error;
use ftc_design::assembly::{Request, assemble};
use ftc_design::{Design, DesignError};
use ftc_simulate::Trajectory;
use ftc_simulate::closed_loop::Record;
use ftc_simulate::metrics::Merit;
use report::figure::{Figure, Mark, Point};
use report::table::{Table, number};
use serde::Serialize;
use std::path::Path;

/// The request of the design file of this name that is part of this program.
pub fn request((name, text): (&str, &str)) -> Result<Request, Error> {
    let loaded = design_file::parse(text, Path::new(""));
    Ok(loaded
        .map_err(|error| error.in_file(Path::new(name)))?
        .request)
}

/// The design of a case.
pub fn design(request: Request, case: &str) -> Result<Design, Error> {
    assemble(request).map_err(in_case(case))
}

/// Says in which case there is no design.
pub fn in_case(case: &str) -> impl Fn(DesignError) -> Error {
    move |error| Error::Design {
        case: case.into(),
        error,
    }
}

/// Figures of merit of one output of one run, as written to JSON and CSV.
#[derive(Clone, Debug, Serialize)]
pub struct OutputMerits {
    /// Name of the output.
    pub output: String,
    /// Against what the plant does.
    #[serde(rename = "true")]
    pub true_output: Merit,
    /// Against what the sensor says.
    pub measured: Merit,
}

/// The figures of merit of every tracked output.
pub fn merits(run: &Trajectory, design: &Design) -> Vec<OutputMerits> {
    let tracked = &design.controller.feedback.tracked;
    let merits = run.merits(tracked);
    let named = tracked.iter().zip(merits);
    named
        .map(|(&output, merits)| OutputMerits {
            output: design.signals.outputs[output].name.clone(),
            true_output: merits.true_output,
            measured: merits.measured,
        })
        .collect()
}

/// Sum of the true mean square errors.
pub fn true_error(merits: &[OutputMerits]) -> f64 {
    merits.iter().map(|merit| merit.true_output.mse).sum()
}

/// One row per output of every run: the names that `names` gives, then the figures of merit.
pub fn table<'a>(
    names: &[&str],
    runs: impl Iterator<Item = (Vec<String>, &'a [OutputMerits])>,
) -> Result<Vec<u8>, Error> {
    let merits = [
        "output",
        "true_mse",
        "true_vaf",
        "measured_mse",
        "measured_vaf",
    ];
    let mut table = Table::new(names.iter().chain(&merits))?;
    for (names, outputs) in runs {
        for OutputMerits {
            output,
            true_output,
            measured,
        } in outputs
        {
            let numbers =
                [true_output.mse, true_output.vaf, measured.mse, measured.vaf].map(number);
            let row = names.iter().chain([output]).chain(&numbers);
            table.row(row)?;
        }
    }
    Ok(table.finish()?)
}

/// A signal of a run over time in seconds.
pub fn curve(run: &Trajectory, sample_time: f64, signal: impl Fn(&Record) -> f64) -> Vec<Point> {
    run.records
        .iter()
        .map(|record| [record.tick as f64 * sample_time, signal(record)])
        .collect()
}

/// Vertical lines where the mode changes.
pub fn switches(run: &Trajectory, design: &Design) -> Vec<Mark> {
    let te = design.plant.sample_time;
    let modes = &design.plant.modes;
    run.records
        .windows(2)
        .filter(|pair| pair[0].mode != pair[1].mode)
        .map(|pair| Mark {
            at: pair[1].tick as f64 * te,
            label: format!("mode {}: {}", pair[1].mode + 1, modes[pair[1].mode].name),
        })
        .collect()
}

/// An empty figure over time with faults of a sensor shaded and mode switches marked.
pub fn figure(
    run: &Trajectory,
    design: &Design,
    (key, title, label): (String, String, String),
    intervals: &[[usize; 2]],
) -> Figure {
    let te = design.plant.sample_time;
    let shaded = intervals
        .iter()
        .map(|interval| interval.map(|index| index as f64 * te))
        .collect();
    Figure::new(key, title, "time (s)", label)
        .shade("fault present", shaded)
        .mark(&switches(run, design))
}
