//! What both experiments share: from an example to a design, from runs to numbers and curves.

use design_file::assemble as design_request;
use ftc_design::assembly::{Request, assemble};
use ftc_design::{Design, DesignError};
use ftc_simulate::closed_loop::Record;
use ftc_simulate::metrics::Merit;
use ftc_simulate::{Trajectory, Variant};
use report::figure::{Dash, Figure, Ink, Mark, Point, Series, Weight};
use serde::Serialize;
use std::path::Path;

/// The request of a design file that is part of this program.
pub fn request(text: &str) -> Result<Request, String> {
    let file = design_file::parse(text)?;
    design_request::request(&file, Path::new(""))
}

/// The design, or one sentence.
pub fn design(request: Request) -> Result<Design, String> {
    let name = request.name.clone();
    assemble(request).map_err(|error: DesignError| format!("{name}: {error}"))
}

/// Figures of merit of one output of one run, as written to JSON and CSV.
#[derive(Clone, Debug, Serialize)]
pub struct OutputMerits {
    /// Name of the output.
    pub output: String,
    /// Against what the plant does.
    #[serde(rename = "true")]
    pub truth: Merit,
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
            truth: merits.truth,
            measured: merits.measured,
        })
        .collect()
}

/// Sum of the true mean square errors.
pub fn true_error(merits: &[OutputMerits]) -> f64 {
    merits.iter().map(|merit| merit.truth.mse).sum()
}

/// A signal of a run over time in seconds.
pub fn curve(run: &Trajectory, sample_time: f64, signal: impl Fn(&Record) -> f64) -> Vec<Point> {
    run.records
        .iter()
        .map(|record| [record.tick as f64 * sample_time, signal(record)])
        .collect()
}

/// A curve in the look its controller has in every figure.
pub fn series(name: &str, variant: Variant, points: Vec<Point>) -> Series {
    let series = Series::new(name, points);
    match variant {
        Variant::Ftc => series.ink(Ink::Blue),
        Variant::NoFtc => series.ink(Ink::Vermilion).dash(Dash::Dashed).secondary(),
        Variant::ToldTheFault => series.ink(Ink::Green).weight(Weight::Broad),
        Variant::Additive => series.ink(Ink::Ochre).dash(Dash::Dashed).secondary(),
        Variant::Predictive => series.ink(Ink::Purple).dash(Dash::Dashed).secondary(),
    }
}

/// The reference in its look.
pub fn reference(points: Vec<Point>) -> Series {
    Series::new("reference", points)
        .ink(Ink::Text)
        .dash(Dash::Dotted)
        .step()
}

/// Vertical lines where the mode changes.
pub fn switches(run: &Trajectory, design: &Design) -> Vec<Mark> {
    let te = design.controller.plant.sample_time;
    let modes = &design.controller.plant.modes;
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
    let te = design.controller.plant.sample_time;
    let shaded = intervals
        .iter()
        .map(|interval| interval.map(|index| index as f64 * te))
        .collect();
    Figure::new(key, title, "time (s)", label)
        .shade("fault present", shaded)
        .mark(&switches(run, design))
}
