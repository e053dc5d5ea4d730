//! A mode's matrices fitted to logs of healthy operation: a grey box, started at the design model and held by it.
//!
//! A log is cut into windows. In each of them the state at its start, the disturbance's waves and a constant
//! level of each of its channels are whatever explains the readings best; `A` and `B`, which all windows share,
//! make the readings of the windows least wrong together (output error), with a penalty on how far they differ from the
//! design model, entry by entry, relative to the error that the model may have. Gauss-Newton with the windows'
//! own unknowns projected out.

use crate::augmented::scaled;
use crate::commissioning::{Database, RecordedDisturbance};
use ftc_control::parameters::FittedMode;
use ftc_plant::Mode;
use ftc_plant::scaling::Scaling;
use ftc_record::plain;
use nalgebra::{DMatrix, DVector};

/// Samples in a window, at least, and per unknown of its own.
const WINDOW: usize = 40;
const SAMPLES_PER_UNKNOWN: usize = 4;

/// Of so many windows one is held back to judge the fit.
const HELD_BACK: usize = 4;

/// Steps of the iteration, at most; none improves by less than this share where it ends.
const ITERATIONS: usize = 10;
const CONVERGED: f64 = 1e-4;

/// Error of an entry that is none in the model, relative to that of the largest entry of its row.
const OF_ROW: f64 = 0.1;

/// The inputs of a log act a sample later than their rows say where this leaves less than this share of the
/// variance that the model leaves otherwise.
const LATE: f64 = 0.5;

/// The model error that is left, at least: what no log shows, such as a plant that ages.
const LEAST_ERROR: f64 = 0.01;

/// What a log says of a mode.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The matrices, and how well they explain the windows held back.
    pub(crate) mode: FittedMode,
    /// Standard deviation of what they leave unexplained (p), output units.
    pub(crate) deviation: Vec<f64>,
    /// Relative error of the matrices that is left.
    pub(crate) model_error: f64,
}

/// A window: what drives it and what was read.
struct Window {
    /// Inputs (samples x m).
    u: DMatrix<f64>,
    /// Outputs (samples x p).
    y: DMatrix<f64>,
    /// The disturbance's waves and level (samples x waves), the same for each channel.
    waves: DMatrix<f64>,
}

/// A window under given matrices, outputs in units of the sensors' deviations.
struct Explained {
    /// What is left of the readings (samples p).
    rest: DVector<f64>,
    /// An orthonormal basis of what the window's own unknowns can do to the outputs (samples p x unknowns).
    span: DMatrix<f64>,
    /// States that explain the readings (n x samples).
    states: DMatrix<f64>,
}

/// The mode, and what is asked of the fit.
struct GreyBox<'a> {
    mode: &'a Mode,
    /// Standard deviation of each parameter about the model: `A`, `B`, row after row.
    prior: DVector<f64>,
    /// Standard deviation of each sensor (p).
    deviation: DVector<f64>,
}

/// Why a log says nothing of a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// It has too few windows.
    Short,
    /// Its inputs act one sample after the row that they stand in.
    Late,
}

/// Fits `A` and `B` of `mode`, whose entries are known to the relative error `model_error`, to its `stretches` of a
/// log, in which a disturbance was at work.
pub(crate) fn fit(
    mode: &Mode,
    stretches: &[Database],
    disturbance: Option<RecordedDisturbance>,
    model_error: f64,
    scaling: &Scaling,
) -> Result<Fit, Unusable> {
    let windows = windows_of(mode, stretches, disturbance);
    if windows.len() < HELD_BACK {
        return Err(Unusable::Short);
    }
    let (mut held_back, mut learn) = (Vec::new(), Vec::new());
    for (at, window) in windows.into_iter().enumerate() {
        match at % HELD_BACK == HELD_BACK - 1 {
            true => held_back.push(window),
            false => learn.push(window),
        }
    }
    let model = parameters(&mode.a, &mode.b);
    let mut grey = GreyBox {
        mode,
        prior: model_error * entries(mode, scaling),
        deviation: DVector::from_element(mode.c.nrows(), 1.0),
    };
    let late: Vec<Database> = stretches.iter().filter_map(a_sample_later).collect();
    let late = windows_of(mode, &late, disturbance);
    let variance = |windows: &[Window]| grey.unexplained(windows, &model).norm_squared();
    if variance(&late) < LATE * variance(&learn) {
        return Err(Unusable::Late);
    }
    let (mut theta, mut left) = grey.improve(&learn, &model, model_error);
    // What was held back decides: a log that the model explains better is not used.
    grey.deviation = grey.unexplained(&held_back, &model);
    let (of_model, of_fit) = (
        grey.rests(&held_back, &model),
        grey.rests(&held_back, &theta),
    );
    if of_fit >= of_model {
        (theta, left) = (model.clone(), model_error);
    }
    let (a, b) = grey.matrices(&theta);
    Ok(Fit {
        mode: FittedMode::new(
            plain(&a),
            plain(&b),
            grey.percent(&held_back, &theta),
            grey.percent(&held_back, &model),
        ),
        deviation: grey.unexplained(&held_back, &theta).as_slice().to_vec(),
        model_error: left.max(LEAST_ERROR.min(model_error)),
    })
}

