//! From what is asked for to a finished design: gains, observer, predictor, thresholds, record.

use super::commissioning::{self, Database, RecordedDisturbance};
pub use super::estimator_spec::{DatabaseSource, EstimatorSpec, LONGEST_DEBOUNCE, Threshold};
use super::grey_box::{self, Fit, Unusable};
use super::harmonics;
pub use super::harmonics::{DisturbanceError, KnownDisturbance};
use super::hypotheses;
use super::{
    CertificateError, ControlSpec, ControllerDesign, Design, DesignError, DesignRecord, Failure,
    ObserverSpec, RequestError, Run, Signal, Signals, check_controllable, synthesise_with,
};
use crate::coverage;
use crate::defaults::{
    COMMISSIONING_SEED, LEAST_MEMORY, MEMORY_PERIODS, OPENING_FACTOR, SMALLEST_THRESHOLD,
    WINDOW_MARGIN,
};
use crate::derived::{feedback, largest_faults, sensor_noise};
use crate::work::Work;
use ftc_control::parameters::{
    Compensation, Estimator, EstimatorMethod, Harmonics, Limits, Predictor,
};
use ftc_control::tuning::UNKNOWN_VARIANCE;
use ftc_plant::{Dimensions, Mode, SwitchedPlant};
use ftc_plant::{Scenario, TruePlant};

/// A design that is asked for.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Request {
    /// Name of the design.
    pub name: String,
    /// What the signals are called and measured in.
    pub signals: Signals,
    /// The plant as it is designed for.
    pub plant: SwitchedPlant,
    /// What the simulated plant really is.
    pub true_plant: TruePlant,
    /// The state feedback that is asked for.
    pub control: ControlSpec,
    /// Whether a mode switch leaves the command where it was.
    pub bumpless: bool,
    /// Whether the reference acts on the command at once, or by way of the integrator alone.
    pub feedforward: bool,
    /// The observer that is asked for.
    pub observer: ObserverSpec,
    /// The fault estimator that is asked for.
    pub estimator: EstimatorSpec,
    /// What is done about an estimated fault.
    pub compensation: Compensation,
    /// The experiment; its noise is also that of the commissioning run.
    pub scenario: Scenario,
}

impl Request {
    /// A request in which all but plant, signals and experiment has its default. The reference acts on the
    /// command at once, a mode switch is not bumpless, an estimated fault is taken out by a virtual
    /// sensor; for the rest see [`ControlSpec::new`], [`ObserverSpec::beside`] and [`EstimatorSpec`].
    pub fn new(name: &str, plant: SwitchedPlant, signals: Signals, scenario: Scenario) -> Self {
        let control = ControlSpec::new(&signals.scaling());
        Self {
            name: name.into(),
            signals,
            estimator: EstimatorSpec::default(),
            plant,
            true_plant: TruePlant::default(),
            bumpless: false,
            feedforward: true,
            observer: ObserverSpec::beside(&control),
            control,
            compensation: Compensation::VirtualSensor,
            scenario,
        }
    }
}

/// Least ratio of the weakest to the strongest excited direction of a recorded database.
const LEAST_EXCITATION: f64 = 1e-4;

/// The most entries of the least-squares problem of one mode: beyond it memory runs short.
const MOST_REGRESSORS: usize = 20_000_000;

/// Makes the design: synthesis of gains and observer, their certificate, the fault estimator.
///
/// # Errors
/// [`DesignError::Request`] where the request is ill-formed, else what the synthesis says.
pub fn assemble(request: Request) -> Result<Design, DesignError> {
    Ok(assemble_with(request, &Run::default())?)
}

