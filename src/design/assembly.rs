//! From what is asked for to a finished design: gains, observer, predictor, thresholds, record.

use super::commissioning::{self, LONGEST_RESPONSE};
use super::{
    ControlSpec, Design, DesignError, FORMAT, ObserverSpec, Report, Signal, Signals, Synthesis,
    disturbance_response, synthesise,
};
use crate::control::ControllerParameters;
use crate::control::parameters::{
    Compensation, Estimator, EstimatorMethod, FeedbackGains, Harmonics, Limits, Predictor,
    StateFeedback,
};
use crate::plant::scaling::Scaling;
use crate::plant::{Dimensions, Mode, SwitchedPlant};
use crate::simulate::Scenario;
use nalgebra::DMatrix;

/// A design that is asked for.
#[derive(Clone, Debug)]
pub struct Request {
    /// Name of the design.
    pub name: String,
    /// What the signals are called and measured in.
    pub signals: Signals,
    /// The plant.
    pub plant: SwitchedPlant,
    /// The state feedback that is asked for.
    pub control: ControlSpec,
    /// The observer that is asked for.
    pub observer: ObserverSpec,
    /// The fault estimator that is asked for.
    pub estimator: EstimatorSpec,
    /// What is done about an estimated fault.
    pub compensation: Compensation,
    /// The experiment; its noise is also that of the commissioning run.
    pub scenario: Scenario,
}

/// The fault estimator that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatorSpec {
    /// Method.
    pub method: EstimatorMethod,
    /// `j` in samples; chosen by [`commissioning::response_length`] when absent.
    pub response_length: Option<usize>,
    /// Where the predictor comes from.
    pub database: DatabaseSource,
    /// How large a residual must be to be called a fault.
    pub threshold: Threshold,
    /// Consecutive samples that raise or release a fault.
    pub debounce: u32,
    /// The periodic disturbance to be learned on line.
    pub disturbance: Option<KnownDisturbance>,
}

/// Where the healthy database comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DatabaseSource {
    /// A commissioning run on the plant model.
    Commission,
    /// The model's own Markov parameters.
    Model,
}

/// How thresholds are chosen.
#[derive(Clone, Debug, PartialEq)]
pub enum Threshold {
    /// One per sensor (p), in output units.
    Given(Vec<f64>),
    /// So many standard deviations of the healthy residual, and never below a thousandth of the
    /// nominal value of the output.
    Sigmas(f64),
}

/// What is known of the periodic disturbance.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownDisturbance {
    /// Period in seconds.
    pub period: f64,
    /// Harmonics, the fundamental included.
    pub harmonics: usize,
    /// Largest value of each channel (s), if known.
    pub amplitude: Option<Vec<f64>>,
}

/// The smallest threshold that is chosen automatically, relative to the nominal value.
const SMALLEST_THRESHOLD: f64 = 1e-3;

/// Deviations a threshold counts as when the user gave it in output units.
const USUAL_SIGMAS: f64 = 6.0;

/// Leverage beyond which the residual is not trusted.
const LEVERAGE_LIMIT: f64 = 100.0;

/// Variance of a harmonic of which nothing is known, in units of the noise variance.
const UNKNOWN_VARIANCE: f64 = 1e6;

/// Share of what saturation took off that unwinds the integrator in one sample.
const UNWINDING: f64 = 0.5;

/// Largest fault of a sensor without a range, relative to the nominal value of its output.
const LARGEST_FAULT: f64 = 1e6;

/// Seed of the commissioning run; any will do, but the same design must give the same bytes.
const COMMISSIONING_SEED: u64 = 20;

/// The most response coefficients per output: beyond it a predictor is too large to ship.
const MOST_COEFFICIENTS: usize = 2000;