/// `A` and `B`, row after row.
fn parameters(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DVector<f64> {
    let of = |matrix: &DMatrix<f64>| matrix.transpose().iter().copied().collect::<Vec<_>>();
    DVector::from_vec([of(a), of(b)].concat())
}

/// The size that the error of each parameter is relative to.
fn entries(mode: &Mode, scaling: &Scaling) -> DVector<f64> {
    let (x, u) = (&scaling.states, &scaling.inputs);
    let [a, b] = [(&mode.a, x), (&mode.b, u)].map(|(matrix, from)| scaled(matrix, x, from));
    let largest = |i: usize| {
        let row = a.row(i).amax().max(b.row(i).amax());
        row.max(f64::MIN_POSITIVE.sqrt())
    };
    let size = |matrix: &DMatrix<f64>, from: &[f64]| {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            matrix[(i, j)]
                .abs()
                .max(OF_ROW * largest(i) * x[i] / from[j])
        })
    };
    parameters(&size(&mode.a, x), &size(&mode.b, u))
}

/// Samples in a window.
pub(crate) fn least_samples(mode: &Mode, disturbance: Option<RecordedDisturbance>) -> usize {
    let count = disturbance.map_or(0, |known| known.count);
    let own = mode.a.nrows() + (1 + 2 * count) * mode.e.ncols();
    WINDOW.max(SAMPLES_PER_UNKNOWN * own / mode.c.nrows())
}

/// The same stretch if each input acted one sample after its row.
fn a_sample_later(stretch: &Database) -> Option<Database> {
    let samples = stretch.samples().checked_sub(1)?;
    let inputs = stretch.inputs.rows(0, samples).into_owned();
    let outputs = stretch.outputs.rows(1, samples).into_owned();
    Database::new(stretch.first + 1, inputs, outputs).ok()
}

fn windows_of(
    mode: &Mode,
    stretches: &[Database],
    disturbance: Option<RecordedDisturbance>,
) -> Vec<Window> {
    let count = disturbance.map_or(0, |known| known.count);
    let length = least_samples(mode, disturbance);
    // The level first, then the waves.
    let wave = |k: usize, column: usize| match (disturbance, column.checked_sub(1)) {
        (Some(known), Some(column)) => known.wave(k, column),
        _ => 1.0,
    };
    let cut = |stretch: &Database| {
        let starts = (0..stretch.samples() / length).map(|at| at * length);
        let window = |from: usize| Window {
            u: stretch.inputs.rows(from, length).into_owned(),
            y: stretch.outputs.rows(from, length).into_owned(),
            waves: DMatrix::from_fn(length, 1 + 2 * count, |k, column| {
                wave(stretch.first + from + k, column)
            }),
        };
        starts.map(window).collect::<Vec<_>>()
    };
    stretches.iter().flat_map(cut).collect()
}