/// [`assemble`] with a chosen solver, its progress reported.
///
/// # Errors
/// As [`assemble`], with the part that was found.
pub fn assemble_with(request: Request, run: &Run) -> Result<Design, Failure> {
    let dims = Dimensions::check(&request.plant).map_err(DesignError::from)?;
    let asked = request.control.check(dims);
    asked.map_err(DesignError::from)?;
    let work = Work::new(dims, request.plant.modes.len(), &request.control);
    work.check(&request.control)
        .map_err(|large| DesignError::Request(large.into()))?;
    check_operating_inputs(&request.plant, &request.signals.inputs).map_err(DesignError::from)?;
    let asked = request.estimator.check(dims);
    asked.map_err(DesignError::from)?;
    let asked = request.estimator.check_modes(request.plant.modes.len());
    asked.map_err(DesignError::from)?;
    check_experiment(&request, dims).map_err(DesignError::from)?;
    let estimator = estimator(&request, dims).map_err(DesignError::from)?;
    let scaling = request.signals.scaling();
    check_controllable(&request.plant, &request.control, &scaling)
        .map_err(|error| DesignError::Request(error.into()))?;
    let observer = ObserverSpec {
        noise: observer_noise(&request),
        ..request.observer.clone()
    };
    let mut synthesis =
        synthesise_with(&request.plant, &request.control, &observer, &scaling, run)?;
    if request.bumpless
        && request.plant.modes.len() > 1
        && !synthesis.certify_transfer(&request.plant)
    {
        return Err(DesignError::from(RequestError::Bumpless).into());
    }
    let input_limits = request.signals.input_limits();
    let feedback = feedback(
        &synthesis.state_feedback,
        &request.plant,
        synthesis.running_loop.transfer.as_ref(),
        request.feedforward,
        &input_limits,
    );
    let observer = synthesis.observer.observer.clone();
    let controller = ControllerDesign::new(feedback, observer, estimator, request.compensation);
    let mut record = DesignRecord::new(
        &request.name,
        request.plant,
        request.signals,
        controller,
        request.scenario,
    );
    record.true_plant = request.true_plant;
    let design = Design {
        record,
        proof: Some(synthesis.into()),
    };
    // What would be refused of the FMU is not shipped.
    let follows = coverage::check(&design);
    follows.map_err(|error| DesignError::from(CertificateError::malformed(error)))?;
    Ok(design)
}

/// Refuses a disturbance, an experiment or a true plant that does not fit the plant.
fn check_experiment(request: &Request, dims: Dimensions) -> Result<(), RequestError> {
    let plant = &request.plant;
    if let Some(known) = &request.estimator.disturbance {
        known.check(plant.sample_time, dims.disturbances)?;
    }
    let (modes, tracked) = (plant.modes.len(), request.control.tracked.len());
    request.scenario.check(dims, modes, tracked)?;
    let (_, deviation) = request.true_plant.clone().into_parts();
    Ok(deviation.check(plant)?)
}

/// Refuses an operating point whose input lies beyond its limits: no controller could hold it.
fn check_operating_inputs(plant: &SwitchedPlant, inputs: &[Signal]) -> Result<(), RequestError> {
    for (mode, described) in plant.modes.iter().enumerate() {
        for (input, (&value, signal)) in described.operating_point.u.iter().zip(inputs).enumerate()
        {
            let (min, max) = (signal.min, signal.max);
            if (Limits { min, max }).clamp(value) != value {
                let (mode, input) = (mode + 1, input + 1);
                return Err(RequestError::OperatingInput {
                    mode,
                    input,
                    value,
                    min,
                    max,
                });
            }
        }
    }
    Ok(())
}

/// The sensors' noise as the observer is designed for it: that of the scenario, and of a sensor without
/// any a thousandth of its nominal value; empty where none is given.
fn observer_noise(request: &Request) -> Vec<f64> {
    let given = &request.scenario.noise;
    if !request.observer.noise.is_empty() || given.iter().all(|&noise| noise == 0.0) {
        return request.observer.noise.clone();
    }
    let outputs = given.iter().zip(&request.signals.outputs);
    outputs
        .map(|(noise, output)| noise.max(SMALLEST_THRESHOLD * output.nominal))
        .collect()
}

