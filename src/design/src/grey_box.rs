//! The modes' matrices fitted to logs of healthy operation: a grey box, started at the design model and held by it.
//!
//! A log is cut into windows. In each of them the state at its start, the disturbance's waves and a constant
//! level of each of its channels are whatever explains the readings best; the matrices, which all windows share,
//! make the readings of the windows least wrong together (output error), with a penalty on how far they differ from the
//! design model, entry by entry, relative to the error that the model may have. Gauss-Newton with the windows'
//! own unknowns projected out.
//!
//! All modes are fitted together: a window may contain switches, across which the state carries on, and a row of `C`
//! that is the same in several modes stays the same. This is what keeps the modes' states in common coordinates. `E` and `F` are
//! fitted where the disturbance's period is known; else nothing tells their part from the level's.

use crate::augmented::scaled;
use crate::commissioning::{Database, RecordedDisturbance, commission};
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

/// Error of an entry that is none in the model, relative to that of the largest entry of its row, or of its column
/// where that is what a disturbance does.
const OF_LARGEST: f64 = 0.1;

/// The inputs of a log act a sample later than their rows say where this leaves less than this share of the
/// variance that is left otherwise, by the model as by what is fitted.
const LATE: f64 = 0.5;

/// The model error that is left, at least: what no log shows, such as a plant that ages.
const LEAST_ERROR: f64 = 0.01;

/// Windows of the usual movement in each mode.
const USUAL: usize = 4;

/// Error of what is taken for known, relative to what it could be.
const KNOWN: f64 = 1e-6;

/// What a log says of a mode.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The matrices, and how well they explain the windows held back.
    pub(crate) mode: FittedMode,
    /// Standard deviation of what they leave unexplained (p), output units.
    pub(crate) deviation: Vec<f64>,
    /// The part of it that is white: the sensors' noise (p), output units.
    pub(crate) noise: Vec<f64>,
    /// Relative error of the matrices that is left.
    pub(crate) model_error: f64,
}

/// Samples without a gap: what drove the plant and what was read.
#[derive(Clone)]
struct Window {
    /// The mode of each sample (0-based).
    modes: Vec<usize>,
    /// Inputs about the mode's operating point (m x samples).
    u: DMatrix<f64>,
    /// Outputs about the mode's operating point (p x samples).
    y: DMatrix<f64>,
    /// The disturbance's level and waves (samples x waves), the same for each channel.
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
    /// The disturbance that does (s x samples).
    disturbance: DMatrix<f64>,
}

/// The matrices of a mode.
#[derive(Clone)]
struct Matrices {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    e: DMatrix<f64>,
    c: DMatrix<f64>,
    f: DMatrix<f64>,
}

impl Matrices {
    fn of(mode: &Mode) -> Self {
        Self {
            a: mode.a.clone(),
            b: mode.b.clone(),
            e: mode.e.clone(),
            c: mode.c.clone(),
            f: mode.f.clone(),
        }
    }

    fn all(&self) -> [&DMatrix<f64>; 5] {
        [&self.a, &self.b, &self.e, &self.c, &self.f]
    }

    fn all_mut(&mut self) -> [&mut DMatrix<f64>; 5] {
        [
            &mut self.a,
            &mut self.b,
            &mut self.e,
            &mut self.c,
            &mut self.f,
        ]
    }
}

/// Where an entry of a mode's matrices stands.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    /// Which of `A`, `B`, `E`, `C`, `F`.
    matrix: usize,
    row: usize,
    column: usize,
}

/// The matrix in [`Entry::matrix`] that maps states to outputs, and those that a disturbance acts through.
const OUTPUT: usize = 3;
const OF_DISTURBANCE: [usize; 2] = [2, 4];

/// A number that is fitted.
struct Parameter {
    entry: Entry,
    /// The modes that share it.
    modes: Vec<usize>,
    /// In the design model.
    design: f64,
    /// Standard deviation about it.
    prior: f64,
}

/// The modes, and what is asked of the fit.
struct GreyBox<'a> {
    modes: &'a [Mode],
    parameters: Vec<Parameter>,
    /// The model's values of the parameters.
    design: DVector<f64>,
    prior: DVector<f64>,
    /// Standard deviation of each sensor (p) in each mode.
    deviation: Vec<DVector<f64>>,
    /// The usual movement: inputs that jump at random between nominal values.
    usual: Vec<Window>,
}

/// Why a log says nothing of a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// It has too few samples.
    Short,
    /// Its inputs act one sample after the row that they stand in.
    Late,
}

