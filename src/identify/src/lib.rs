//! From logs of healthy operation to a linear model of each mode, in state coordinates that all
//! modes share.
//!
//! Each mode: predictor-based subspace identification (PBSID) with a constant term, which accepts
//! closed-loop data and several stretches. A vector autoregression gives the predictor's Markov
//! parameters, a singular value decomposition the states, least squares the matrices. The order is
//! the smallest whose free simulation fits validation data nearly as well as the best.
//!
//! Between modes: states are continuous at a switch, so that switches that were logged determine
//! the change of coordinates from one mode's model to another's ([`Coordinates::Switches`]). Where
//! too few were logged, states are taken as outputs that the free motion would give
//! ([`Coordinates::Outputs`]), which is exact where the outputs determine the state.
//!
//! ```
//! use ftc_identify::{Log, Settings, identify};
//! use nalgebra::DMatrix;
//!
//! // y(k+1) = 0.8 y(k) + 0.5 u(k), the input moving up and down.
//! let u = DMatrix::from_fn(200, 1, |k, _| if (k / 7) % 2 == 0 { 1.0 } else { -0.5 });
//! let mut y = DMatrix::zeros(200, 1);
//! for k in 0..199 {
//!     y[(k + 1, 0)] = 0.8 * y[(k, 0)] + 0.5 * u[(k, 0)];
//! }
//! let log = Log::new(u, y);
//! let found = identify(&[log], &Settings::default())?;
//! assert_eq!(found.order, 1);
//! assert!((found.modes[0].a[(0, 0)] - 0.8).abs() < 1e-9);
//! # Ok::<(), ftc_identify::Error>(())
//! ```

mod coordinates;
mod data;
mod fit;
mod least_squares;
mod subspace;

use nalgebra::{DMatrix, DVector};
use subspace::Model;

/// A log of healthy operation at a fixed sample time. Row `k` holds the inputs that act from sample
/// `k` on, and the outputs measured at it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Log {
    /// Inputs (samples x m), physical units.
    pub inputs: DMatrix<f64>,
    /// Outputs (samples x p), physical units.
    pub outputs: DMatrix<f64>,
    /// Active mode of each sample (0-based).
    pub modes: Vec<usize>,
}

impl Log {
    /// The log (samples x m, samples x p) of a plant with one mode.
    pub fn new(inputs: DMatrix<f64>, outputs: DMatrix<f64>) -> Self {
        let modes = vec![0; inputs.nrows()];
        Self {
            inputs,
            outputs,
            modes,
        }
    }

    /// The same log with the active mode of each sample (0-based).
    pub fn in_modes(self, modes: Vec<usize>) -> Self {
        Self { modes, ..self }
    }
}

/// What is asked for.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Settings {
    /// Number of states; chosen by the fit on validation data when absent.
    pub order: Option<usize>,
    /// The largest order that is tried.
    pub largest_order: usize,
    /// Periods, in samples, of a disturbance that is in the logs and that was not measured (with
    /// its harmonics): it is separated from the plant, and is no part of the model.
    pub periods: Vec<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            order: None,
            largest_order: 8,
            periods: Vec::new(),
        }
    }
}

impl Settings {
    /// These settings for logs that hold a disturbance of so many seconds with its harmonics, the
    /// fundamental among them.
    pub fn with_disturbance(self, period: f64, harmonics: u32, sample_time: f64) -> Self {
        let samples = |n| period / f64::from(n) / sample_time;
        let periods = (1..=harmonics).map(samples).collect();
        Self { periods, ..self }
    }
}

/// A linear mode: `x(k+1) - x0 = A (x(k) - x0) + B (u(k) - u0)`, `y(k) - y0 = C (x(k) - x0)`.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct IdentifiedMode {
    /// State matrix (n x n).
    pub a: DMatrix<f64>,
    /// Input matrix (n x m).
    pub b: DMatrix<f64>,
    /// Output matrix (p x n).
    pub c: DMatrix<f64>,
    /// State of the operating point `x0` (n), in the coordinates that all modes share.
    pub x0: DVector<f64>,
    /// Input of the operating point `u0` (m): the mean of the log.
    pub u0: DVector<f64>,
    /// Output of the operating point `y0` (p): the steady state at `u0`.
    pub y0: DVector<f64>,
    /// Fit of a free simulation to held-out data, in percent, per output (p):
    /// `100 (1 - |y - y_sim| / |y - mean(y)|)`.
    pub fit: Vec<f64>,
    /// Samples that were held out.
    pub held_out: usize,
    /// Samples the model was estimated from.
    pub samples: usize,
}

/// How the modes' states were made one state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new way must be reported: the compiler says where"
)]
pub enum Coordinates {
    /// There is one mode only.
    Single,
    /// By the switches that were logged; the state after a switch follows from the state before
    /// with this fit, in percent.
    Switches {
        /// The worst fit of all modes.
        fit: f64,
    },
    /// By the outputs: too few switches were logged. A state beyond the outputs may jump when the
    /// mode changes.
    Outputs,
}

/// What was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Identified {
    /// Number of states `n`.
    pub order: usize,
    /// Each order that was tried, and its mean fit on validation data, in percent.
    pub tried: Vec<(usize, f64)>,
    /// One model per mode.
    pub modes: Vec<IdentifiedMode>,
    /// How states of different modes belong together.
    pub coordinates: Coordinates,
}

