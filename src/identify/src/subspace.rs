//! One mode's model by predictor-based subspace identification (Chiuso 2007), with a constant term
//! and known periods.

use crate::data::Stretch;
use crate::least_squares;
use nalgebra::DMatrix;

/// `x(k+1) = A x(k) + B u(k) + K e(k) + A0 d(k)`, `y(k) = C x(k) + C0 d(k) + e(k)`, in scaled
/// deviations; `d` is what is known besides, its first entry 1 ([`Stretch::known`]).
#[derive(Clone, Debug)]
pub struct Model {
    /// State matrix (n x n).
    pub a: DMatrix<f64>,
    /// Input matrix (n x m).
    pub b: DMatrix<f64>,
    /// Output matrix (p x n).
    pub c: DMatrix<f64>,
    /// Predictor gain (n x p).
    pub k: DMatrix<f64>,
    /// What is known, to the state (n x q).
    pub a0: DMatrix<f64>,
    /// What is known, to the output (p x q).
    pub c0: DMatrix<f64>,
}

impl Model {
    /// The same model in coordinates `T x`.
    pub fn transformed(&self, t: &DMatrix<f64>, inverse: &DMatrix<f64>) -> Self {
        Self {
            a: t * &self.a * inverse,
            b: t * &self.b,
            c: &self.c * inverse,
            k: t * &self.k,
            a0: t * &self.a0,
            c0: self.c0.clone(),
        }
    }
}

/// Rows that the predictor must have for each coefficient it learns.
const ROWS_PER_COEFFICIENT: usize = 2;

/// The model of an order, from a past window of `past` samples. `None` where the data are too few
/// or no numbers come out.
pub fn estimate(stretches: &[Stretch], past: usize, order: usize) -> Option<Model> {
    let usable: Vec<&Stretch> = stretches
        .iter()
        .filter(|s| s.samples() > past + 1)
        .collect();
    let first = usable.first()?;
    let (m, p) = (first.u.nrows(), first.y.nrows());
    let samples: usize = usable.iter().map(|s| s.samples() - past).sum();
    let q = first.known.nrows();
    let width = past * (m + p) + q;
    if samples < ROWS_PER_COEFFICIENT * width {
        return None;
    }
    let lagged = concatenate(&usable, width, |stretch| regressors(stretch, past));
    let outputs = concatenate(&usable, p, |s| tail(&s.y, past));
    let markov = least_squares::fit(&outputs, &lagged)?;
    let states = states(&markov, &lagged, past, (m, p), order)?;
    let known = concatenate(&usable, q, |s| tail(&s.known, past));
    matrices(&usable, &states, &outputs, &known, past)
}

/// Columns of all stretches side by side.
fn concatenate(
    stretches: &[&Stretch],
    rows: usize,
    part: impl Fn(&Stretch) -> DMatrix<f64>,
) -> DMatrix<f64> {
    let parts: Vec<DMatrix<f64>> = stretches.iter().map(|s| part(s)).collect();
    let columns = parts.iter().map(DMatrix::ncols).sum();
    let mut all = DMatrix::zeros(rows, columns);
    let mut first = 0;
    for part in &parts {
        all.columns_mut(first, part.ncols()).copy_from(part);
        first += part.ncols();
    }
    all
}

fn tail(values: &DMatrix<f64>, from: usize) -> DMatrix<f64> {
    values.columns(from, values.ncols() - from).into_owned()
}

/// Column `k - past`: outputs and inputs at `k-1`, ..., `k-past`, and what is known at `k`.
fn regressors(stretch: &Stretch, past: usize) -> DMatrix<f64> {
    let (m, p) = (stretch.u.nrows(), stretch.y.nrows());
    let block = m + p;
    let rows = past * block + stretch.known.nrows();
    DMatrix::from_fn(rows, stretch.samples() - past, |row, column| {
        if row >= past * block {
            return stretch.known[(row - past * block, column + past)];
        }
        let (lag, part) = (row / block + 1, row % block);
        let at = column + past - lag;
        match part < p {
            true => stretch.y[(part, at)],
            false => stretch.u[(part - p, at)],
        }
    })
}

/// States (n x N): principal components of what the past says of the outputs to come.
fn states(
    markov: &DMatrix<f64>,
    lagged: &DMatrix<f64>,
    past: usize,
    (m, p): (usize, usize),
    order: usize,
) -> Option<DMatrix<f64>> {
    let block = m + p;
    let mut map = DMatrix::zeros(past * p, lagged.nrows());
    for ahead in 0..past {
        for lag in 1..=past - ahead {
            let source = markov.columns((ahead + lag - 1) * block, block);
            map.view_mut((ahead * p, (lag - 1) * block), (p, block))
                .copy_from(&source);
        }
    }
    let predicted = map * lagged;
    let eigen = (&predicted * predicted.transpose()).symmetric_eigen();
    let mut largest: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    largest.sort_by(|&one, &other| eigen.eigenvalues[other].total_cmp(&eigen.eigenvalues[one]));
    let chosen = largest.get(..order)?;
    let count = predicted.ncols() as f64;
    let mut map = DMatrix::zeros(order, predicted.nrows());
    for (row, &index) in chosen.iter().enumerate() {
        let size = (eigen.eigenvalues[index] / count).sqrt();
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        // Unit variance of each state.
        map.row_mut(row)
            .copy_from(&(eigen.eigenvectors.column(index).transpose() / size));
    }
    Some(map * predicted)
}

/// Matrices from states by least squares.
fn matrices(
    stretches: &[&Stretch],
    states: &DMatrix<f64>,
    outputs: &DMatrix<f64>,
    known: &DMatrix<f64>,
    past: usize,
) -> Option<Model> {
    let (n, p, q) = (states.nrows(), outputs.nrows(), known.nrows());
    let mut reading = DMatrix::zeros(n + q, states.ncols());
    reading.rows_mut(0, n).copy_from(states);
    reading.rows_mut(n, q).copy_from(known);
    let read = least_squares::fit(outputs, &reading)?;
    let errors = outputs - &read * reading;
    // Pairs of states that follow each other within a stretch.
    let m = stretches[0].u.nrows();
    let pairs: usize = stretches.iter().map(|s| s.samples() - past - 1).sum();
    let mut next = DMatrix::zeros(n, pairs);
    let mut now = DMatrix::zeros(n + m + p + q, pairs);
    let (mut first, mut pair) = (0, 0);
    for stretch in stretches {
        let count = stretch.samples() - past;
        next.columns_mut(pair, count - 1)
            .copy_from(&states.columns(first + 1, count - 1));
        let mut columns = now.columns_mut(pair, count - 1);
        let parts = [
            states.columns(first, count - 1),
            stretch.u.columns(past, count - 1),
            errors.columns(first, count - 1),
            known.columns(first, count - 1),
        ];
        let mut row = 0;
        for part in parts {
            columns.rows_mut(row, part.nrows()).copy_from(&part);
            row += part.nrows();
        }
        first += count;
        pair += count - 1;
    }
    let found = least_squares::fit(&next, &now)?;
    Some(Model {
        a: found.columns(0, n).into_owned(),
        b: found.columns(n, m).into_owned(),
        k: found.columns(n + m, p).into_owned(),
        a0: found.columns(n + m + p, q).into_owned(),
        c: read.columns(0, n).into_owned(),
        c0: read.columns(n, q).into_owned(),
    })
}