/// Makes the design: synthesis of gains and observer, their certificate, the fault estimator.
///
/// # Errors
/// [`DesignError::Request`] where the request is ill-formed, else what [`synthesise`] says.
pub fn assemble(request: Request) -> Result<Design, DesignError> {
    let dims = Dimensions::check(&request.plant).map_err(DesignError::Request)?;
    let estimator = estimator(&request, dims).map_err(DesignError::Request)?;
    let synthesis = synthesise(
        &request.plant,
        &request.control,
        &request.observer,
        &scaling(&request.signals),
    )?;
    let input_limits = limits(&request.signals.inputs);
    let feedback = with_anti_windup(synthesis.feedback.clone(), &input_limits);
    Ok(Design {
        format: FORMAT,
        name: request.name,
        signals: request.signals,
        controller: ControllerParameters {
            plant: request.plant,
            feedback,
            observer: synthesis.observer.clone(),
            estimator,
            compensation: request.compensation,
            input_limits,
        },
        scenario: request.scenario,
        report: Report::from(synthesis),
    })
}

fn scaling(signals: &Signals) -> Scaling {
    let nominal = |signals: &[Signal]| signals.iter().map(|s| s.nominal).collect();
    Scaling {
        states: nominal(&signals.states),
        inputs: nominal(&signals.inputs),
        outputs: nominal(&signals.outputs),
    }
}

fn limits(inputs: &[Signal]) -> Vec<Limits> {
    let of = |input: &Signal| Limits {
        min: input.min,
        max: input.max,
    };
    inputs.iter().map(of).collect()
}

/// Back-calculation: what saturation takes off an input unwinds the integrator through `G^+`.
/// Inputs without a limit never saturate and have zero columns.
fn with_anti_windup(mut feedback: StateFeedback, limits: &[Limits]) -> StateFeedback {
    for gains in &mut feedback.modes {
        gains.anti_windup = anti_windup(gains, limits);
    }
    feedback
}

fn anti_windup(gains: &FeedbackGains, limits: &[Limits]) -> DMatrix<f64> {
    let (inputs, tracked) = gains.integral.shape();
    let tiny = 1e-12 * gains.integral.norm();
    let inverse = gains.integral.clone().pseudo_inverse(tiny);
    let mut unwinding = inverse.unwrap_or_else(|_| DMatrix::zeros(tracked, inputs)) * UNWINDING;
    for (input, limit) in limits.iter().enumerate() {
        if limit.min.is_none() && limit.max.is_none() {
            unwinding.column_mut(input).fill(0.0);
        }
    }
    unwinding
}

/// Predictors, thresholds and harmonics.
fn estimator(request: &Request, dims: Dimensions) -> Result<Estimator, String> {
    let spec = &request.estimator;
    let outputs = &request.signals.outputs;
    let (response_length, predictors) = match spec.method {
        EstimatorMethod::None => (0, Vec::new()),
        EstimatorMethod::Reference | EstimatorMethod::Sliding => predictors(request, dims)?,
    };
    let thresholds = thresholds(&spec.threshold, &predictors, outputs);
    let harmonics = spec
        .disturbance
        .as_ref()
        .map(|known| harmonics(known, spec, &request.plant, &thresholds));
    Ok(Estimator {
        method: spec.method,
        response_length,
        predictors,
        harmonics,
        thresholds,
        debounce: spec.debounce,
        leverage_limit: LEVERAGE_LIMIT,
        largest_fault: outputs.iter().map(largest_fault).collect(),
    })
}

/// The response length and the predictor of each mode.
fn predictors(request: &Request, dims: Dimensions) -> Result<(usize, Vec<Predictor>), String> {
    let modes = &request.plant.modes;
    let decayed = commissioning::response_length(modes)?;
    let length = request.estimator.response_length.unwrap_or(decayed);
    let most = LONGEST_RESPONSE.min(MOST_COEFFICIENTS / dims.inputs);
    if length == 0 || length > most {
        return Err(format!(
            "the response length is {length} samples, but with {} inputs it must lie between 1 and {most}: set estimator.response_length, or choose a longer sample_time",
            dims.inputs
        ));
    }
    let predictor = |(index, mode): (usize, &Mode)| {
        let amplitudes = amplitudes(mode, &request.signals.inputs);
        predictor(request, mode, index, length, &amplitudes)
    };
    let predictors: Result<Vec<_>, String> = modes.iter().enumerate().map(predictor).collect();
    Ok((length, predictors?))
}