/// Why nothing was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A log's parts do not fit each other.
    #[error("log {log} has {what}: give all logs the same signals, and every row a mode")]
    Sizes {
        /// Number of the log, from 1.
        log: usize,
        /// What is wrong.
        what: String,
    },
    /// A number is not finite.
    #[error("log {log}: row {row} holds a value that is no finite number: leave such rows out")]
    NotFinite {
        /// Number of the log, from 1.
        log: usize,
        /// Row, from 1.
        row: usize,
    },
    /// A mode has too few rows.
    #[error(
        "mode {mode}: of {needed} usable samples that are needed there are {samples}: record healthy operation for longer"
    )]
    TooShort {
        /// Mode, from 1.
        mode: usize,
        /// Samples there are.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// A period is none.
    #[error("a disturbance of period {0} samples cannot be told from others: give one above 2")]
    Period(f64),
    /// A signal never moves.
    #[error(
        "mode {mode}: {signal} {number} never changes: move every input, with sensors that work"
    )]
    Still {
        /// Mode, from 1.
        mode: usize,
        /// `input` or `output`.
        signal: &'static str,
        /// Number, from 1.
        number: usize,
    },
    /// A model without states.
    #[error("an order of 0 leaves no state: ask for at least 1")]
    NoState,
    /// No model of any order could be computed.
    #[error(
        "no model of order {order} explains the log: excite the inputs more, or ask for another order"
    )]
    NoModel {
        /// The order asked for, or the largest tried.
        order: usize,
    },
}

/// An order is as good as the best when its fit is lower by no more percentage points.
const SAME_FIT: f64 = 0.5;

/// Identifies one model per mode.
///
/// # Errors
/// [`Error`] where the logs hold too little.
pub fn identify(logs: &[Log], settings: &Settings) -> Result<Identified, Error> {
    if settings.order == Some(0) {
        return Err(Error::NoState);
    }
    let data = data::Data::prepare(logs, &settings.periods)?;
    let parts: Vec<data::Split> = data.modes.iter().map(data::ModeData::split).collect();
    let tried = try_orders(&data, &parts, settings);
    let best = tried.iter().map(|t| t.fit).fold(f64::MIN, f64::max);
    let chosen = tried
        .iter()
        .find(|candidate| candidate.fit >= best - SAME_FIT)
        .filter(|candidate| candidate.fit.is_finite())
        .ok_or(Error::NoModel {
            order: settings.order.unwrap_or(settings.largest_order),
        })?;
    let models: Option<Vec<Model>> = parts
        .iter()
        .map(|part| {
            subspace::estimate(&part.estimation_and_validation(), chosen.past, chosen.order)
        })
        .collect();
    let models = models.ok_or(Error::NoModel {
        order: chosen.order,
    })?;
    let (shared, coordinates) = coordinates::shared(&data, models);
    let modes = shared
        .into_iter()
        .zip(&data.modes)
        .zip(&parts)
        .map(|((model, mode), part)| physical(&data, mode, part, model))
        .collect();
    Ok(Identified {
        order: chosen.order,
        tried: tried.iter().map(|t| (t.order, t.fit)).collect(),
        modes,
        coordinates,
    })
}

/// An order, the past window that suits it best, and the fit of both.
struct Tried {
    order: usize,
    past: usize,
    fit: f64,
}

/// Past windows that are tried (samples).
const PASTS: [usize; 4] = [3, 6, 12, 24];

fn try_orders(data: &data::Data, parts: &[data::Split], settings: &Settings) -> Vec<Tried> {
    let orders = match settings.order {
        Some(order) => order..=order,
        None => 1..=settings.largest_order.max(1),
    };
    let outputs = data.outputs();
    orders
        .filter_map(|order| {
            let of = |past: usize| {
                let fits: Option<Vec<f64>> = parts
                    .iter()
                    .map(|part| {
                        let model = subspace::estimate(&part.estimation, past, order)?;
                        let fits = fit::percent(&model, &part.validation);
                        Some(fits.iter().sum::<f64>() / fits.len() as f64)
                    })
                    .collect();
                let fits = fits?;
                let fit = fits.iter().sum::<f64>() / fits.len() as f64;
                fit.is_finite().then_some(Tried { order, past, fit })
            };
            PASTS
                .iter()
                .filter(|&&past| past * outputs >= order)
                .filter_map(|&past| of(past))
                .max_by(|one, other| one.fit.total_cmp(&other.fit))
        })
        .collect()
}

/// A model in physical units, with its fit.
fn physical(
    data: &data::Data,
    mode: &data::ModeData,
    part: &data::Split,
    placed: coordinates::Placed,
) -> IdentifiedMode {
    let fit = fit::percent(&placed.model, &part.test);
    let unit = |scale: &DVector<f64>| DMatrix::from_diagonal(scale);
    let inverse = unit(&data.input_scale.map(|scale| 1.0 / scale));
    let Model { a, b, c, .. } = placed.model;
    IdentifiedMode {
        a,
        b: b * inverse,
        c: unit(&data.output_scale) * c,
        x0: placed.x0,
        u0: &mode.input_mean + placed.u0.component_mul(&data.input_scale),
        y0: &mode.output_mean + placed.y0.component_mul(&data.output_scale),
        fit,
        held_out: part.test.iter().map(data::Stretch::samples).sum(),
        samples: part
            .estimation_and_validation()
            .iter()
            .map(data::Stretch::samples)
            .sum(),
    }
}
