//! What a user should know of a proved design: values; the program that shows them adds the words.
//!
//! A warning is no error: nothing that was proved depends on it.

use crate::Design;
use crate::apart::{self, Apart};
use crate::assembly::DatabaseSource;
use crate::commissioning::{Database, model_predictor};
use crate::steady_state::steady_state;
use ftc_control::Matrix;
use ftc_control::estimator::leverage;
use ftc_control::parameters::{Estimator, EstimatorMethod, Predictor};
use ftc_plant::Mode;
use ftc_plant::scenario::first_tick;
use nalgebra::{DMatrix, DVector};

/// Relative distance from the model's response beyond which a logged response is doubted.
const LARGEST_DISTANCE: f64 = 0.5;
/// Residual deviation, relative to what the output moves in the log, beyond which it is doubted.
const LARGEST_UNEXPLAINED: f64 = 0.3;
/// Cosine between two responses above which they differ by their scale only.
const SAME_SHAPE: f64 = 0.9;

/// Gain of the running loop over that of a measured state above which the observer is named.
const OBSERVER_COST: f64 = 1.5;

/// What a certified design does not cover. Modes, inputs and outputs count from 0.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// Before some switches of the schedule a mode lasts no longer than the response: no sensor is
    /// judged in that time.
    ModesTooShortToJudge {
        /// How many switches these are.
        short: usize,
        /// How many there are.
        switches: usize,
        /// Response length `j` in samples.
        response_length: u64,
    },
    /// Modes of the schedule do not last as long as stability under `dwell` needs.
    ModesTooShortToBeProved {
        /// Mean time between switches in samples.
        mean: f64,
        /// What is needed, in samples.
        needed: f64,
    },
    /// A mode of the schedule is shorter than the proof of bumpless transfer needs each to be.
    ModesTooShortForTransfer {
        /// The shortest mode that is followed by another, in samples.
        shortest: u64,
        /// What each must last, in samples.
        needed: u64,
    },
    /// The observer makes the gain of the running loop much larger than that of a measured state.
    CostlyObserver {
        /// The mode in which it does most.
        mode: usize,
        /// `gamma_loop` there.
        running: f64,
        /// Over `gamma`.
        times: f64,
    },
    /// In steady state a reference of the scenario needs inputs that the healthy database does not
    /// span.
    OutsideTheDatabase {
        /// The mode.
        mode: usize,
        /// The input that goes farthest from its operating point, relative to its nominal value.
        input: usize,
        /// Its steady value in physical units.
        value: f64,
        /// How many times wider thresholds are there.
        widening: f64,
    },
    /// Two modes are not told apart by the readings, though the mode is to be found from them.
    ModesAlike(Apart),
    /// The response in a log is not that of the model.
    DoubtfulLog {
        /// The mode.
        mode: usize,
        /// The output.
        output: usize,
        /// Why it is doubted.
        doubt: Doubt,
    },
}

/// Why the log of an output is doubted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// Its response differs from the model's.
    Response {
        /// Distance of the two, relative to the model's.
        distance: f64,
        /// What may be the reason.
        guess: Guess,
    },
    /// The inputs leave much of its movement unexplained.
    Unexplained {
        /// Deviation of the residual in physical units.
        deviation: f64,
        /// Deviation, relative to that of the output in the log.
        share: f64,
    },
}

/// Why a logged response may differ from the model's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Guess {
    /// The same with the other sign.
    ReversedSign,
    /// The same in another unit.
    OtherUnit,
    /// Another response.
    OtherPlant,
}

/// How much each output moves in a log: standard deviation per mode and output.
#[derive(Clone, Debug)]
pub struct LoggedMovement(Vec<Vec<f64>>);

impl LoggedMovement {
    /// Of recorded logs, if there are any.
    pub fn of(source: &DatabaseSource) -> Option<Self> {
        let DatabaseSource::Recorded(modes) = source else {
            return None;
        };
        Some(Self(modes.iter().map(|log| movements(log)).collect()))
    }
}

/// Standard deviation of every output over the stretches of a log.
fn movements(stretches: &[Database]) -> Vec<f64> {
    let outputs = stretches.first().map_or(0, |log| log.outputs.ncols());
    let deviation = |output: usize| {
        let columns = stretches.iter().map(|log| log.outputs.column(output));
        let values: Vec<f64> = columns
            .flat_map(|column| column.iter().copied().collect::<Vec<_>>())
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        (squares / values.len() as f64).sqrt()
    };
    (0..outputs).map(deviation).collect()
}

/// All warnings of a design; `logged` is how its logs move, if it was made from logs.
pub fn of_design(design: &Design, logged: Option<&LoggedMovement>) -> Vec<Warning> {
    let durations = ModeDurations::of(design);
    let mut warnings = Vec::new();
    warnings.extend(durations.too_short_to_judge(&design.controller.estimator));
    warnings.extend(durations.too_short_to_be_proved(design));
    warnings.extend(durations.too_short_for_transfer(design));
    let alike = apart::pairs(design).into_iter();
    let alike = alike.filter(|pair| pair.deviations < apart::LEAST_DEVIATIONS);
    warnings.extend(alike.map(Warning::ModesAlike));
    warnings.extend(costly_observer(design));
    warnings.extend(outside_the_database(design));
    if let Some(logged) = logged {
        warnings.extend(doubtful_logs(logged, design));
    }
    warnings
}