impl GreyBox<'_> {
    /// The parameters that explain the windows best, and the relative error of the model that is left.
    fn improve(
        &mut self,
        windows: &[Window],
        model: &DVector<f64>,
        model_error: f64,
    ) -> (DVector<f64>, f64) {
        let (mut theta, mut left) = (model.clone(), model_error);
        for _ in 0..ITERATIONS {
            self.deviation = self.unexplained(windows, &theta);
            let Some((normal, step)) = self.step(windows, &theta, model) else {
                break;
            };
            let before = self.cost(windows, &theta, model);
            let mut tried = (0..6).map(|halvings| {
                let next = &theta + 0.5_f64.powi(halvings) * &step;
                (self.cost(windows, &next, model), next)
            });
            let Some((cost, better)) = tried.find(|(cost, _)| *cost <= before) else {
                break;
            };
            theta = better;
            left = model_error * self.left(&normal).unwrap_or(1.0).sqrt();
            if before - cost <= CONVERGED * before {
                break;
            }
        }
        (theta, left)
    }

    fn matrices(&self, theta: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, m) = self.mode.b.shape();
        let (a, b) = theta.as_slice().split_at(n * n);
        (
            DMatrix::from_row_slice(n, n, a),
            DMatrix::from_row_slice(n, m, b),
        )
    }

    /// States (n x samples) from `x` on under the `drive` (n x samples).
    fn run(a: &DMatrix<f64>, x: DVector<f64>, drive: &DMatrix<f64>) -> DMatrix<f64> {
        let mut states = DMatrix::zeros(a.nrows(), drive.ncols());
        let mut x = x;
        for k in 0..drive.ncols() {
            states.set_column(k, &x);
            x = a * x + drive.column(k);
        }
        states
    }

    /// Outputs (p x samples) in units of the deviations, one sample below the other.
    fn weighed(&self, mut outputs: DMatrix<f64>) -> DVector<f64> {
        for (mut row, deviation) in outputs.row_iter_mut().zip(self.deviation.iter()) {
            row /= *deviation;
        }
        DVector::from_column_slice(outputs.as_slice())
    }

    /// What each of the window's own unknowns does: states (n x samples), and outputs in units of the deviations.
    fn own(&self, a: &DMatrix<f64>, window: &Window) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        let (n, samples) = (a.nrows(), window.u.nrows());
        let still = DMatrix::zeros(n, samples);
        let starts = (0..n).map(|i| {
            let start = DVector::from_fn(n, |row, _| f64::from(row == i));
            let states = Self::run(a, start, &still);
            let outputs = &self.mode.c * &states;
            (states, outputs)
        });
        let channels = self.mode.e.column_iter().zip(self.mode.f.column_iter());
        let waves = channels.flat_map(|(e, f)| {
            window.waves.column_iter().map(move |wave| {
                let states = Self::run(a, DVector::zeros(n), &(e * wave.transpose()));
                let outputs = &self.mode.c * &states + f * wave.transpose();
                (states, outputs)
            })
        });
        let all = starts.chain(waves);
        all.map(|(states, outputs)| (states, self.weighed(outputs)))
            .collect()
    }

    /// What explains the readings of `window` best, and what it leaves.
    fn explain(&self, window: &Window, theta: &DVector<f64>) -> Explained {
        let (a, b) = self.matrices(theta);
        let drive = &b * window.u.transpose();
        let mut states = Self::run(&a, DVector::zeros(a.nrows()), &drive);
        let read = self.weighed(window.y.transpose()) - self.weighed(&self.mode.c * &states);
        let own = self.own(&a, window);
        let columns: Vec<_> = own.iter().map(|(_, outputs)| outputs.clone()).collect();
        let free = DMatrix::from_columns(&columns);
        let lost = Explained {
            rest: DVector::from_element(read.len(), f64::INFINITY),
            span: DMatrix::zeros(read.len(), 0),
            states: states.clone(),
        };
        if !free.iter().all(|value| value.is_finite()) {
            return lost;
        }
        // Directions that the window cannot tell apart are left at none.
        let svd = free.svd(true, true);
        let least = 1e-9 * svd.singular_values.max();
        let kept = svd.singular_values.iter().filter(|&&value| value > least);
        let kept = kept.count();
        let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
            return lost;
        };
        let span = u.columns(0, kept).into_owned();
        let found = span.tr_mul(&read);
        let rest = &read - &span * &found;
        let coordinates = DVector::from_fn(kept, |k, _| found[k] / svd.singular_values[k]);
        let amounts = vt.rows(0, kept).tr_mul(&coordinates);
        for ((of_own, _), amount) in own.iter().zip(amounts.iter()) {
            states += of_own * *amount;
        }
        Explained { rest, span, states }
    }

    /// How the rest of `window` falls with each parameter, without what the window's own unknowns can do
    /// (samples p x parameters).
    fn slope(&self, window: &Window, theta: &DVector<f64>, found: &Explained) -> DMatrix<f64> {
        let (a, b) = self.matrices(theta);
        let (n, m) = b.shape();
        let samples = window.u.nrows();
        let mut slope = DMatrix::zeros(found.rest.len(), theta.len());
        for i in 0..n {
            let mut filter = |column: usize, signal: DMatrix<f64>| {
                let mut drive = DMatrix::zeros(n, samples);
                drive.set_row(i, &signal.row(0));
                let states = Self::run(&a, DVector::zeros(n), &drive);
                slope.set_column(column, &self.weighed(&self.mode.c * states));
            };
            for j in 0..n {
                filter(i * n + j, found.states.rows(j, 1).into_owned());
            }
            for j in 0..m {
                filter(n * n + i * m + j, window.u.columns(j, 1).transpose());
            }
        }
        &slope - &found.span * found.span.tr_mul(&slope)
    }

    /// Sum of squares of what is left, in units of the deviations.
    fn rests(&self, windows: &[Window], theta: &DVector<f64>) -> f64 {
        let rest = |window| self.explain(window, theta).rest.norm_squared();
        windows.iter().map(rest).sum()
    }

    fn cost(&self, windows: &[Window], theta: &DVector<f64>, model: &DVector<f64>) -> f64 {
        let moved = (theta - model).component_div(&self.prior);
        self.rests(windows, theta) + moved.norm_squared()
    }

    /// The data's normal matrix, and the step of Gauss and Newton.
    fn step(
        &self,
        windows: &[Window],
        theta: &DVector<f64>,
        model: &DVector<f64>,
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let count = theta.len();
        let mut normal = DMatrix::zeros(count, count);
        let mut right = DVector::zeros(count);
        for window in windows {
            let found = self.explain(window, theta);
            let slope = self.slope(window, theta, &found);
            normal += slope.tr_mul(&slope);
            right += slope.tr_mul(&found.rest);
        }
        let weight = self.prior.map(|size| (size * size).recip());
        right -= weight.component_mul(&(theta - model));
        let whole = &normal + DMatrix::from_diagonal(&weight);
        let step = whole.cholesky()?.solve(&right);
        Some((normal, step))
    }

    /// Share of the variance that the error of the model had in the readings and that is left.
    fn left(&self, normal: &DMatrix<f64>) -> Option<f64> {
        let prior = self.prior.map(|size| size * size);
        let before = normal.diagonal().dot(&prior);
        let whole = normal + DMatrix::from_diagonal(&prior.map(f64::recip));
        let after = whole.cholesky()?.solve(normal).trace();
        (before > 0.0).then(|| (after / before).min(1.0))
    }

    /// Sum of squares of what is left of each output (p), output units.
    fn squares(&self, windows: &[Window], theta: &DVector<f64>) -> DVector<f64> {
        let p = self.mode.c.nrows();
        let mut sums = DVector::zeros(p);
        for window in windows {
            let rest = self.explain(window, theta).rest;
            let rest = DMatrix::from_column_slice(p, window.y.nrows(), rest.as_slice());
            for (q, row) in rest.row_iter().enumerate() {
                sums[q] += row.norm_squared() * self.deviation[q] * self.deviation[q];
            }
        }
        sums
    }

    /// Standard deviation of what is left of each sensor (p), output units.
    fn unexplained(&self, windows: &[Window], theta: &DVector<f64>) -> DVector<f64> {
        let p = self.mode.c.nrows() as f64;
        let free = |window: &Window| {
            let own = self.mode.a.nrows() + window.waves.ncols() * self.mode.e.ncols();
            window.y.nrows() as f64 - own as f64 / p
        };
        let free: f64 = windows.iter().map(free).sum();
        let squares = self.squares(windows, theta);
        squares.map(|sum| (sum / free).sqrt().max(f64::MIN_POSITIVE.sqrt()))
    }

    /// 100 (1 - |y - fitted| / |y - mean|) of each output over the windows.
    fn percent(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<f64> {
        let moved = |q: usize, window: &Window| {
            let read = window.y.column(q);
            read.add_scalar(-read.mean()).norm_squared()
        };
        let squares = self.squares(windows, theta);
        let outputs = squares.iter().enumerate().map(|(q, left)| {
            let all: f64 = windows.iter().map(|window| moved(q, window)).sum();
            100.0 * (1.0 - (left / all.max(f64::MIN_POSITIVE)).sqrt())
        });
        outputs.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commissioning::commission;

    fn mode() -> Mode {
        Mode::new(
            DMatrix::from_row_slice(2, 2, &[0.8, 0.1, -0.2, 0.6]),
            DMatrix::from_row_slice(2, 1, &[0.5, 0.3]),
            DMatrix::from_row_slice(1, 2, &[1.0, 0.5]),
        )
        .named("one")
        .with_disturbance(
            DMatrix::from_row_slice(2, 1, &[0.2, 0.1]),
            DMatrix::zeros(1, 1),
        )
    }

    fn scaling() -> Scaling {
        Scaling {
            states: vec![1.0; 2],
            inputs: vec![1.0],
            outputs: vec![1.0],
        }
    }

    /// What a step response of the matrices differs by from the plant's, relative to the model's difference.
    fn left(fitted: &FittedMode, plant: &Mode, model: &Mode) -> f64 {
        let gain = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            let still = DMatrix::identity(2, 2) - a;
            (&plant.c * still.lu().solve(b).unwrap())[(0, 0)]
        };
        let dense = ftc_record::dense;
        let truth = gain(&plant.a, &plant.b);
        (gain(&dense(&fitted.a), &dense(&fitted.b)) - truth).abs()
            / (gain(&model.a, &model.b) - truth).abs()
    }

    fn wrong(plant: &Mode) -> Mode {
        let mut model = plant.clone();
        model.a[(0, 0)] *= 1.08;
        model.b[(1, 0)] *= 0.9;
        model
    }

    #[test]
    fn a_log_corrects_the_model() {
        let (plant, model) = (mode(), wrong(&mode()));
        let log = commission(&plant, &[1.0], &[0.01], 1200, 4);
        let found = fit(&model, &[log], None, 0.1, &scaling()).unwrap();
        assert!(left(&found.mode, &plant, &model) < 0.05, "{found:?}");
        assert!(found.mode.fit[0] > found.mode.fit_of_model[0]);
        assert!((found.deviation[0] - 0.01).abs() < 0.002, "{found:?}");
        assert!(found.model_error < 0.05);
    }

    #[test]
    fn a_disturbance_in_the_log_is_not_taken_for_the_plant() {
        let (plant, model) = (mode(), wrong(&mode()));
        let mut log = commission(&plant, &[1.0], &[0.01], 1200, 4);
        let mut x = DVector::zeros(2);
        for k in 0..1200 {
            log.outputs[(k, 0)] += (&plant.c * &x)[0];
            let wave = 2.0 * (core::f64::consts::TAU * k as f64 / 60.0).sin() + 1.0;
            x = &plant.a * x + &plant.e * DVector::from_element(1, wave);
        }
        let known = RecordedDisturbance {
            period: 60.0,
            count: 1,
        };
        let found = fit(&model, &[log], Some(known), 0.1, &scaling()).unwrap();
        assert!(left(&found.mode, &plant, &model) < 0.1, "{found:?}");
    }

    #[test]
    fn a_log_that_moves_nothing_leaves_the_model() {
        let model = mode();
        let log = commission(&model, &[0.0], &[0.01], 400, 4);
        let found = fit(&model, &[log], None, 0.05, &scaling()).unwrap();
        let a = ftc_record::dense(&found.mode.a);
        assert!((&a - &model.a).amax() < 0.02, "{a}");
        assert!(found.model_error > 0.02, "{found:?}");
    }

    #[test]
    fn a_log_that_is_too_short_is_refused() {
        let log = commission(&mode(), &[1.0], &[0.01], 3 * WINDOW, 4);
        let found = fit(&mode(), &[log], None, 0.05, &scaling());
        assert_eq!(found.unwrap_err(), Unusable::Short);
    }

    #[test]
    fn commands_that_act_a_sample_later_are_found_out() {
        let log = commission(&mode(), &[1.0], &[0.01], 1200, 4);
        let early = Database::new(
            0,
            log.inputs.rows(1, 1199).into_owned(),
            log.outputs.rows(0, 1199).into_owned(),
        );
        let found = fit(&mode(), &[early.unwrap()], None, 0.05, &scaling());
        assert_eq!(found.unwrap_err(), Unusable::Late);
    }
}
