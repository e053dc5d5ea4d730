//! Identification from logs, and discretisation.

use crate::errors;
use crate::waiting::wait;
use ftc_identify::{Coordinates, Identified, IdentifiedMode, Log, Settings};
use ftc_plant::Mode;
use nalgebra::{DMatrix, DVector};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Rows = Vec<Vec<f64>>;

fn matrix(rows: &Rows) -> PyResult<DMatrix<f64>> {
    let columns = rows.first().map_or(0, Vec::len);
    if rows.iter().any(|row| row.len() != columns) {
        return Err(PyValueError::new_err("rows differ in length"));
    }
    Ok(DMatrix::from_fn(rows.len(), columns, |row, column| {
        rows[row][column]
    }))
}

fn rows(matrix: &DMatrix<f64>) -> Rows {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

fn list(values: &DVector<f64>) -> Vec<f64> {
    values.iter().copied().collect()
}

/// `A` (n x n) and `B` (n x m) at a sample time, exact for inputs that are held between samples.
#[pyfunction]
pub fn discretise(a: Rows, b: Rows, sample_time: f64) -> PyResult<(Rows, Rows)> {
    let (a, b) = (matrix(&a)?, matrix(&b)?);
    let c = DMatrix::zeros(0, a.nrows());
    let exact = Mode::new(a, b, c).sampled(sample_time);
    if !exact
        .a
        .iter()
        .chain(&exact.b)
        .all(|value| value.is_finite())
    {
        let what =
            "the model grows beyond all numbers within one sample: give a shorter sample time";
        return Err(PyValueError::new_err(what));
    }
    Ok((rows(&exact.a), rows(&exact.b)))
}

/// Which column tells the time, from 0, and the seconds of its unit; none where no name is a usual one.
#[pyfunction]
pub fn time_column(
    py: Python<'_>,
    names: Vec<String>,
    said: Option<&str>,
    taken: Vec<usize>,
) -> PyResult<Option<(usize, f64)>> {
    ftc_tables::find_time_column(&names, said, &taken)
        .map(|found| found.map(|column| (column.index, column.seconds())))
        .map_err(|error| errors::of_sentence(py, format!("the data frame {error}")))
}

/// Matrices A, B, C, then x0, u0, y0, then the fit per output, samples held out and used.
type Found = (Rows, Rows, Rows, [Vec<f64>; 3], Vec<f64>, usize, usize);
/// Order, orders tried with their fits, modes, how states were joined and the fit of that, and the text.
type Answer = (
    usize,
    Vec<(usize, f64)>,
    Vec<Found>,
    &'static str,
    Option<f64>,
    String,
);

/// Models of the modes from logs: per log inputs, outputs (rows of samples) and modes (from 1);
/// `disturbance` as its period (s), its harmonics and the sample time (s); `names` of the outputs.
#[pyfunction]
pub fn identify(
    py: Python<'_>,
    logs: Vec<(Rows, Rows, Vec<usize>)>,
    order: Option<usize>,
    disturbance: Option<(f64, u32, f64)>,
    names: Vec<String>,
) -> PyResult<Answer> {
    let logs: Vec<Log> = logs
        .into_iter()
        .map(|(inputs, outputs, modes)| {
            let modes = modes
                .iter()
                .map(|mode| mode.checked_sub(1))
                .collect::<Option<Vec<_>>>();
            Ok(Log::new(matrix(&inputs)?, matrix(&outputs)?)
                .in_modes(modes.ok_or_else(|| PyValueError::new_err("modes are numbered from 1"))?))
        })
        .collect::<PyResult<_>>()?;
    let mut settings = Settings::default();
    settings.order = order;
    if let Some((period, harmonics, sample_time)) = disturbance {
        settings = settings.with_disturbance(period, harmonics, sample_time);
    }
    let found = wait(py, &|| "identifying".into(), None, move || {
        ftc_identify::identify(&logs, &settings)
    })?;
    found
        .map(|found| answer(found, &names))
        .map_err(|error| errors::of_sentence(py, error))
}

fn answer(found: Identified, names: &[String]) -> Answer {
    let text = report::identification::text(&found, names);
    let (joined, fit) = match found.coordinates {
        Coordinates::Single => ("single mode", None),
        Coordinates::Switches { fit } => ("switches", Some(fit)),
        Coordinates::Outputs => ("outputs", None),
    };
    let one = |mode: IdentifiedMode| {
        let point = [list(&mode.x0), list(&mode.u0), list(&mode.y0)];
        (
            rows(&mode.a),
            rows(&mode.b),
            rows(&mode.c),
            point,
            mode.fit,
            mode.held_out,
            mode.samples,
        )
    };
    let modes = found.modes.into_iter().map(one).collect();
    (found.order, found.tried, modes, joined, fit, text)
}