/// Where the running loop falls far behind the state feedback.
fn costly_observer(design: &Design) -> Option<Warning> {
    let proof = design.proof.as_ref()?;
    let (known, running) = (
        proof.state_feedback.gamma.as_ref()?,
        proof.running_loop.gamma_loop.as_ref()?,
    );
    let times = running
        .iter()
        .zip(known)
        .map(|(running, known)| running / known);
    let (mode, times) = times.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (times > OBSERVER_COST).then_some(Warning::CostlyObserver {
        mode,
        running: running[mode],
        times,
    })
}

/// How long modes last in the scenario: samples from one switch to the next, the first from 0.
struct ModeDurations(Vec<u64>);

impl ModeDurations {
    fn of(design: &Design) -> Self {
        let te = design.plant.sample_time;
        let scenario = &design.scenario;
        let mut switches = vec![0];
        for pair in scenario.schedule.windows(2) {
            let tick = first_tick(pair[1].from, te);
            if pair[0].mode != pair[1].mode && tick < scenario.steps {
                switches.push(tick);
            }
        }
        Self(switches.windows(2).map(|pair| pair[1] - pair[0]).collect())
    }

    /// A residual means nothing until the regressor holds inputs of the present mode only.
    fn too_short_to_judge(&self, estimator: &Estimator) -> Option<Warning> {
        let length = estimator.response_length as u64;
        let short = self.0.iter().filter(|&&samples| samples <= length).count();
        (short > 0 && estimator.method != EstimatorMethod::None).then_some(
            Warning::ModesTooShortToJudge {
                short,
                switches: self.0.len(),
                response_length: length,
            },
        )
    }

    /// Where modes must last for bumpless transfer, each must.
    fn too_short_for_transfer(&self, design: &Design) -> Option<Warning> {
        let needed = design.proof.as_ref()?.shortest_mode()? as u64;
        let shortest = self.0.iter().copied().min()?;
        (shortest < needed).then_some(Warning::ModesTooShortForTransfer { shortest, needed })
    }

    /// Stability under `dwell` is proved for modes that last.
    fn too_short_to_be_proved(&self, design: &Design) -> Option<Warning> {
        let needed = design.proof.as_ref()?.dwell()?;
        let count = self.0.len();
        let mean = self.0.iter().sum::<u64>() as f64 / count.max(1) as f64;
        (count > 0 && mean <= needed).then_some(Warning::ModesTooShortToBeProved { mean, needed })
    }
}

/// The steady input per mode that takes the tracked outputs to a reference, and how far the
/// database spans.
struct Steady<'a> {
    mode: &'a Mode,
    tracked: &'a [usize],
    /// `du = gain (y_ref - y0)`, from `[A-I B; S C 0] [dx; du] = [0; y_ref - y0]`.
    gain: DMatrix<f64>,
    /// Leverage of `du` held for as long as the response lasts: `|spread du|^2`.
    spread: DMatrix<f64>,
}

impl<'a> Steady<'a> {
    fn new(mode: &'a Mode, predictor: &Predictor, tracked: &'a [usize]) -> Self {
        let (n, m) = mode.b.shape();
        let rest = steady_state(mode, tracked);
        let size = predictor.factor.nrows();
        let mut spread = DMatrix::zeros(size, m);
        for input in 0..m {
            let held: Vec<f64> = (0..size)
                .map(|entry| f64::from(u8::from(entry % m == input)))
                .collect();
            let mut whitened = vec![0.0; size];
            leverage(&predictor.factor, &held, &mut whitened);
            spread.column_mut(input).copy_from_slice(&whitened);
        }
        Self {
            mode,
            tracked,
            gain: rest.rows(n, m).into_owned(),
            spread,
        }
    }

    /// The input `u` (m) and its leverage; an input stays within its limits.
    fn at(&self, reference: &[f64], design: &Design) -> (DVector<f64>, f64) {
        let point = &self.mode.operating_point;
        let step = self.tracked.iter().zip(reference);
        let step: Vec<f64> = step.map(|(&output, y)| y - point.y[output]).collect();
        let u0 = DVector::from_column_slice(&point.u);
        let mut u = &u0 + &self.gain * DVector::from_vec(step);
        for (value, limits) in u.iter_mut().zip(design.signals.input_limits()) {
            *value = value
                .min(limits.max.unwrap_or(f64::INFINITY))
                .max(limits.min.unwrap_or(f64::NEG_INFINITY));
        }
        let leverage = (&self.spread * (&u - u0)).norm_squared();
        (u, leverage)
    }
}