/// Fits the matrices of `modes`, whose entries are known to the relative error `model_error`, to their `stretches` of
/// logs, in which a disturbance was at work.
///
/// # Errors
/// The mode (0-based) of which the logs say nothing.
pub(crate) fn fit(
    modes: &[Mode],
    stretches: &[Vec<Database>],
    disturbance: Option<RecordedDisturbance>,
    model_error: f64,
    scaling: &Scaling,
) -> Result<Vec<Fit>, (usize, Unusable)> {
    let length = least_samples(&modes[0], disturbance);
    let records = records(stretches, disturbance);
    let windows: Vec<Window> = records
        .iter()
        .flat_map(|record| cut(record, length))
        .collect();
    let short = |mode: &usize| samples_of(&windows, *mode) < HELD_BACK * length;
    if let Some(mode) = (0..modes.len()).find(short) {
        return Err((mode, Unusable::Short));
    }
    let (learn, held_back) = split(windows, modes.len());
    let parameters = parameters(modes, disturbance.is_some(), model_error, scaling);
    let mut grey = GreyBox {
        modes,
        design: DVector::from_iterator(parameters.len(), parameters.iter().map(|of| of.design)),
        prior: DVector::from_iterator(parameters.len(), parameters.iter().map(|of| of.prior)),
        parameters,
        deviation: vec![DVector::from_element(modes[0].c.nrows(), 1.0); modes.len()],
        usual: usual(modes, length, disturbance, scaling),
    };
    let model = grey.design.clone();
    let (theta, left) = grey.choose(&learn, model_error);
    let late: Vec<Record> = records.iter().map(a_sample_later).collect();
    let late: Vec<Window> = late.iter().flat_map(|record| cut(record, length)).collect();
    if let Some(mode) = grey.late(&learn, &late, &theta, model_error) {
        return Err((mode, Unusable::Late));
    }
    // What was held back decides: a log that the model explains better is not used.
    grey.deviation = grey.unexplained(&held_back, &model);
    let [of_fit, of_model] = [&theta, &model].map(|theta| grey.rests(&held_back, theta));
    let (theta, left) = match of_fit < of_model {
        true => (theta, left),
        // What was learned is no better by no more than its own uncertainty: the log confirms the model.
        false if of_fit - of_model < theta.len() as f64 => (model.clone(), left),
        false => (model.clone(), model_error),
    };
    let unexplained = grey.unexplained(&held_back, &theta);
    let percents = [&theta, &model].map(|theta| grey.percent(&held_back, theta));
    let [of_fit, of_model] = percents;
    let fitted = grey.matrices(&theta).into_iter();
    let noise = grey.noise(&learn, &theta);
    let deviations = unexplained.into_iter().zip(noise);
    let each = fitted.zip(of_fit).zip(of_model).zip(deviations);
    Ok(each
        .map(|(((found, fit), fit_of_model), (deviation, noise))| {
            let [a, b, e, c, f] = found.all().map(plain);
            Fit {
                mode: FittedMode::new([a, b, c, e, f], fit, fit_of_model),
                noise: noise.inf(&deviation).as_slice().to_vec(),
                deviation: deviation.as_slice().to_vec(),
                model_error: left.max(LEAST_ERROR.min(model_error)),
            }
        })
        .collect())
}

/// What is fitted: every entry of `A`, `B` and `C`, those of `E` and `F` where the `disturbance` is known.
fn parameters(
    modes: &[Mode],
    disturbance: bool,
    model_error: f64,
    scaling: &Scaling,
) -> Vec<Parameter> {
    let mut parameters: Vec<Parameter> = Vec::new();
    for (index, mode) in modes.iter().enumerate() {
        let matrices = Matrices::of(mode);
        let sizes = sizes(&matrices, scaling);
        for (matrix, (values, sizes)) in matrices.all().into_iter().zip(&sizes).enumerate() {
            if OF_DISTURBANCE.contains(&matrix) && !disturbance {
                continue;
            }
            for row in 0..values.nrows() {
                let same = |of: &Mode| matrix == OUTPUT && of.c.row(row) == mode.c.row(row);
                let first = modes[..index].iter().position(same);
                for column in 0..values.ncols() {
                    let entry = Entry {
                        matrix,
                        row,
                        column,
                    };
                    let shared = first.and_then(|first| {
                        let mut known = parameters.iter_mut();
                        known.find(|of| of.entry == entry && of.modes.contains(&first))
                    });
                    let size = sizes[(row, column)];
                    match shared {
                        Some(parameter) => parameter.modes.push(index),
                        None if size > 0.0 => parameters.push(Parameter {
                            entry,
                            modes: vec![index],
                            design: values[(row, column)],
                            prior: model_error * size,
                        }),
                        None => {}
                    }
                }
            }
        }
    }
    parameters
}

/// The size that the error of each entry of `A`, `B`, `E`, `C`, `F` is relative to.
fn sizes(mode: &Matrices, scaling: &Scaling) -> [DMatrix<f64>; 5] {
    let (x, u, y) = (&scaling.states, &scaling.inputs, &scaling.outputs);
    let w = vec![1.0; mode.e.ncols()];
    let [a, b, c] = [(&mode.a, x, x), (&mode.b, x, u), (&mode.c, y, x)]
        .map(|(matrix, to, from)| scaled(matrix, to, from));
    let size =
        |matrix: &DMatrix<f64>, to: &[f64], from: &[f64], largest: &dyn Fn(usize, usize) -> f64| {
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
                matrix[(i, j)]
                    .abs()
                    .max(OF_LARGEST * largest(i, j) * to[i] / from[j])
            })
        };
    let motion = |i: usize, _: usize| {
        a.row(i)
            .amax()
            .max(b.row(i).amax())
            .max(f64::MIN_POSITIVE.sqrt())
    };
    let output = |i: usize, _: usize| c.row(i).amax();
    let [e, f] = [(&mode.e, x), (&mode.f, y)].map(|(matrix, to)| scaled(matrix, to, &w));
    [
        size(&mode.a, x, x, &motion),
        size(&mode.b, x, u, &motion),
        size(&mode.e, x, &w, &|_, j| e.column(j).amax()),
        size(&mode.c, y, x, &output),
        size(&mode.f, y, &w, &|_, j| f.column(j).amax()),
    ]
}

