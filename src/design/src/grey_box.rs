//! A mode's matrices fitted to logs of healthy operation: a grey box, started at the design model and held by it.
//!
//! A log is cut into windows. In each of them the state at its start, the disturbance's waves and a constant
//! level of each of its channels are whatever explains the readings best; `A` and `B`, which all windows share,
//! make the readings of the windows least wrong together (output error), at the price of what they differ from the
//! design model, entry by entry, relative to the error that the model may have. Gauss-Newton with the windows'
//! own unknowns projected out.

use crate::commissioning::{Database, RecordedDisturbance};
use crate::matrices::plain;
use ftc_control::parameters::FittedMode;
use ftc_plant::Mode;
use ftc_plant::scaling::Scaling;
use nalgebra::{DMatrix, DVector};

/// Samples in a window, at least, and per unknown of its own.
const WINDOW: usize = 40;
const SAMPLES_PER_UNKNOWN: usize = 4;

/// Every so many windows one is held back, and judges.
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

/// A window under given matrices, rows in units of the sensors' deviations.
struct Explained {
    /// What is left of the readings (samples p).
    rest: DVector<f64>,
    /// How the rest falls with each parameter, without what the window's own unknowns can do (samples p x parameters).
    slope: DMatrix<f64>,
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
    let (judges, learn): (Vec<_>, Vec<_>) = windows
        .into_iter()
        .enumerate()
        .partition(|(at, _)| at % HELD_BACK == HELD_BACK - 1);
    let [judges, learn] = [judges, learn].map(|part| part.into_iter().map(|(_, window)| window));
    let (judges, learn): (Vec<_>, Vec<_>) = (judges.collect(), learn.collect());
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
    let mut theta = model.clone();
    let mut left = model_error;
    for _ in 0..ITERATIONS {
        grey.deviation = grey.unexplained(&learn, &theta);
        let Some((normal, step)) = grey.step(&learn, &theta, &model) else {
            break;
        };
        let before = grey.cost(&learn, &theta, &model);
        let shares = (0..6).map(|halvings| 0.5_f64.powi(halvings));
        let mut tried = shares.map(|share| &theta + share * &step);
        let Some(better) = tried.find(|next| grey.cost(&learn, next, &model) <= before) else {
            break;
        };
        let gained = before - grey.cost(&learn, &better, &model);
        theta = better;
        left = model_error * grey.left(&normal).unwrap_or(1.0).sqrt();
        if gained <= CONVERGED * before {
            break;
        }
    }
    // What was held back decides: a log that the model explains better teaches nothing.
    grey.deviation = grey.unexplained(&judges, &model);
    let (of_model, of_fit) = (grey.rests(&judges, &model), grey.rests(&judges, &theta));
    if of_fit >= of_model {
        (theta, left) = (model.clone(), model_error);
    }
    let (a, b) = grey.matrices(&theta);
    Ok(Fit {
        mode: FittedMode {
            a: plain(&a),
            b: plain(&b),
            fit: grey.percent(&judges, &theta),
            fit_of_model: grey.percent(&judges, &model),
        },
        deviation: grey.unexplained(&judges, &theta).as_slice().to_vec(),
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
    let scaled = |matrix: &DMatrix<f64>, from: &[f64], i: usize, j: usize| {
        (matrix[(i, j)] * from[j] / x[i]).abs()
    };
    let largest = |i: usize| {
        let a = (0..x.len()).map(|j| scaled(&mode.a, x, i, j));
        let b = (0..u.len()).map(|j| scaled(&mode.b, u, i, j));
        a.chain(b).fold(f64::MIN_POSITIVE.sqrt(), f64::max)
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
    let wave = |k: usize, column: usize| {
        let Some(known) = disturbance.filter(|_| column > 0) else {
            return 1.0;
        };
        let harmonic = column.div_ceil(2) as f64;
        let angle = core::f64::consts::TAU * harmonic * k as f64 / known.period;
        if column.is_multiple_of(2) {
            angle.cos()
        } else {
            angle.sin()
        }
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

    /// The outputs of states (n x samples) in units of the deviations, one below the other.
    fn seen(&self, states: &DMatrix<f64>) -> DVector<f64> {
        let mut outputs = &self.mode.c * states;
        self.weigh(&mut outputs);
        DVector::from_column_slice(outputs.as_slice())
    }

    fn weigh(&self, outputs: &mut DMatrix<f64>) {
        for (mut row, deviation) in outputs.row_iter_mut().zip(self.deviation.iter()) {
            row /= *deviation;
        }
    }

    /// What the readings of `window` leave unexplained, and, where `sloping`, how it falls with the parameters.
    fn explain(&self, window: &Window, theta: &DVector<f64>, sloping: bool) -> Explained {
        let (a, b) = self.matrices(theta);
        let (n, m) = b.shape();
        let samples = window.u.nrows();
        let none = DVector::zeros(n);
        let driven = Self::run(&a, none.clone(), &(&b * window.u.transpose()));
        let still = DMatrix::zeros(n, samples);
        let mut own: Vec<(DMatrix<f64>, DMatrix<f64>)> = (0..n)
            .map(|i| {
                let mut start = none.clone();
                start[i] = 1.0;
                let states = Self::run(&a, start, &still);
                let outputs = &self.mode.c * &states;
                (states, outputs)
            })
            .collect();
        for (e, f) in self.mode.e.column_iter().zip(self.mode.f.column_iter()) {
            for wave in window.waves.column_iter() {
                let states = Self::run(&a, none.clone(), &(e * wave.transpose()));
                let outputs = &self.mode.c * &states + f * wave.transpose();
                own.push((states, outputs));
            }
        }
        let mut free = DMatrix::zeros(samples * self.mode.c.nrows(), own.len());
        for (mut column, (_, outputs)) in free.column_iter_mut().zip(&mut own) {
            self.weigh(outputs);
            column.copy_from_slice(outputs.as_slice());
        }
        let mut read = window.y.transpose();
        self.weigh(&mut read);
        let read = DVector::from_column_slice(read.as_slice()) - self.seen(&driven);
        if !free.iter().all(|value| value.is_finite()) {
            let rest = DVector::from_element(read.len(), f64::INFINITY);
            return Explained {
                rest,
                slope: DMatrix::zeros(0, 0),
            };
        }
        // Directions that the window cannot tell apart are left at none.
        let svd = free.svd(true, true);
        let least = 1e-9 * svd.singular_values.max();
        let kept = svd.singular_values.iter().filter(|&&value| value > least);
        let kept = kept.count();
        let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
            return Explained {
                rest: read,
                slope: DMatrix::zeros(0, 0),
            };
        };
        let span = u.columns(0, kept);
        let found = span.transpose() * &read;
        let rest = &read - span * &found;
        if !sloping {
            return Explained {
                rest,
                slope: DMatrix::zeros(0, 0),
            };
        }
        let coordinates = DVector::from_fn(kept, |k, _| found[k] / svd.singular_values[k]);
        let amounts = vt.rows(0, kept).transpose() * coordinates;
        let mut states = driven;
        for ((of_own, _), amount) in own.iter().zip(amounts.iter()) {
            states += of_own * *amount;
        }
        let mut slope = DMatrix::zeros(read.len(), theta.len());
        for i in 0..n {
            let mut filter = |column: usize, signal: DMatrix<f64>| {
                let mut drive = DMatrix::zeros(n, samples);
                drive.set_row(i, &signal.row(0));
                slope.set_column(column, &self.seen(&Self::run(&a, none.clone(), &drive)));
            };
            for j in 0..n {
                filter(i * n + j, states.rows(j, 1).into_owned());
            }
            for j in 0..m {
                filter(n * n + i * m + j, window.u.columns(j, 1).transpose());
            }
        }
        let slope = &slope - span * (span.transpose() * &slope);
        Explained { rest, slope }
    }

    /// Sum of squares of what is left, in units of the deviations.
    fn rests(&self, windows: &[Window], theta: &DVector<f64>) -> f64 {
        let rest = |window| self.explain(window, theta, false).rest.norm_squared();
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
            let found = self.explain(window, theta, true);
            normal += found.slope.transpose() * &found.slope;
            right += found.slope.transpose() * &found.rest;
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

    /// Standard deviation of what is left of each sensor (p), output units.
    fn unexplained(&self, windows: &[Window], theta: &DVector<f64>) -> DVector<f64> {
        let p = self.mode.c.nrows();
        let mut sums = DVector::<f64>::zeros(p);
        let mut free = 0.0;
        for window in windows {
            let rest = self.explain(window, theta, false).rest;
            let rest = DMatrix::from_column_slice(p, window.y.nrows(), rest.as_slice());
            for (sum, (row, deviation)) in sums
                .iter_mut()
                .zip(rest.row_iter().zip(self.deviation.iter()))
            {
                *sum += row.norm_squared() * deviation * deviation;
            }
            let own = self.mode.a.nrows() + window.waves.ncols() * self.mode.e.ncols();
            free += window.y.nrows() as f64 - own as f64 / p as f64;
        }
        sums.map(|sum| (sum / free).sqrt().max(f64::MIN_POSITIVE.sqrt()))
    }

    /// 100 (1 - |y - fitted| / |y - mean|) of each output over the windows.
    fn percent(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<f64> {
        let p = self.mode.c.nrows();
        let mut sums = vec![[0.0; 2]; p];
        for window in windows {
            let rest = self.explain(window, theta, false).rest;
            let rest = DMatrix::from_column_slice(p, window.y.nrows(), rest.as_slice());
            for (q, [left, all]) in sums.iter_mut().enumerate() {
                let read = window.y.column(q);
                *left += (rest.row(q) * self.deviation[q]).norm_squared();
                *all += read.add_scalar(-read.mean()).norm_squared();
            }
        }
        let percent =
            |[left, all]: [f64; 2]| 100.0 * (1.0 - (left / all.max(f64::MIN_POSITIVE)).sqrt());
        sums.into_iter().map(percent).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commissioning::commission;
    use ftc_plant::OperatingPoint;

    fn mode() -> Mode {
        Mode {
            name: "one".into(),
            a: DMatrix::from_row_slice(2, 2, &[0.8, 0.1, -0.2, 0.6]),
            b: DMatrix::from_row_slice(2, 1, &[0.5, 0.3]),
            c: DMatrix::from_row_slice(1, 2, &[1.0, 0.5]),
            e: DMatrix::from_row_slice(2, 1, &[0.2, 0.1]),
            f: DMatrix::zeros(1, 1),
            operating_point: OperatingPoint::zero(2, 1, 1),
        }
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
        let dense = crate::matrices::dense;
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
        let a = crate::matrices::dense(&found.mode.a);
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
