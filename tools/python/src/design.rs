//! Designs: solved, read again, simulated, exported.

use crate::campaigns;
use crate::controller::Controller;
use crate::errors::{self, Author};
use crate::run::Run;
use crate::waiting::wait;
use ftc_design::assembly::assemble;
use ftc_design::{DesignError, MOST_THREADS};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use report::{Made, Source, summary};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A finished design.
#[pyclass(frozen, module = "ftc_fmu._core")]
pub struct Design(Arc<Made>);

/// The text of a design file.
#[pyfunction]
pub fn read_text(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let called = path.display().to_string();
    design_file::load(&path).map_err(|error| errors::of_input(py, error, Author::User(&called)))
}

/// Designs what a text asks for; logs and tables are sought in `folder`. `called` is the name of
/// the file that the user wrote, if there is one.
#[pyfunction]
#[pyo3(signature = (text, folder, called=None, listener=None, threads=1))]
pub fn solve(
    py: Python<'_>,
    text: &str,
    folder: PathBuf,
    called: Option<&str>,
    listener: Option<Py<PyAny>>,
    threads: usize,
) -> PyResult<Design> {
    let pool = (threads != 1).then(|| pool(py, threads)).transpose()?;
    let author = called.map_or(Author::Package, Author::User);
    let loaded =
        design_file::parse(text, &folder).map_err(|error| errors::of_input(py, error, author))?;
    let logs = loaded.file.estimator.logs().cloned();
    let what = || "solving for gains and certifying them".to_string();
    let made = wait(py, &what, listener.as_ref(), move || {
        let (request, source) = Source::split(loaded);
        let design = match pool {
            Some(pool) => pool.install(|| assemble(request))?,
            None => assemble(request)?,
        };
        Ok::<_, DesignError>(source.made(design))
    })?;
    made.map(|made| Design(Arc::new(made)))
        .map_err(|error| errors::of_design(py, &error, text, logs.as_ref(), author))
}

fn pool(py: Python<'_>, threads: usize) -> PyResult<rayon::ThreadPool> {
    let range = 1..=MOST_THREADS;
    let built = match range.contains(&threads) {
        true => rayon::ThreadPoolBuilder::new().num_threads(threads).build(),
        false => {
            let what = format!("threads is {threads}: give 1 to {MOST_THREADS}");
            return Err(errors::of_sentence(py, what));
        }
    };
    built.map_err(|error| {
        errors::of_sentence(
            py,
            format!("threads: none can be started ({error}): give fewer"),
        )
    })
}

/// A design from its record.
#[pyfunction]
pub fn restore(record: &[u8]) -> PyResult<Design> {
    let (design, warnings) = serde_json::from_slice(record)
        .map_err(|error| PyValueError::new_err(format!("no record of a design: {error}")))?;
    Ok(Design(Arc::new(Made::again(design, warnings))))
}

#[pymethods]
impl Design {
    /// The report as JSON.
    fn json(&self) -> String {
        summary::json(&self.0.design, &self.0.warnings)
    }

    /// The report as text.
    fn text(&self) -> String {
        summary::text(&self.0.design, &self.0.warnings)
    }

    /// The page that the FMU carries, with the figures of its scenario.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        let made = self.0.clone();
        wait(py, &|| "simulating".into(), None, move || {
            let runs = report::documentation::runs(&made.design);
            let lead = "Sensor-fault-tolerant controller of a switched plant.".into();
            report::documentation::page(&made.design, &runs, None, made.design.name.clone(), lead)
        })
    }

    /// What is worth knowing.
    fn warnings(&self) -> Vec<String> {
        self.0.warnings.clone()
    }

    /// Everything, for [`restore`].
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let record = (&self.0.design, &self.0.warnings);
        let bytes = serde_json::to_vec(&record)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Runs the loop; a design file's text may bring another scenario.
    #[pyo3(signature = (text, folder, baselines=false))]
    fn simulate(
        &self,
        py: Python<'_>,
        text: Option<&str>,
        folder: PathBuf,
        baselines: bool,
    ) -> PyResult<Run> {
        let mut design = self.0.design.clone();
        let mut warnings = self.0.warnings.clone();
        if let Some(text) = text {
            let loaded = loaded(py, text, &folder)?;
            design.scenario = loaded.request.scenario;
            design.true_plant = loaded.request.true_plant;
            let new = loaded.notes.into_iter();
            let new: Vec<String> = new.filter(|note| !warnings.contains(note)).collect();
            warnings.extend(new);
        }
        let simulated = wait(py, &|| "simulating".into(), None, move || {
            Run::of(&design, warnings, baselines)
        })?;
        simulated.map_err(|what| errors::of_sentence(py, what))
    }

    /// Writes the FMUs; returns the paths.
    fn export(
        &self,
        py: Python<'_>,
        out: PathBuf,
        binaries: PathBuf,
        ssp: bool,
        platforms: Option<Vec<String>>,
        sign: Option<PathBuf>,
    ) -> PyResult<Vec<PathBuf>> {
        let made = self.0.clone();
        let options = package::Options {
            out,
            binaries,
            ssp,
            platforms,
            sign,
        };
        let written = wait(py, &|| "exporting".into(), None, move || {
            package::export(&made.design, &options)
        })?;
        written
            .map(|exported| exported.paths)
            .map_err(|error| errors::of_package(py, error))
    }

    /// Does runs of a campaign; returns the part of it that they are.
    #[pyo3(signature = (options, first, last, threads=None, listener=None))]
    fn campaign<'py>(
        &self,
        py: Python<'py>,
        options: &str,
        first: u64,
        last: u64,
        threads: Option<usize>,
        listener: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let options = campaigns::options(py, options, &self.0.design)?;
        let watched = (threads, listener.as_ref());
        let part = campaigns::run(py, self.0.clone(), options, first..last, watched)?;
        Ok(PyBytes::new(py, &part))
    }

    /// Writes `campaign.json` and `campaign.html`; returns their paths.
    fn campaign_save(
        &self,
        py: Python<'_>,
        part: &[u8],
        asked: u64,
        out: PathBuf,
    ) -> PyResult<[PathBuf; 2]> {
        let part = campaigns::read(part)?;
        campaign::files::write(&out, &self.0.design, &part, asked)
            .map_err(|error| errors::of_package(py, error.into()))
    }

    /// The page of a campaign.
    fn campaign_html(&self, part: &[u8], asked: u64) -> PyResult<String> {
        let part = campaigns::read(part)?;
        Ok(campaign::page::html(&self.0.design, &part, asked))
    }

    /// The controller at rest.
    fn controller(&self) -> PyResult<Controller> {
        Controller::of(&self.0.design)
    }
}

fn loaded(py: Python<'_>, text: &str, folder: &Path) -> PyResult<design_file::Loaded> {
    design_file::parse(text, folder).map_err(|error| errors::of_input(py, error, Author::Package))
}