/// Predictors, thresholds and harmonics.
fn estimator(request: &Request, dims: Dimensions) -> Result<Estimator, RequestError> {
    let spec = &request.estimator;
    let outputs = &request.signals.outputs;
    let response_length = match spec.method {
        EstimatorMethod::Observer | EstimatorMethod::None => 0,
        EstimatorMethod::Reference | EstimatorMethod::Sliding => response_length(request, dims)?,
    };
    let predictors = match spec.method {
        EstimatorMethod::Reference => predictors(request, response_length)?,
        EstimatorMethod::Observer | EstimatorMethod::None | EstimatorMethod::Sliding => Vec::new(),
    };
    let state_based = spec.method == EstimatorMethod::Observer;
    let fits = match (&spec.database, state_based) {
        (DatabaseSource::Recorded(logs), true) => fits(request, logs)?,
        _ => Vec::new(),
    };
    let deviations = predictors.iter().map(|predictor| &predictor.deviation);
    let deviations = deviations.chain(fits.iter().map(|fit| &fit.deviation));
    let noise = &request.scenario.noise;
    let thresholds = thresholds(&spec.threshold, deviations, noise, outputs);
    let harmonics = spec
        .disturbance
        .as_ref()
        .filter(|_| !state_based)
        .map(|known| known_harmonics(known, &request.plant, &thresholds));
    let harmonic_transfers = harmonics.as_ref().map_or_else(Vec::new, |known| {
        let nominal = request.signals.scaling().outputs;
        harmonics::transfers(&request.plant, &nominal, known.period, known.count)
    });
    let hypotheses = state_based.then(|| {
        let known = spec.disturbance.as_ref();
        // That of the logs, where there are any.
        let logged = fits.iter().map(|fit| fit.noise.clone());
        let logged = logged.reduce(|one, other| {
            let pairs = one.iter().zip(&other);
            pairs.map(|(one, other)| one.max(*other)).collect()
        });
        let noise = logged.as_ref().unwrap_or(&request.scenario.noise);
        let noise = sensor_noise(noise, &thresholds);
        let (plant, signals) = (&request.plant, &request.signals);
        let reach = hypotheses::reach(plant, signals, &request.control.tracked, &request.scenario);
        let mut settings = spec
            .hypotheses
            .settings(plant, signals, noise, &reach, known);
        let errors = fits.iter().map(|fit| fit.model_error);
        settings.model_error = errors.reduce(f64::max).unwrap_or(settings.model_error);
        settings.fitted = fits.into_iter().map(|fit| fit.mode).collect();
        settings
    });
    let mut estimator = Estimator::none(outputs.len());
    estimator.method = spec.method;
    estimator.hypotheses = hypotheses;
    estimator.response_length = response_length;
    estimator.window = dims.inputs * (response_length + 1) + WINDOW_MARGIN;
    estimator.predictors = predictors;
    estimator.adapt = spec.adapt;
    estimator.harmonics = harmonics;
    estimator.harmonic_transfers = harmonic_transfers;
    estimator.thresholds = thresholds;
    estimator.debounce = spec.debounce;
    estimator.stuck_after = spec.stuck_after;
    estimator.largest_fault = largest_faults(outputs);
    Ok(estimator)
}

/// The response length asked for, or the one after which the response has decayed.
fn response_length(request: &Request, dims: Dimensions) -> Result<usize, RequestError> {
    let decayed = commissioning::response_length(&request.plant.modes)?;
    let length = request.estimator.response_length.unwrap_or(decayed);
    let most = commissioning::longest_response(dims.inputs);
    if (1..=most).contains(&length) {
        Ok(length)
    } else {
        Err(RequestError::ResponseLength {
            length,
            inputs: dims.inputs,
            most,
        })
    }
}

/// The predictor of each mode.
fn predictors(request: &Request, length: usize) -> Result<Vec<Predictor>, RequestError> {
    let noise = &request.scenario.noise;
    let predictor = |(index, mode): (usize, &Mode)| {
        let amplitudes = amplitudes(mode, &request.signals.inputs);
        match &request.estimator.database {
            DatabaseSource::Model => Ok(commissioning::model_predictor(
                mode,
                length,
                &amplitudes,
                noise,
            )),
            DatabaseSource::Commission => {
                let counted = commissioning::commissioning_samples(amplitudes.len(), length);
                let seed = COMMISSIONING_SEED + index as u64;
                let database =
                    commissioning::commission(mode, &amplitudes, noise, length + counted, seed);
                commissioning::predictor(&database, length, None).map_err(|error| {
                    RequestError::Database {
                        mode: index + 1,
                        error,
                    }
                })
            }
            DatabaseSource::Recorded(logs) => {
                let stretches = logs.get(index).map_or(&[][..], Vec::as_slice);
                recorded(request, index + 1, stretches, length)
            }
        }
    };
    let modes = request.plant.modes.iter();
    modes.enumerate().map(predictor).collect()
}