/// Samples in a window.
pub(crate) fn least_samples(mode: &Mode, disturbance: Option<RecordedDisturbance>) -> usize {
    let count = disturbance.map_or(0, |known| known.count);
    let own = mode.a.nrows() + (1 + 2 * count) * mode.e.ncols();
    WINDOW.max(SAMPLES_PER_UNKNOWN * own / mode.c.nrows())
}

/// A log from one gap to the next.
type Record = Window;

/// Stretches that follow each other without a gap, in whatever mode, joined.
fn records(stretches: &[Vec<Database>], disturbance: Option<RecordedDisturbance>) -> Vec<Record> {
    let count = disturbance.map_or(0, |known| known.count);
    // The level first, then the waves.
    let wave = |k: usize, column: usize| match (disturbance, column.checked_sub(1)) {
        (Some(known), Some(column)) => known.wave(k, column),
        _ => 1.0,
    };
    let of = |(mode, stretches): (usize, &'_ Vec<Database>)| {
        let each = stretches.iter().map(move |stretch| (mode, stretch.clone()));
        each.collect::<Vec<_>>()
    };
    let mut all: Vec<(usize, Database)> = stretches.iter().enumerate().flat_map(of).collect();
    let mut joined = Vec::new();
    while !all.is_empty() {
        let (mode, stretch) = all.remove(0);
        let mut parts = vec![(mode, stretch)];
        while let Some((_, last)) = parts.last() {
            let end = last.first + last.samples();
            let next = all
                .iter()
                .position(|(_, next)| next.first == end && end > 0);
            match next {
                Some(at) => parts.push(all.remove(at)),
                None => break,
            }
        }
        joined.push(parts);
    }
    let join = |parts: Vec<(usize, Database)>| {
        let first = parts[0].1.first;
        let modes: Vec<usize> = parts
            .iter()
            .flat_map(|(mode, part)| vec![*mode; part.samples()])
            .collect();
        let columns = |pick: fn(&Database) -> &DMatrix<f64>| {
            let all = parts.iter().flat_map(|(_, part)| pick(part).row_iter());
            DMatrix::from_columns(&all.map(|row| row.transpose()).collect::<Vec<_>>())
        };
        let waves = DMatrix::from_fn(modes.len(), 1 + 2 * count, |k, column| {
            wave(first + k, column)
        });
        Record {
            u: columns(|part| &part.inputs),
            y: columns(|part| &part.outputs),
            waves,
            modes,
        }
    };
    joined.into_iter().map(join).collect()
}

/// What the model does under inputs that jump at random between their nominal values, in each mode.
fn usual(
    modes: &[Mode],
    length: usize,
    disturbance: Option<RecordedDisturbance>,
    scaling: &Scaling,
) -> Vec<Window> {
    let still = vec![0.0; scaling.outputs.len()];
    let run = |(seed, mode): (usize, &Mode)| {
        let samples = USUAL * length;
        vec![commission(
            mode,
            &scaling.inputs,
            &still,
            samples,
            seed as u64,
        )]
    };
    let stretches: Vec<_> = modes.iter().enumerate().map(run).collect();
    let records = records(&stretches, disturbance);
    records
        .iter()
        .flat_map(|record| cut(record, length))
        .collect()
}

/// The same if each input acted one sample after its row.
fn a_sample_later(record: &Record) -> Record {
    let samples = record.modes.len().saturating_sub(1);
    let from = record.modes.len() - samples;
    Record {
        modes: record.modes[from..].to_vec(),
        u: record.u.columns(0, samples).into_owned(),
        y: record.y.columns(from, samples).into_owned(),
        waves: record.waves.rows(from, samples).into_owned(),
    }
}

/// Windows of so many samples, one after the other.
fn cut(record: &Record, length: usize) -> Vec<Window> {
    let starts = (0..record.modes.len() / length).map(|at| at * length);
    let window = |from: usize| Window {
        modes: record.modes[from..from + length].to_vec(),
        u: record.u.columns(from, length).into_owned(),
        y: record.y.columns(from, length).into_owned(),
        waves: record.waves.rows(from, length).into_owned(),
    };
    starts.map(window).collect()
}

fn samples_of(windows: &[Window], mode: usize) -> usize {
    let count = |window: &Window| window.modes.iter().filter(|&&of| of == mode).count();
    windows.iter().map(count).sum()
}

