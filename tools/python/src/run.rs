//! One simulated experiment: trajectories, figures of merit, page.

use ftc_design::Design;
use ftc_simulate::Variant;
use ftc_simulate::closed_loop::Record;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use report::simulate::{Samples, SimulateError, Simulation};

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
    columns: Vec<Column>,
    variants: Vec<&'static str>,
    tracked: Vec<usize>,
    outputs: Vec<String>,
}

/// A signal of all samples, one sample after the other.
struct Column {
    name: String,
    /// 0: one number a sample.
    width: usize,
    values: Vec<f64>,
}

/// Keeps every signal as it comes.
struct Columns {
    sample_time: f64,
    columns: Vec<Column>,
    variants: Vec<&'static str>,
}

impl Columns {
    /// The columns of these runs, empty.
    fn begin(&mut self, runs: &[(Variant, Record)]) {
        let Some((_, first)) = runs.first() else {
            return;
        };
        let mut add = |name: String, width: usize| {
            self.columns.push(Column {
                name,
                width,
                values: Vec::new(),
            });
        };
        add("t".into(), 0);
        add("mode".into(), 0);
        for (name, reading) in SHARED {
            add(name.into(), reading(first).len());
        }
        for (variant, record) in runs {
            let key = variant.key();
            for (name, reading) in OWN {
                add(format!("{key}.{name}"), reading(record).len());
            }
            add(format!("{key}.fault"), record.flagged.len());
            if record.mode_hat.is_some() {
                add(format!("{key}.mode_hat"), 0);
            }
        }
        self.variants = runs.iter().map(|(variant, _)| variant.key()).collect();
    }
}

impl Samples for Columns {
    fn take(&mut self, runs: &[(Variant, Record)]) -> std::io::Result<()> {
        if self.columns.is_empty() {
            self.begin(runs);
        }
        let Some((_, first)) = runs.first() else {
            return Ok(());
        };
        let time = [first.tick as f64 * self.sample_time];
        let mode = [(first.mode + 1) as f64];
        let mut columns = self.columns.iter_mut();
        let mut put = |values: &[f64]| {
            if let Some(column) = columns.next() {
                column.values.extend_from_slice(values);
            }
        };
        put(&time);
        put(&mode);
        for (_, reading) in SHARED {
            put(reading(first));
        }
        for (_, record) in runs {
            for (_, reading) in OWN {
                put(reading(record));
            }
            let flags = record.flagged.iter().map(|&flag| f64::from(u8::from(flag)));
            put(&flags.collect::<Vec<f64>>());
            if let Some(mode) = record.mode_hat {
                put(&[(mode + 1) as f64]);
            }
        }
        Ok(())
    }
}

/// Name, width (0: one number a sample) and native doubles of a signal.
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
        let mut kept = Columns {
            sample_time: design.plant.sample_time,
            columns: Vec::new(),
            variants: Vec::new(),
        };
        let simulation = report::simulate::simulate(design, warnings, baselines, &mut kept)?;
        // A scenario without disturbances has no column for them.
        let shown = |column: &Column| column.width > 0 || !column.values.is_empty();
        kept.columns.retain(shown);
        Ok(Self {
            simulation,
            columns: kept.columns,
            variants: kept.variants,
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
}

#[pymethods]
impl Run {
    /// Every signal.
    fn signals<'py>(&self, py: Python<'py>) -> Vec<Signal<'py>> {
        let signal = |column: &Column| {
            let bytes = column.values.iter().copied().flat_map(f64::to_ne_bytes);
            let bytes = PyBytes::new(py, &bytes.collect::<Vec<u8>>());
            (column.name.clone(), column.width, bytes)
        };
        self.columns.iter().map(signal).collect()
    }

    /// Keys of the variants.
    fn variants(&self) -> Vec<&'static str> {
        self.variants.clone()
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