fn predictor(
    request: &Request,
    mode: &Mode,
    index: usize,
    length: usize,
    amplitudes: &[f64],
) -> Result<Predictor, String> {
    let noise = &request.scenario.noise;
    match request.estimator.database {
        DatabaseSource::Model => Ok(commissioning::model_predictor(
            mode, length, amplitudes, noise,
        )),
        DatabaseSource::Commission => {
            let samples = length + commissioning::commissioning_samples(amplitudes.len(), length);
            let seed = COMMISSIONING_SEED + index as u64;
            let database = commissioning::commission(mode, amplitudes, noise, samples, seed);
            commissioning::predictor(&database, length)
                .map_err(|what| format!("mode {}: {what}", index + 1))
        }
    }
}

/// How far each input may be moved about the operating point: its nominal value, or less where a
/// limit is nearer. At a limit, half the range.
fn amplitudes(mode: &Mode, inputs: &[Signal]) -> Vec<f64> {
    let amplitude = |(input, &u0): (&Signal, &f64)| {
        let above = input.max.map_or(f64::INFINITY, |max| max - u0);
        let below = input.min.map_or(f64::INFINITY, |min| u0 - min);
        let room = above.min(below);
        let range = input.max.zip(input.min).map(|(max, min)| (max - min) / 2.0);
        let admissible = if room > 0.0 { room } else { range.unwrap_or(input.nominal) };
        input.nominal.min(admissible)
    };
    let point = &mode.operating_point.u;
    inputs.iter().zip(point).map(amplitude).collect()
}

fn thresholds(wanted: &Threshold, predictors: &[Predictor], outputs: &[Signal]) -> Vec<f64> {
    let deviation = |sensor: usize| {
        let of = |predictor: &Predictor| predictor.deviation.get(sensor).copied();
        predictors.iter().filter_map(of).fold(0.0, f64::max)
    };
    match wanted {
        Threshold::Given(values) => values.clone(),
        Threshold::Sigmas(sigmas) => outputs
            .iter()
            .enumerate()
            .map(|(sensor, output)| {
                (sigmas * deviation(sensor)).max(SMALLEST_THRESHOLD * output.nominal)
            })
            .collect(),
    }
}

/// What the estimator is told of the disturbance. A known amplitude bounds its response, so that
/// the thresholds need not be opened wider than that response while it is being learned.
fn harmonics(
    known: &KnownDisturbance,
    spec: &EstimatorSpec,
    plant: &SwitchedPlant,
    thresholds: &[f64],
) -> Harmonics {
    let period = known.period / plant.sample_time;
    let sigmas = match spec.threshold {
        Threshold::Sigmas(sigmas) => sigmas,
        Threshold::Given(_) => USUAL_SIGMAS,
    };
    let variance = known.amplitude.as_ref().map(|amplitude| {
        let response = disturbance_response(plant, period, known.harmonics, amplitude);
        let deviations = response.iter().zip(thresholds).map(|(r, t)| sigmas * r / t);
        deviations.fold(0.0, f64::max).powi(2)
    });
    Harmonics {
        period,
        count: known.harmonics,
        memory: (10.0 * period).max(200.0),
        initial_variance: variance.unwrap_or(UNKNOWN_VARIANCE).clamp(1.0, UNKNOWN_VARIANCE),
    }
}

fn largest_fault(output: &Signal) -> f64 {
    let range = output.max.zip(output.min).map(|(max, min)| max - min);
    range.unwrap_or(LARGEST_FAULT * output.nominal)
}