/// The disturbance while logs were recorded.
fn recorded_disturbance(request: &Request) -> Option<RecordedDisturbance> {
    let known = request.estimator.disturbance.as_ref();
    known.map(|known| RecordedDisturbance {
        period: known.period / request.plant.sample_time,
        count: known.harmonics,
    })
}

/// What the logs say of each mode.
fn fits(request: &Request, logs: &[Vec<Database>]) -> Result<Vec<Fit>, RequestError> {
    let scaling = request.signals.scaling();
    let disturbance = recorded_disturbance(request);
    let error = request.estimator.hypotheses.model_error;
    let modes = &request.plant.modes;
    let found = grey_box::fit(modes, logs, disturbance, error, &scaling);
    found.map_err(|(index, unusable)| match unusable {
        Unusable::Short => RequestError::ShortLog {
            mode: index + 1,
            needed: grey_box::least_samples(&modes[index], disturbance),
        },
        Unusable::Late => RequestError::LateLog { mode: index + 1 },
    })
}

/// The predictor of a log of one mode (from 1), in which the disturbance was at work.
fn recorded(
    request: &Request,
    mode: usize,
    stretches: &[Database],
    length: usize,
) -> Result<Predictor, RequestError> {
    let disturbance = recorded_disturbance(request);
    let inputs = &request.signals.inputs;
    let samples: usize = stretches.iter().map(Database::samples).sum();
    let most = MOST_REGRESSORS / (inputs.len() * length).max(1);
    if samples > most {
        return Err(RequestError::LongLog {
            mode,
            samples,
            most,
        });
    }
    let predictor = commissioning::predictor_of_stretches(stretches, length, disturbance)
        .map_err(|error| RequestError::Database { mode, error })?;
    let units: Vec<f64> = inputs.iter().map(|input| input.nominal).collect();
    let (ratio, input, lag) = commissioning::weakest_direction(&predictor, &units);
    if ratio < LEAST_EXCITATION {
        return Err(RequestError::Excitation {
            mode,
            input: input + 1,
            name: inputs[input].name.clone(),
            lag,
            ratio,
        });
    }
    Ok(predictor)
}

/// How far each input may be moved about the operating point: its nominal value, or less where a
/// limit is nearer. At a limit, half the range.
fn amplitudes(mode: &Mode, inputs: &[Signal]) -> Vec<f64> {
    let amplitude = |(input, &u0): (&Signal, &f64)| {
        let above = input.max.map_or(f64::INFINITY, |max| max - u0);
        let below = input.min.map_or(f64::INFINITY, |min| u0 - min);
        let room = above.min(below);
        let range = input.max.zip(input.min).map(|(max, min)| (max - min) / 2.0);
        let admissible = if room > 0.0 {
            room
        } else {
            range.unwrap_or(input.nominal)
        };
        input.nominal.min(admissible)
    };
    let point = &mode.operating_point.u;
    inputs.iter().zip(point).map(amplitude).collect()
}

fn thresholds<'a>(
    wanted: &Threshold,
    deviations: impl Iterator<Item = &'a Vec<f64>> + Clone,
    noise: &[f64],
    outputs: &[Signal],
) -> Vec<f64> {
    let deviation = |sensor: usize| {
        let found = deviations.clone();
        found.map(|of| of[sensor]).fold(noise[sensor], f64::max)
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

/// The disturbance as the estimator knows it. A known amplitude bounds its response, so that
/// the thresholds need not be opened wider than that response while it is being learned.
fn known_harmonics(
    known: &KnownDisturbance,
    plant: &SwitchedPlant,
    thresholds: &[f64],
) -> Harmonics {
    let period = known.period / plant.sample_time;
    let variance = known.amplitude.as_ref().map(|amplitude| {
        let response = harmonics::largest_response(plant, period, known.harmonics, amplitude);
        let openings = response.iter().zip(thresholds).map(|(r, t)| r / t);
        (OPENING_FACTOR * openings.fold(0.0, f64::max)).powi(2)
    });
    Harmonics {
        period,
        count: known.harmonics,
        memory: (MEMORY_PERIODS * period).max(LEAST_MEMORY),
        initial_variance: variance
            .unwrap_or(UNKNOWN_VARIANCE)
            .clamp(1.0, UNKNOWN_VARIANCE),
    }
}
