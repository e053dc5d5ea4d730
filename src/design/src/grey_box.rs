//! The modes' matrices fitted to logs of healthy operation: a grey box, started at the design model and held by it.
//!
//! A log is cut into windows. In each of them the state at its start, the disturbance's waves and a constant
//! level of each of its channels are whatever explains the readings best; the matrices, which all windows share,
//! make the readings of the windows least wrong together (output error), with a penalty on how far they differ from the
//! design model, entry by entry, relative to the error that the model may have. Gauss-Newton with the windows'
//! nuisance parameters (state, waves, level) projected out.
//!
//! All modes are fitted together: a window may contain switches, across which the state carries on, and a row of `C`
//! that is the same in several modes stays the same. This is what keeps the modes' states in common coordinates.
//! `E` and `F` are fitted where the disturbance's period is known; else nothing tells their part from the level's.

mod judgement;
mod model;
mod parameters;
mod search;
#[cfg(test)]
mod tests;
mod windows;

use crate::commissioning::{Database, RecordedDisturbance};
use ftc_control::parameters::FittedMode;
use ftc_plant::Mode;
use ftc_plant::scaling::Scaling;
use ftc_record::plain;
use model::GreyBox;
use nalgebra::DVector;
use parameters::parameters;
use windows::{HELD_BACK, Segment, a_sample_later, cut, samples_of, segments, split, usual};

pub(crate) use windows::least_samples;

/// The model error that remains, at least: what no log shows, such as a plant that ages.
const LEAST_ERROR: f64 = 0.01;

/// What a log says of a mode.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The matrices, and how well they explain the windows held back.
    pub(crate) mode: FittedMode,
    /// Standard deviation of what they leave unexplained (p), output units.
    pub(crate) deviation: Vec<f64>,
    /// The part of it that is white: the sensors' noise (p), output units.
    pub(crate) noise: Vec<f64>,
    /// Relative error of the matrices that remains.
    pub(crate) model_error: f64,
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
    let segments = segments(stretches, disturbance);
    let windows: Vec<Segment> = segments
        .iter()
        .flat_map(|segment| cut(segment, length))
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
    let (theta, remaining) = grey.choose(&learn, model_error);
    let late: Vec<Segment> = segments.iter().map(a_sample_later).collect();
    let late: Vec<Segment> = late
        .iter()
        .flat_map(|segment| cut(segment, length))
        .collect();
    if let Some(mode) = grey.late(&learn, &late, &theta, model_error) {
        return Err((mode, Unusable::Late));
    }
    // What was held back decides: a log that the model explains better is not used.
    grey.deviation = grey.residual_deviation(&held_back, &model);
    let [of_fit, of_model] = [&theta, &model].map(|theta| grey.sum_of_squares(&held_back, theta));
    let (theta, remaining) = match of_fit < of_model {
        true => (theta, remaining),
        // What was learned is no better by no more than its own uncertainty: the log confirms the model.
        false if of_fit - of_model < theta.len() as f64 => (model.clone(), remaining),
        false => (model.clone(), model_error),
    };
    let deviations = grey.residual_deviation(&held_back, &theta);
    let percents = [&theta, &model].map(|theta| grey.percent(&held_back, theta));
    let [of_fit, of_model] = percents;
    let fitted = grey.matrices(&theta).into_iter();
    let noise = grey.noise(&learn, &theta);
    let deviations = deviations.into_iter().zip(noise);
    let each = fitted.zip(of_fit).zip(of_model).zip(deviations);
    Ok(each
        .map(|(((found, fit), fit_of_model), (deviation, noise))| {
            let [a, b, c, e, f] = [&found.a, &found.b, &found.c, &found.e, &found.f].map(plain);
            Fit {
                mode: FittedMode::new([a, b, c, e, f], fit, fit_of_model),
                noise: noise.inf(&deviation).as_slice().to_vec(),
                deviation: deviation.as_slice().to_vec(),
                model_error: remaining.max(LEAST_ERROR.min(model_error)),
            }
        })
        .collect())
}