/// Windows to learn from, and windows to judge by: a share of what each mode has.
fn split(windows: Vec<Window>, modes: usize) -> (Vec<Window>, Vec<Window>) {
    let (mut learn, mut held_back) = (Vec::new(), Vec::new());
    for window in windows {
        let due = |mode: usize| {
            let own = samples_of(std::slice::from_ref(&window), mode);
            let held = samples_of(&held_back, mode) + own;
            own > 0 && HELD_BACK * held <= samples_of(&learn, mode) + held
        };
        match (0..modes).any(due) {
            true => held_back.push(window),
            false => learn.push(window),
        }
    }
    (learn, held_back)
}

impl GreyBox<'_> {
    /// The parameters that explain the windows best, and the relative error of the model that is left. The maps to the outputs and those of
    /// the disturbance are the design's unless the windows say otherwise: what is as probable without a
    /// change of theirs is not changed.
    fn choose(&mut self, windows: &[Window], model_error: f64) -> (DVector<f64>, f64) {
        let prior = self.prior.clone();
        let groups: [&[usize]; 2] = [&[OUTPUT], &OF_DISTURBANCE];
        let mut fixed: Vec<usize> = groups.concat();
        self.prior = self.held(&prior, &fixed);
        let (mut theta, mut left) = self.improve(windows, model_error);
        for group in groups {
            let (before, known) = (fixed.clone(), self.prior.clone());
            fixed.retain(|matrix| !group.contains(matrix));
            self.prior = self.held(&prior, &fixed);
            let (freed, of_freed) = self.improve(windows, model_error);
            let with = self.evidence(windows, &freed);
            self.prior = known;
            if with > self.evidence(windows, &theta) {
                (theta, left) = (freed, of_freed);
                self.prior = self.held(&prior, &fixed);
            } else {
                fixed = before;
            }
        }
        for (at, of) in self.parameters.iter().enumerate() {
            if fixed.contains(&of.entry.matrix) {
                theta[at] = of.design;
            }
        }
        (theta, left)
    }

    /// The `prior` if the `fixed` matrices are known.
    fn held(&self, prior: &DVector<f64>, fixed: &[usize]) -> DVector<f64> {
        let each = self.parameters.iter().zip(prior.iter());
        let each = each.map(|(of, prior)| match fixed.contains(&of.entry.matrix) {
            true => KNOWN * prior,
            false => *prior,
        });
        DVector::from_iterator(prior.len(), each)
    }

    /// Logarithm of the probability of the windows, up to a constant (Laplace).
    fn evidence(&self, windows: &[Window], theta: &DVector<f64>) -> f64 {
        let Some((normal, _)) = self.step(windows, theta) else {
            return f64::NEG_INFINITY;
        };
        let scaled = DMatrix::from_fn(theta.len(), theta.len(), |i, j| {
            self.prior[i] * normal[(i, j)] * self.prior[j] + f64::from(u8::from(i == j))
        });
        let Some(factor) = scaled.cholesky() else {
            return f64::NEG_INFINITY;
        };
        let volume: f64 = factor.l().diagonal().iter().map(|value| value.ln()).sum();
        -0.5 * self.cost(windows, theta) - volume
    }

    /// The parameters that explain the windows best, and the relative error of the model that is left.
    fn improve(&mut self, windows: &[Window], model_error: f64) -> (DVector<f64>, f64) {
        let (mut theta, mut left) = (self.design.clone(), model_error);
        for _ in 0..ITERATIONS {
            self.deviation = self.unexplained(windows, &theta);
            let Some((normal, step)) = self.step(windows, &theta) else {
                break;
            };
            let before = self.cost(windows, &theta);
            let mut tried = (0..6).map(|halvings| {
                let next = &theta + 0.5_f64.powi(halvings) * &step;
                (self.cost(windows, &next), next)
            });
            let Some((cost, better)) = tried.find(|(cost, _)| *cost <= before) else {
                break;
            };
            theta = better;
            left = model_error * self.left(&normal, &theta).unwrap_or(1.0).sqrt();
            if before - cost <= CONVERGED * before {
                break;
            }
        }
        (theta, left)
    }

    /// The mode in which the inputs act a sample later than their rows say: neither the model nor what is fitted
    /// explains the `windows` nearly as well as the same does those where they do (`late`).
    fn late(
        &mut self,
        windows: &[Window],
        late: &[Window],
        theta: &DVector<f64>,
        model_error: f64,
    ) -> Option<usize> {
        let suspect = |grey: &Self, [one, other]: [&DVector<f64>; 2]| {
            let found = grey.unexplained(windows, one);
            let later = grey.unexplained(late, other);
            let mut modes = found.iter().zip(&later);
            modes.position(|(found, later)| {
                let ratio = later.component_div(found);
                ratio.norm_squared() < LATE * ratio.len() as f64
            })
        };
        let model = self.design.clone();
        suspect(self, [&model, &model])?;
        let (of_late, _) = self.improve(late, model_error);
        suspect(self, [theta, &of_late])
    }

    /// The modes' matrices.
    fn matrices(&self, theta: &DVector<f64>) -> Vec<Matrices> {
        let mut modes: Vec<_> = self.modes.iter().map(Matrices::of).collect();
        for (of, &value) in self.parameters.iter().zip(theta.iter()) {
            for &mode in &of.modes {
                let Entry {
                    matrix,
                    row,
                    column,
                } = of.entry;
                modes[mode].all_mut()[matrix][(row, column)] = value;
            }
        }
        modes
    }

    /// States (n x samples) from `x` on under the `drive` (n x samples).
    fn run(
        modes: &[Matrices],
        window: &Window,
        x: DVector<f64>,
        drive: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut states = DMatrix::zeros(x.len(), drive.ncols());
        let mut x = x;
        for (k, &mode) in window.modes.iter().enumerate() {
            states.set_column(k, &x);
            x = &modes[mode].a * x + drive.column(k);
        }
        states
    }

    /// What the inputs do to the states (n x samples), and that the operating point changes with the mode.
    fn input_drive(&self, modes: &[Matrices], window: &Window) -> DMatrix<f64> {
        let mut drive = DMatrix::zeros(modes[0].a.nrows(), window.modes.len());
        for (k, &mode) in window.modes.iter().enumerate() {
            let mut next = &modes[mode].b * window.u.column(k);
            let after = window.modes.get(k + 1).copied().unwrap_or(mode);
            if after != mode {
                let points = [mode, after].map(|mode| &self.modes[mode].operating_point.x);
                for (i, value) in next.iter_mut().enumerate() {
                    *value += points[0][i] - points[1][i];
                }
            }
            drive.set_column(k, &next);
        }
        drive
    }

    /// Outputs in units of the deviations, one sample below the other: of each sample its mode and its outputs.
    fn weighed(
        &self,
        window: &Window,
        outputs: impl Fn(usize, usize) -> DVector<f64>,
    ) -> DVector<f64> {
        let p = self.deviation[0].len();
        let mut all = DVector::zeros(p * window.modes.len());
        for (k, &mode) in window.modes.iter().enumerate() {
            let weighed = outputs(k, mode).component_div(&self.deviation[mode]);
            all.rows_mut(k * p, p).copy_from(&weighed);
        }
        all
    }

    /// What each of the window's own unknowns does: states (n x samples), and outputs in units of the deviations.
    fn own(&self, modes: &[Matrices], window: &Window) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        let (n, samples) = (modes[0].a.nrows(), window.modes.len());
        let still = DMatrix::zeros(n, samples);
        let starts = (0..n).map(|i| {
            let start = DVector::from_fn(n, |row, _| f64::from(row == i));
            let states = Self::run(modes, window, start, &still);
            let outputs = self.weighed(window, |k, mode| &modes[mode].c * states.column(k));
            (states, outputs)
        });
        let waves = (0..modes[0].e.ncols()).flat_map(|channel| {
            window.waves.column_iter().map(move |wave| {
                let mut drive = DMatrix::zeros(n, samples);
                for (k, &mode) in window.modes.iter().enumerate() {
                    drive.set_column(k, &(modes[mode].e.column(channel) * wave[k]));
                }
                let states = Self::run(modes, window, DVector::zeros(n), &drive);
                let outputs = self.weighed(window, |k, mode| {
                    &modes[mode].c * states.column(k) + modes[mode].f.column(channel) * wave[k]
                });
                (states, outputs)
            })
        });
        starts.chain(waves).collect()
    }

    /// What explains the readings of `window` best, and what it leaves.
    fn explain(&self, window: &Window, modes: &[Matrices]) -> Explained {
        let (n, s) = modes[0].e.shape();
        let drive = self.input_drive(modes, window);
        let mut states = Self::run(modes, window, DVector::zeros(n), &drive);
        let read = self.weighed(window, |k, mode| {
            window.y.column(k) - &modes[mode].c * states.column(k)
        });
        let own = self.own(modes, window);
        let columns: Vec<_> = own.iter().map(|(_, outputs)| outputs.clone()).collect();
        let free = DMatrix::from_columns(&columns);
        let mut disturbance = DMatrix::zeros(s, window.modes.len());
        let lost = Explained {
            rest: DVector::from_element(read.len(), f64::INFINITY),
            span: DMatrix::zeros(read.len(), 0),
            states: states.clone(),
            disturbance: disturbance.clone(),
        };
        if !free
            .iter()
            .chain(read.iter())
            .all(|value| value.is_finite())
        {
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
        let waves = window.waves.ncols();
        for channel in 0..s {
            let amounts = amounts.rows(n + channel * waves, waves);
            let course = &window.waves * amounts;
            disturbance.set_row(channel, &course.transpose());
        }
        Explained {
            rest,
            span,
            states,
            disturbance,
        }
    }

    /// How the rest of `window` falls with each parameter, without what the window's own unknowns can do
    /// (samples p x parameters).
    fn slope(&self, window: &Window, modes: &[Matrices], found: &Explained) -> DMatrix<f64> {
        let (n, samples) = (modes[0].a.nrows(), window.modes.len());
        let p = self.deviation[0].len();
        let mut slope = DMatrix::zeros(found.rest.len(), self.parameters.len());
        for (at, of) in self.parameters.iter().enumerate() {
            let mine = |mode: usize| f64::from(u8::from(of.modes.contains(&mode)));
            if !window.modes.iter().any(|mode| of.modes.contains(mode)) {
                continue;
            }
            let Entry {
                matrix,
                row,
                column,
            } = of.entry;
            let factor = match matrix {
                0 | OUTPUT => found.states.row(column),
                1 => window.u.row(column),
                _ => found.disturbance.row(column),
            };
            let signal = |k: usize, mode: usize| mine(mode) * factor[k];
            let effect = if matrix < OUTPUT {
                let mut drive = DMatrix::zeros(n, samples);
                for (k, &mode) in window.modes.iter().enumerate() {
                    drive[(row, k)] = signal(k, mode);
                }
                let states = Self::run(modes, window, DVector::zeros(n), &drive);
                self.weighed(window, |k, mode| &modes[mode].c * states.column(k))
            } else {
                self.weighed(window, |k, mode| {
                    DVector::from_fn(p, |q, _| if q == row { signal(k, mode) } else { 0.0 })
                })
            };
            slope.set_column(at, &effect);
        }
        &slope - &found.span * found.span.tr_mul(&slope)
    }

    /// Sum of squares of what is left, in units of the deviations.
    fn rests(&self, windows: &[Window], theta: &DVector<f64>) -> f64 {
        let modes = self.matrices(theta);
        let rest = |window| self.explain(window, &modes).rest.norm_squared();
        windows.iter().map(rest).sum()
    }

    fn cost(&self, windows: &[Window], theta: &DVector<f64>) -> f64 {
        let moved = (theta - &self.design).component_div(&self.prior);
        self.rests(windows, theta) + moved.norm_squared()
    }

    /// The data's normal matrix, and the step of Gauss and Newton.
    fn step(
        &self,
        windows: &[Window],
        theta: &DVector<f64>,
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let count = theta.len();
        let modes = self.matrices(theta);
        let mut normal = DMatrix::zeros(count, count);
        let mut right = DVector::zeros(count);
        for window in windows {
            let found = self.explain(window, &modes);
            let slope = self.slope(window, &modes, &found);
            normal += slope.tr_mul(&slope);
            right += slope.tr_mul(&found.rest);
        }
        let weight = self.prior.map(|size| (size * size).recip());
        right -= weight.component_mul(&(theta - &self.design));
        let whole = &normal + DMatrix::from_diagonal(&weight);
        let step = whole.cholesky()?.solve(&right);
        Some((normal, step))
    }

    /// Share of the variance that the error of the model has in readings of the usual movement and that is left
    /// after windows with the `normal` matrix: what the log hardly moved is as uncertain as before.
    fn left(&self, normal: &DMatrix<f64>, theta: &DVector<f64>) -> Option<f64> {
        let prior = self.prior.map(|size| size * size);
        let (usual, _) = self.step(&self.usual, theta)?;
        let before = usual.diagonal().dot(&prior);
        let whole = normal + DMatrix::from_diagonal(&prior.map(f64::recip));
        let after = whole.cholesky()?.solve(&usual).trace();
        (before > 0.0).then(|| (after / before).min(1.0))
    }

    /// Sum of squares of what is left of each output (p) in each mode, output units.
    fn squares(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len();
        let modes = self.matrices(theta);
        let mut sums = vec![DVector::zeros(p); modes.len()];
        for window in windows {
            let rest = self.explain(window, &modes).rest;
            for (&mode, rest) in window.modes.iter().zip(rest.as_slice().chunks_exact(p)) {
                for (q, value) in rest.iter().enumerate() {
                    sums[mode][q] += (value * self.deviation[mode][q]).powi(2);
                }
            }
        }
        sums
    }

    /// Standard deviation of what is left of each sensor (p) in each mode, output units.
    fn unexplained(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len() as f64;
        let s = self.modes[0].e.ncols();
        let n = self.modes[0].a.nrows();
        let free = |window: &Window| {
            let own = n + window.waves.ncols() * s;
            1.0 - own as f64 / (p * window.modes.len() as f64)
        };
        let squares = self.squares(windows, theta);
        let each = squares.into_iter().enumerate().map(|(mode, squares)| {
            let own = |window: &Window| {
                free(window) * samples_of(std::slice::from_ref(window), mode) as f64
            };
            let free: f64 = windows.iter().map(own).sum();
            squares.map(|sum| (sum / free).sqrt().max(f64::MIN_POSITIVE.sqrt()))
        });
        each.collect()
    }

    /// Standard deviation of each sensor's noise (p) in each mode: what is left moves slowly but for it, so that it is what one
    /// sample differs from the next by.
    fn noise(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<DVector<f64>> {
        let p = self.deviation[0].len();
        let modes = self.matrices(theta);
        let mut sums = vec![(DVector::<f64>::zeros(p), 0.0_f64); modes.len()];
        for window in windows {
            let rest = self.explain(window, &modes).rest;
            let rests: Vec<&[f64]> = rest.as_slice().chunks_exact(p).collect();
            for (pair, mode) in rests.windows(2).zip(window.modes.windows(2)) {
                let [one, next] = [mode[0], mode[1]];
                if one == next {
                    let steps = pair[0]
                        .iter()
                        .zip(pair[1])
                        .map(|(before, after)| after - before);
                    let steps =
                        DVector::from_iterator(p, steps).component_mul(&self.deviation[one]);
                    sums[one].0 += steps.component_mul(&steps);
                    sums[one].1 += 2.0;
                }
            }
        }
        let each = sums.into_iter();
        each.map(|(sum, count)| sum.map(|sum| (sum / count.max(1.0)).sqrt()))
            .collect()
    }

    /// 100 (1 - |y - fitted| / |y - mean|) of each output in each mode over the windows.
    fn percent(&self, windows: &[Window], theta: &DVector<f64>) -> Vec<Vec<f64>> {
        let squares = self.squares(windows, theta);
        let each = squares.iter().enumerate().map(|(mode, left)| {
            let read = |q: usize| {
                let windows = windows.iter().flat_map(move |window| {
                    let of = window
                        .modes
                        .iter()
                        .zip(window.y.row(q).iter().copied().collect::<Vec<_>>());
                    of.filter(|(of, _)| **of == mode)
                        .map(|(_, y)| y)
                        .collect::<Vec<_>>()
                });
                DVector::from_vec(windows.collect::<Vec<_>>())
            };
            let outputs = left.iter().enumerate().map(|(q, left)| {
                let read = read(q);
                let all = read.add_scalar(-read.mean()).norm_squared();
                100.0 * (1.0 - (left / all.max(f64::MIN_POSITIVE)).sqrt())
            });
            outputs.collect()
        });
        each.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let gain = |a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>| {
            let still = DMatrix::identity(2, 2) - a;
            (c * still.lu().solve(b).unwrap())[(0, 0)]
        };
        let [a, b, c] = [&fitted.a, &fitted.b, &fitted.c].map(ftc_record::dense);
        let truth = gain(&plant.a, &plant.b, &plant.c);
        (gain(&a, &b, &c) - truth).abs() / (gain(&model.a, &model.b, &model.c) - truth).abs()
    }

    fn fit_one(
        mode: &Mode,
        log: Database,
        disturbance: Option<RecordedDisturbance>,
        model_error: f64,
    ) -> Result<Fit, Unusable> {
        let modes = std::slice::from_ref(mode);
        let found = fit(modes, &[vec![log]], disturbance, model_error, &scaling());
        found
            .map(|mut all| all.remove(0))
            .map_err(|(_, unusable)| unusable)
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
        let found = fit_one(&model, log, None, 0.1).unwrap();
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
        let found = fit_one(&model, log, Some(known), 0.1).unwrap();
        assert!(left(&found.mode, &plant, &model) < 0.1, "{found:?}");
    }

    /// Two modes with three sensors; inputs, a disturbance of known period and noise move them, with a switch every
    /// 150 samples.
    fn switching() -> [Mode; 2] {
        let c = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 1.0, 0.5, 0.5]);
        let mode = |a: [f64; 4], b: [f64; 2], e: [f64; 2]| {
            let [b, e] = [b, e].map(|column| DMatrix::from_row_slice(2, 1, &column));
            let f = DMatrix::zeros(3, 1);
            Mode::new(DMatrix::from_row_slice(2, 2, &a), b, c.clone()).with_disturbance(e, f)
        };
        let mut other = mode([0.5, -0.2, 0.3, 0.7], [0.4, -0.2], [0.3, 0.1]);
        other.operating_point.x = vec![0.4, -0.2];
        other.operating_point.y = vec![0.4, -0.2, 0.1];
        [mode([0.8, 0.1, -0.2, 0.6], [0.5, 0.3], [0.2, 0.3]), other]
    }

    fn switched_log(modes: &[Mode], seed: u64) -> Vec<Vec<Database>> {
        let mut x = DVector::<f64>::zeros(2);
        let mut stretches = vec![Vec::new(); modes.len()];
        let mut u = 0.5;
        for stretch in 0..14 {
            let mode = &modes[stretch % 2];
            let point = |values: &[f64]| DVector::from_column_slice(values);
            let (x0, y0) = (
                point(&mode.operating_point.x),
                point(&mode.operating_point.y),
            );
            let at = |k: usize| 150 * stretch + k;
            let (mut inputs, mut outputs) = (DMatrix::zeros(150, 1), DMatrix::zeros(150, 3));
            for k in 0..150 {
                let mut draws = [0.0; 4];
                ftc_plant::noise::standard_normal(seed, at(k) as u64, &mut draws);
                if draws[3] > 1.0 {
                    u = -u;
                }
                inputs[(k, 0)] = u;
                // The sensors' gains differ from 1 at the operating point, too.
                let y = &mode.c * &x - &y0 + 0.01 * DVector::from_column_slice(&draws[..3]);
                outputs.row_mut(k).tr_copy_from(&y);
                let w = (core::f64::consts::TAU * at(k) as f64 / 60.0 + seed as f64).sin();
                let input = DVector::from_element(1, u);
                let disturbance = DVector::from_element(1, w);
                x = &x0 + &mode.a * (&x - &x0) + &mode.b * input + &mode.e * disturbance;
            }
            stretches[stretch % 2].push(Database::new(at(0), inputs, outputs).unwrap());
        }
        stretches
    }

    /// What is left of a log by such matrices, over its noise.
    fn judged(modes: &[Mode], log: &[Vec<Database>], known: Option<RecordedDisturbance>) -> f64 {
        let records = records(log, known);
        let windows: Vec<Window> = records.iter().flat_map(|record| cut(record, 75)).collect();
        let grey = GreyBox {
            modes,
            parameters: Vec::new(),
            design: DVector::zeros(0),
            prior: DVector::zeros(0),
            deviation: vec![DVector::from_element(3, 0.01); 2],
            usual: Vec::new(),
        };
        let left = grey.unexplained(&windows, &DVector::zeros(0));
        let squares: f64 = left.iter().map(DVector::norm_squared).sum();
        (squares / 6.0).sqrt() / 0.01
    }

    fn as_fitted(mode: &Mode, fit: &Fit) -> Mode {
        let mut mode = mode.clone();
        let dense = ftc_record::dense;
        (mode.a, mode.b, mode.c) = (dense(&fit.mode.a), dense(&fit.mode.b), dense(&fit.mode.c));
        (mode.e, mode.f) = (dense(&fit.mode.e), dense(&fit.mode.f));
        mode
    }

    /// Gains of sensors and what the disturbance moves are found, in coordinates that the modes share: judged on a
    /// log that was not fitted, with switches within its windows.
    ///
    /// promise: fitted-model
    #[test]
    fn wrong_output_and_disturbance_matrices_are_corrected() {
        let plant = switching();
        let mut model = plant.clone();
        for mode in &mut model {
            mode.c[(0, 0)] *= 0.92;
            mode.c[(2, 1)] *= 1.1;
            mode.e[(0, 0)] *= 1.1;
            mode.e[(1, 0)] *= 0.9;
            mode.a[(0, 0)] *= 1.05;
        }
        let known = Some(RecordedDisturbance {
            period: 60.0,
            count: 1,
        });
        let scaling = Scaling {
            outputs: vec![1.0; 3],
            ..scaling()
        };
        let found = fit(&model, &switched_log(&plant, 1), known, 0.1, &scaling).unwrap();
        assert_eq!(found[0].mode.c, found[1].mode.c);
        let fitted: Vec<Mode> = model
            .iter()
            .zip(&found)
            .map(|(mode, fit)| as_fitted(mode, fit))
            .collect();
        let fresh = switched_log(&plant, 2);
        let [of_model, of_fit, of_plant] =
            [&model[..], &fitted, &plant].map(|modes| judged(modes, &fresh, known));
        println!("left over noise: model {of_model}, fitted {of_fit}, plant {of_plant}");
        assert!(of_model > 1.5 && of_fit < 1.05 && (of_plant - 1.0).abs() < 0.05);
        let mut only = fitted.clone();
        for (mode, model) in only.iter_mut().zip(&model) {
            mode.c.clone_from(&model.c);
        }
        assert!(judged(&only, &fresh, known) > 1.2);
        for fit in &found {
            assert!(
                fit.noise
                    .iter()
                    .all(|noise| (noise / 0.01 - 1.0).abs() < 0.15),
                "{:?}",
                fit.noise
            );
        }
    }

    /// A log that says the same as the model leaves it, and narrows its error.
    #[test]
    fn a_log_confirms_the_model() {
        let plant = switching();
        let scaling = Scaling {
            outputs: vec![1.0; 3],
            ..scaling()
        };
        let known = Some(RecordedDisturbance {
            period: 60.0,
            count: 1,
        });
        let log = switched_log(&plant, 3);
        for fit in fit(&plant, &log, known, 0.05, &scaling).unwrap() {
            assert!(fit.model_error < 0.025, "{fit:?}");
        }
    }

    #[test]
    fn a_log_that_moves_nothing_leaves_the_model() {
        let model = mode();
        let log = commission(&model, &[0.0], &[0.01], 400, 4);
        let found = fit_one(&model, log, None, 0.05).unwrap();
        let a = ftc_record::dense(&found.mode.a);
        assert!((&a - &model.a).amax() < 0.02, "{a}");
        assert!(found.model_error > 0.02, "{found:?}");
    }

    #[test]
    fn a_log_that_is_too_short_is_refused() {
        let log = commission(&mode(), &[1.0], &[0.01], 3 * WINDOW, 4);
        let found = fit_one(&mode(), log, None, 0.05);
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
        let found = fit_one(&mode(), early.unwrap(), None, 0.05);
        assert_eq!(found.unwrap_err(), Unusable::Late);
    }
}