/// Modes in which the references need inputs that the database does not span.
fn outside_the_database(design: &Design) -> Vec<Warning> {
    let controller = &design.controller;
    let (scenario, te) = (&design.scenario, design.plant.sample_time);
    let modes = design.plant.modes.iter();
    let steady: Vec<Steady> = modes
        .zip(&controller.estimator.predictors)
        .map(|(mode, predictor)| Steady::new(mode, predictor, &controller.feedback.tracked))
        .collect();
    let mut worst: Vec<Option<(DVector<f64>, f64)>> = vec![None; steady.len()];
    for tick in 0..scenario.steps {
        let mode = scenario.mode(tick, te);
        let Some(steady) = steady.get(mode) else {
            continue;
        };
        let reference: Vec<f64> = scenario.reference.iter().map(|r| r.at(tick, te)).collect();
        let found = steady.at(&reference, design);
        if worst[mode].as_ref().is_none_or(|worst| found.1 > worst.1) {
            worst[mode] = Some(found);
        }
    }
    let limit = controller.estimator.leverage_limit;
    let far = worst.iter().enumerate().filter_map(|(mode, worst)| {
        let (u, leverage) = worst.as_ref().filter(|(_, leverage)| *leverage > limit)?;
        Some(beyond(design, mode, u, (1.0 + leverage).sqrt()))
    });
    far.collect()
}

/// Names the input that goes farthest.
fn beyond(design: &Design, mode: usize, u: &DVector<f64>, widening: f64) -> Warning {
    let inputs = &design.signals.inputs;
    let point = &design.plant.modes[mode].operating_point.u;
    let farthest = |&input: &usize| ((u[input] - point[input]) / inputs[input].nominal).abs();
    let input = (0..u.len())
        .max_by(|a, b| farthest(a).total_cmp(&farthest(b)))
        .unwrap_or(0);
    Warning::OutsideTheDatabase {
        mode,
        input,
        value: u[input],
        widening,
    }
}

/// Outputs whose logged response is not the model's, or is no response at all.
fn doubtful_logs(logged: &LoggedMovement, design: &Design) -> Vec<Warning> {
    let controller = &design.controller;
    let mut warnings = Vec::new();
    for (index, (mode, predictor)) in design
        .plant
        .modes
        .iter()
        .zip(&controller.estimator.predictors)
        .enumerate()
    {
        let units: Vec<f64> = design.signals.inputs.iter().map(|i| i.nominal).collect();
        let length = controller.estimator.response_length;
        let model = model_predictor(mode, length, &units, &predictor.deviation).response;
        for output in 0..design.signals.outputs.len() {
            let row = |response: &Matrix| -> Vec<f64> {
                let row = response.row(output);
                let scaled = row.zip(units.iter().cycle());
                scaled.map(|(value, unit)| value * unit).collect()
            };
            let moved = logged.0[index][output];
            let doubt = disagreement(&row(&predictor.response), &row(&model))
                .or_else(|| unexplained(predictor.deviation[output], moved));
            warnings.extend(doubt.map(|doubt| Warning::DoubtfulLog {
                mode: index,
                output,
                doubt,
            }));
        }
    }
    warnings
}

/// How a logged response differs from that of the model, where it does by much.
fn disagreement(found: &[f64], model: &[f64]) -> Option<Doubt> {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let size = dot(model, model).sqrt();
    let difference: Vec<f64> = found.iter().zip(model).map(|(f, m)| f - m).collect();
    let distance = dot(&difference, &difference).sqrt() / size;
    if size == 0.0 || distance <= LARGEST_DISTANCE {
        return None;
    }
    let alike = dot(found, model).abs() / (size * dot(found, found).sqrt());
    let guess = match alike > SAME_SHAPE {
        true if dot(found, model) < 0.0 => Guess::ReversedSign,
        true => Guess::OtherUnit,
        false => Guess::OtherPlant,
    };
    Some(Doubt::Response { distance, guess })
}

/// What the inputs leave unexplained, where it is much.
fn unexplained(deviation: f64, moved: f64) -> Option<Doubt> {
    (deviation > LARGEST_UNEXPLAINED * moved).then_some(Doubt::Unexplained {
        deviation,
        share: deviation / moved,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_response_is_doubted_by_what_is_wrong_with_it() {
        let model = [1.0, 2.0, -1.0];
        let guess = |found: [f64; 3]| match disagreement(&found, &model) {
            Some(Doubt::Response { guess, .. }) => Some(guess),
            _ => None,
        };
        assert_eq!(guess([1.1, 1.9, -1.0]), None);
        assert_eq!(guess([-1.0, -2.1, 1.0]), Some(Guess::ReversedSign));
        assert_eq!(guess([1000.0, 2000.0, -1000.0]), Some(Guess::OtherUnit));
        assert_eq!(guess([0.0, -1.0, -2.0]), Some(Guess::OtherPlant));
        assert_eq!(disagreement(&[1.0], &[0.0]), None);
    }
}
