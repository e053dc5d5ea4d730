//! One simulated experiment: trajectories, figures of merit, page.

use ftc_design::Design;
use ftc_simulate::Trajectory;
use ftc_simulate::closed_loop::Record;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use report::simulate::{SimulateError, Simulation};

/// A signal of one sample.
type Reading = fn(&Record) -> &[f64];

/// Signals of the scenario.
const SHARED: [(&str, Reading); 4] = [
    ("y_ref", |record| &record.reference),
    ("w", |record| &record.disturbance),
    ("f", |record| &record.fault),
    ("noise", |record| &record.noise),
];

/// Signals of one variant.
const OWN: [(&str, Reading); 7] = [
    ("y", |record| &record.y),
    ("y_true", |record| &record.y_true),
    ("x", |record| &record.x),
    ("u", |record| &record.u),
    ("x_hat", |record| &record.x_hat),
    ("f_hat", |record| &record.f_hat),
    ("residual", |record| &record.residual),
];

/// An experiment in every variant.
#[pyclass(frozen, module = "ftc_fmu._core")]
pub struct Run {
    simulation: Simulation,
    sample_time: f64,
    tracked: Vec<usize>,
    outputs: Vec<String>,
}

/// Name, width (0: one number a sample) and little-endian doubles of a signal.
type Signal<'py> = (String, usize, Bound<'py, PyBytes>);

impl Run {
    /// Simulates a design's scenario.
    ///
    /// # Errors
    /// A baseline that cannot be made for this design.
    pub fn of(
        design: &Design,
        warnings: Vec<String>,
        baselines: bool,
    ) -> Result<Self, SimulateError> {
        Ok(Self {
            simulation: report::simulate::simulate(design, warnings, baselines)?,
            sample_time: design.plant.sample_time,
            tracked: design.controller.feedback.tracked.clone(),
            outputs: design
                .signals
                .outputs
                .iter()
                .map(|signal| report::text::with_unit(&signal.name, signal.unit.as_deref()))
                .collect(),
        })
    }

    fn file(&self, name: &str) -> String {
        let found = self.simulation.files.iter().find(|(file, _)| file == name);
        found.map_or(String::new(), |(_, bytes)| {
            String::from_utf8_lossy(bytes).into_owned()
        })
    }

    fn signals_of<'py>(&self, py: Python<'py>, run: &Trajectory) -> Vec<Signal<'py>> {
        let key = run.variant.key();
        let mut signals: Vec<Signal<'py>> = OWN
            .iter()
            .map(|(name, reading)| table(py, format!("{key}.{name}"), run, *reading))
            .collect();
        let width = run.records.first().map_or(0, |record| record.flagged.len());
        let flags = run.records.iter().flat_map(|record| &record.flagged);
        let flags = doubles(py, flags.map(|&flag| f64::from(u8::from(flag))));
        signals.push((format!("{key}.fault"), width, flags));
        if run.finds_the_mode() {
            let modes = run.records.iter().filter_map(|record| record.mode_hat);
            let modes = doubles(py, modes.map(|mode| (mode + 1) as f64));
            signals.push((format!("{key}.mode_hat"), 0, modes));
        }
        signals
    }
}

fn doubles<'py>(py: Python<'py>, values: impl Iterator<Item = f64>) -> Bound<'py, PyBytes> {
    PyBytes::new(py, &values.flat_map(f64::to_ne_bytes).collect::<Vec<u8>>())
}

fn table<'py>(py: Python<'py>, name: String, run: &Trajectory, reading: Reading) -> Signal<'py> {
    let width = run
        .records
        .first()
        .map_or(0, |record| reading(record).len());
    let values = run
        .records
        .iter()
        .flat_map(|record| reading(record).iter().copied());
    (name, width, doubles(py, values))
}

#[pymethods]
impl Run {
    /// Every signal.
    fn signals<'py>(&self, py: Python<'py>) -> Vec<Signal<'py>> {
        let Some(first) = self.simulation.trajectories.first() else {
            return Vec::new();
        };
        let records = || first.records.iter();
        let times = records().map(|record| record.tick as f64 * self.sample_time);
        let modes = records().map(|record| (record.mode + 1) as f64);
        let mut signals = vec![
            ("t".into(), 0, doubles(py, times)),
            ("mode".into(), 0, doubles(py, modes)),
        ];
        let shared = SHARED
            .iter()
            .map(|(name, reading)| table(py, (*name).into(), first, *reading));
        signals.extend(shared.filter(|(_, width, _)| *width > 0));
        for run in &self.simulation.trajectories {
            signals.extend(self.signals_of(py, run));
        }
        signals
    }

    /// Keys of the variants.
    fn variants(&self) -> Vec<&'static str> {
        self.simulation
            .trajectories
            .iter()
            .map(|run| run.variant.key())
            .collect()
    }

    /// `metrics.json`.
    fn metrics(&self) -> String {
        self.file("metrics.json")
    }

    /// The table for a person, and what is worth knowing.
    fn text(&self) -> String {
        let found = &self.simulation;
        found.summary.clone() + &report::warnings::text(&found.warnings)
    }

    /// Of the design, of the run, and of the plants that are not quite the model.
    fn warnings(&self) -> Vec<String> {
        self.simulation.warnings.clone()
    }

    /// The page.
    fn html(&self) -> String {
        self.file("report.html")
    }

    /// Tracked outputs, from 0.
    fn tracked(&self) -> Vec<usize> {
        self.tracked.clone()
    }

    /// Outputs with their units.
    fn outputs(&self) -> Vec<String> {
        self.outputs.clone()
    }
}
