//! From a design file to a request the method understands: sizes, indices, defaults, refusals.
//!
//! Every error is the end of a sentence that begins with the file's name.

use crate::check;
use crate::defaults;
use crate::healthy_log::Logs;
use crate::notes::Notes;
use crate::plant;
use crate::schema::{
    self, CompensationMethod, DesignFile, EstimatorMethod, LyapunovKind, ObjectiveKind,
    ObserverKind, SignalInfo,
};
use crate::signal::{Signal as SignalOverTime, Tables};
use crate::true_plant;
use crate::values::{NameOrList, NumberOrList};
use ftc_control::parameters;
use ftc_design::assembly::{DatabaseSource, EstimatorSpec, KnownDisturbance, Request, Threshold};
use ftc_design::{ControlSpec, HypothesesSpec, Lyapunov, Objective, ObserverSpec, Signal, Signals};
use ftc_plant::scaling::{Known, Scaling};
use ftc_plant::scenario::{ModeInterval, Waveform};
use ftc_plant::{Dimensions, OperatingPoint, Scenario, SwitchedPlant};
use std::path::Path;

/// The largest number of states, inputs, outputs, disturbances or modes.
pub(crate) const LARGEST_SIZE: usize = 64;
/// The most samples of a scenario.
const MOST_STEPS: usize = 1_000_000;
/// The longest debounce in samples, and the most repetitions of a reading.
const LONGEST_DEBOUNCE: usize = 10_000;
/// How the names of logs end.
const LOG_ENDINGS: [&str; 4] = [".csv", ".tsv", ".txt", ".dat"];
/// The most harmonics of a disturbance.
const MOST_HARMONICS: usize = 50;

/// Checks a design file and turns it into a request; other files are sought in `folder`, and `notes`
/// gets what the user should know of them.
///
/// # Errors
/// One sentence that names the key and what to do.
pub(crate) fn request(file: &DesignFile, folder: &Path, notes: &Notes) -> Result<Request, String> {
    at("name", check::identifier(&file.name))?;
    let given = plant::read(file, folder, notes)?;
    let signals = signals(&file.signals, &given)?;
    let true_plant = true_plant::true_plant(file, &given, folder)?;
    let plant = given.plant;
    let dims = plant.dimensions();
    let disturbance = disturbance(file, dims)?;
    let control = ControlSpec {
        resonators: resonators(file, disturbance.as_ref())?,
        ..control(&file.controller, &signals, dims)?
    };
    let observer = observer(&file.observer, &control)?;
    let logs = Logs {
        plant: &plant,
        signals: &signals,
        folder,
        time: file.estimator.time.as_deref(),
        notes,
    };
    let estimator = estimator(&file.estimator, disturbance, dims, &logs)?;
    let scenario = ScenarioContext {
        scenario: &file.scenario,
        known: estimator.disturbance.as_ref(),
        tracked: &control.tracked,
        signals: &signals,
        plant: &plant,
        dims,
        tables: Tables {
            folder,
            sample_time: plant.sample_time,
            most_samples: MOST_STEPS,
            notes,
        },
    }
    .resolve()?;
    Ok(Request {
        name: file.name.clone(),
        signals,
        plant,
        true_plant,
        control,
        bumpless: file.controller.bumpless.unwrap_or(defaults::BUMPLESS),
        feedforward: file.controller.feedforward.unwrap_or(defaults::FEEDFORWARD),
        observer,
        estimator,
        compensation: compensation(file),
        scenario,
    })
}

/// Puts the key before a complaint.
pub(crate) fn at<T>(key: &str, result: Result<T, String>) -> Result<T, String> {
    result.map_err(|what| format!("{key} {what}"))
}

fn signals(given: &schema::Signals, found: &plant::Found) -> Result<Signals, String> {
    let plant = &found.plant;
    let dims = plant.dimensions();
    let points = |pick: fn(&OperatingPoint) -> &Vec<f64>| -> Vec<&[f64]> {
        let modes = plant.modes.iter();
        modes.map(|m| pick(&m.operating_point).as_slice()).collect()
    };
    let inputs = channels("inputs", "u", &given.inputs, dims.inputs, &points(|p| &p.u))?;
    let outputs = channels(
        "outputs",
        "y",
        &given.outputs,
        dims.outputs,
        &points(|p| &p.y),
    )?;
    let own = dims.states - found.held_inputs;
    let mut states = channels("states", "x", &given.states, own, &points(|p| &p.x))?;
    states.extend(inputs.iter().take(found.held_inputs).map(held));
    let disturbances = match given.disturbances {
        Some(_) => channels(
            "disturbances",
            "w",
            &given.disturbances,
            dims.disturbances,
            &[],
        )?,
        None => Vec::new(),
    };
    let mut signals = Signals {
        inputs,
        outputs,
        states,
        disturbances,
    };
    complete_nominal_values(&mut signals, plant);
    for signal in &mut signals.disturbances {
        signal.nominal = Some(signal.nominal)
            .filter(|n| n.is_finite())
            .unwrap_or(1.0);
    }
    Ok(signals)
}

/// The state that remembers an input.
fn held(input: &Signal) -> Signal {
    Signal {
        name: format!("{} held", input.name),
        unit: input.unit.clone(),
        nominal: input.nominal,
        min: None,
        max: None,
    }
}

fn channels(
    key: &str,
    letter: &str,
    given: &Option<Vec<SignalInfo>>,
    size: usize,
    points: &[&[f64]],
) -> Result<Vec<Signal>, String> {
    let unnamed = vec![SignalInfo::default(); size];
    let given = given.as_ref().unwrap_or(&unnamed);
    if given.len() != size {
        return Err(format!(
            "signals.{key} has {} entries: the plant needs {size}",
            given.len()
        ));
    }
    let signals: Result<Vec<Signal>, String> = given
        .iter()
        .enumerate()
        .map(|(index, info)| {
            let largest = points.iter().map(|point| point[index].abs());
            let name = format!("{letter}[{}]", index + 1);
            signal(info, name, largest.fold(0.0, f64::max))
                .map_err(|what| format!("signals.{key}[{}].{what}", index + 1))
        })
        .collect();
    let signals = signals?;
    for (index, signal) in signals.iter().enumerate() {
        if signals[..index]
            .iter()
            .any(|other| other.name == signal.name)
        {
            return Err(format!(
                "signals.{key}[{}].name \"{}\" is used twice: give each signal its own",
                index + 1,
                signal.name
            ));
        }
    }
    Ok(signals)
}

/// One signal; `operating` is its largest magnitude among the operating points.
fn signal(info: &SignalInfo, default_name: String, operating: f64) -> Result<Signal, String> {
    let SignalInfo { min, max, .. } = *info;
    for (key, bound) in [("min", min), ("max", max)] {
        at(key, bound.map_or(Ok(()), check::number))?;
    }
    if let (Some(min), Some(max)) = (min, max)
        && min >= max
    {
        return Err(format!("min is {min}, max is {max}: give a min below max"));
    }
    at("nominal", info.nominal.map_or(Ok(()), check::positive))?;
    let range = min.zip(max).map(|(min, max)| (max - min) / 2.0);
    let operating = (operating > 0.0).then_some(operating);
    let name = info.name.clone().unwrap_or(default_name);
    if name.trim().is_empty() || !check::printable(&name) {
        return Err("name is empty or not printable: give a name, or leave the key out".into());
    }
    let unit = info.unit.clone().filter(|unit| !unit.trim().is_empty());
    if unit.as_deref().is_some_and(|unit| !check::printable(unit)) {
        return Err("unit has a character that is not printable: give the unit's letters".into());
    }
    Ok(Signal {
        name,
        unit,
        nominal: info.nominal.or(operating).or(range).unwrap_or(UNKNOWN),
        min,
        max,
    })
}

/// Marks a nominal value of which nothing is known until the plant has been looked at.
const UNKNOWN: f64 = f64::NAN;

/// A plant whose balanced magnitudes are all nearer to 1 than this factor is left in its units.
const UNLIKE: f64 = 1e3;

/// Gives every signal without a nominal value one: 1, or that of the balanced plant where any is far
/// from 1. Those that are known stay as they are.
fn complete_nominal_values(signals: &mut Signals, plant: &SwitchedPlant) {
    let known = |signals: &[Signal]| -> Vec<Option<f64>> {
        let nominal = signals.iter().map(|signal| signal.nominal);
        nominal
            .map(|value| value.is_finite().then_some(value))
            .collect()
    };
    let found = Scaling::completed(
        plant,
        &Known {
            states: known(&signals.states),
            inputs: known(&signals.inputs),
            outputs: known(&signals.outputs),
        },
    );
    let mut unknown: Vec<(&mut f64, f64)> = [
        (&mut signals.states, found.states),
        (&mut signals.inputs, found.inputs),
        (&mut signals.outputs, found.outputs),
    ]
    .into_iter()
    .flat_map(|(signals, found)| signals.iter_mut().map(|s| &mut s.nominal).zip(found))
    .filter(|(nominal, _)| !nominal.is_finite())
    .collect();
    let far = unknown
        .iter()
        .any(|(_, found)| !(1.0 / UNLIKE..=UNLIKE).contains(found));
    for (nominal, found) in &mut unknown {
        **nominal = if far { two_digits(*found) } else { 1.0 };
    }
}

/// The nearest number with two significant digits, so that what is printed is what is meant.
fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(1.0)
}

fn control(
    given: &schema::Controller,
    signals: &Signals,
    dims: Dimensions,
) -> Result<ControlSpec, String> {
    let tracked = tracked(given, dims)?;
    let latency = given.latency.map_or(Ok(defaults::LATENCY), |latency| {
        at("controller.latency", check::count(latency, 0, 1))
    })?;
    let decay = given.decay.unwrap_or(defaults::DECAY);
    at("controller.decay", check::decay(decay))?;
    let outputs: Vec<f64> = tracked
        .iter()
        .map(|&o| signals.outputs[o].nominal)
        .collect();
    let inputs: Vec<f64> = signals.inputs.iter().map(|input| input.nominal).collect();
    let output_weight = weight(
        "output_weight",
        &given.output_weight,
        defaults::OUTPUT_WEIGHT,
        &outputs,
    )?;
    let integral_weight = weight(
        "integral_weight",
        &given.integral_weight,
        defaults::INTEGRAL_WEIGHT,
        &outputs,
    )?;
    let input_weight = weight(
        "input_weight",
        &given.input_weight,
        defaults::INPUT_WEIGHT,
        &inputs,
    )?;
    Ok(ControlSpec {
        tracked,
        latency,
        lyapunov: lyapunov(given.lyapunov.unwrap_or(defaults::LYAPUNOV)),
        decay,
        objective: match given.objective.unwrap_or(defaults::OBJECTIVE) {
            ObjectiveKind::Attenuation => Objective::Attenuation,
            ObjectiveKind::Decay => Objective::Decay,
        },
        resonators: Vec::new(),
        output_weight,
        integral_weight,
        input_weight,
    })
}

/// The angles of the internal model's resonators; none where no internal model is wanted.
fn resonators(
    file: &DesignFile,
    disturbance: Option<&KnownDisturbance>,
) -> Result<Vec<f64>, String> {
    let wanted = file.controller.internal_model;
    match (wanted.unwrap_or(defaults::INTERNAL_MODEL), disturbance) {
        (false, _) => Ok(Vec::new()),
        (true, Some(known)) => Ok(known.angles(file.sample_time)),
        (true, None) => Err(
            "controller.internal_model = true needs to know the disturbance: give [disturbance] with its period"
                .into(),
        ),
    }
}

fn lyapunov(kind: LyapunovKind) -> Lyapunov {
    match kind {
        LyapunovKind::Common => Lyapunov::Common,
        LyapunovKind::Switched => Lyapunov::Switched,
        LyapunovKind::Dwell => Lyapunov::Dwell,
    }
}

fn tracked(given: &schema::Controller, dims: Dimensions) -> Result<Vec<usize>, String> {
    let Some(numbers) = &given.tracked else {
        return Ok((0..dims.outputs.min(dims.inputs)).collect());
    };
    if numbers.is_empty() {
        return Err("controller.tracked is empty: name at least one output, counted from 1".into());
    }
    let mut tracked = Vec::new();
    for &number in numbers {
        let output = check::index("controller.tracked:", number, dims.outputs, "outputs")
            .map_err(|what| what.replace(": is", " contains a number that is"))?;
        if tracked.contains(&output) {
            return Err(format!(
                "controller.tracked names output {number} twice: name each output once"
            ));
        }
        tracked.push(output);
    }
    if tracked.len() > dims.inputs {
        return Err(format!(
            "controller.tracked names {} outputs, but the plant has {} inputs: track at most as many outputs as there are inputs",
            tracked.len(),
            dims.inputs
        ));
    }
    Ok(tracked)
}

/// The weight of each channel; by default relative to the nominal values.
fn weight(
    key: &str,
    given: &Option<NumberOrList>,
    default: f64,
    nominal: &[f64],
) -> Result<Vec<f64>, String> {
    let key = format!("controller.{key}");
    let Some(given) = given else {
        return Ok(nominal.iter().map(|value| default / value).collect());
    };
    let weights = at(&key, given.spread(nominal.len()))?;
    at(&key, check::each(&weights, check::not_negative))?;
    Ok(weights)
}

fn observer(given: &schema::Observer, control: &ControlSpec) -> Result<ObserverSpec, String> {
    use ftc_design::ObserverChoice as Kind;
    let decay = given.decay.unwrap_or(control.decay);
    at("observer.decay", check::decay(decay))?;
    Ok(ObserverSpec {
        kind: match given.kind.unwrap_or(defaults::OBSERVER) {
            ObserverKind::Uio => Kind::Uio,
            ObserverKind::Luenberger => Kind::Luenberger,
            ObserverKind::Kalman => Kind::Kalman,
            ObserverKind::Auto => Kind::Auto,
        },
        decay,
        lyapunov: control.lyapunov,
        noise: Vec::new(),
    })
}

fn disturbance(file: &DesignFile, dims: Dimensions) -> Result<Option<KnownDisturbance>, String> {
    let Some(given) = &file.disturbance else {
        return Ok(None);
    };
    at("disturbance.period", check::positive(given.period))?;
    let shortest = 2.0 * file.sample_time;
    let harmonics = match given.harmonics {
        None => defaults::HARMONICS,
        Some(count) => {
            let count = i64::try_from(count).unwrap_or(i64::MAX);
            at(
                "disturbance.harmonics",
                check::count(count, 1, MOST_HARMONICS),
            )?
        }
    };
    if given.period / harmonics as f64 <= shortest {
        return Err(format!(
            "disturbance.period is {}: {harmonics} harmonics of it need a period above {} seconds at this sample_time",
            given.period,
            shortest * harmonics as f64
        ));
    }
    let amplitude = match &given.amplitude {
        None => None,
        Some(amplitude) => {
            let values = at("disturbance.amplitude", amplitude.spread(dims.disturbances))?;
            at(
                "disturbance.amplitude",
                check::each(&values, check::not_negative),
            )?;
            Some(values)
        }
    };
    Ok(Some(KnownDisturbance {
        period: given.period,
        harmonics,
        amplitude,
    }))
}

fn estimator(
    given: &schema::Estimator,
    disturbance: Option<KnownDisturbance>,
    dims: Dimensions,
    logs: &Logs,
) -> Result<EstimatorSpec, String> {
    let database = database(given, logs)?;
    let usual = match database {
        DatabaseSource::Recorded(_) => EstimatorMethod::Reference,
        DatabaseSource::Commission | DatabaseSource::Model => defaults::ESTIMATOR,
    };
    let method = match given.method.unwrap_or(usual) {
        EstimatorMethod::Observer => parameters::EstimatorMethod::Observer,
        EstimatorMethod::Reference => parameters::EstimatorMethod::Reference,
        EstimatorMethod::Sliding => parameters::EstimatorMethod::Sliding,
        EstimatorMethod::None => parameters::EstimatorMethod::None,
    };
    let response_length = match given.response_length {
        None => None,
        Some(length) => Some(at(
            "estimator.response_length",
            check::count(length, 1, ftc_design::commissioning::LONGEST_RESPONSE),
        )?),
    };
    let debounce = match given.debounce {
        None => defaults::DEBOUNCE,
        Some(samples) => at(
            "estimator.debounce",
            check::count(samples, 1, LONGEST_DEBOUNCE),
        )? as u32,
    };
    let stuck_after = match given.stuck_after {
        None => defaults::STUCK_AFTER,
        Some(samples) => at(
            "estimator.stuck_after",
            check::count(samples, 0, LONGEST_DEBOUNCE),
        )? as u32,
    };
    Ok(EstimatorSpec {
        method,
        response_length,
        database,
        threshold: threshold(given, dims)?,
        debounce,
        stuck_after,
        adapt: given.adapt.unwrap_or(defaults::ADAPT),
        disturbance,
        hypotheses: hypotheses(given, dims)?,
    })
}

fn hypotheses(given: &schema::Estimator, dims: Dimensions) -> Result<HypothesesSpec, String> {
    let usual = HypothesesSpec::default();
    let within = |key: &str, value: Option<f64>, usual: f64, least: f64, most: f64| match value {
        None => Ok(usual),
        Some(value) if (least..=most).contains(&value) => Ok(value),
        Some(value) => Err(format!(
            "estimator.{key} is {value}: it must lie between {least} and {most}"
        )),
    };
    let sizes = |key: &str, value: &Option<NumberOrList>, count: usize| match value {
        None => Ok(None),
        Some(value) => {
            let values = at(key, value.spread(count))?;
            at(key, check::each(&values, check::positive))?;
            Ok::<_, String>(Some(values))
        }
    };
    Ok(HypothesesSpec {
        model_error: within(
            "model_error",
            given.model_error,
            usual.model_error,
            0.0,
            1.0,
        )?,
        fault_rate: within("fault_rate", given.fault_rate, usual.fault_rate, 1e-12, 0.1)?,
        fault_length: within(
            "fault_length",
            given.fault_length,
            usual.fault_length,
            2.0,
            1e9,
        )?,
        ambiguous: match given.ambiguous {
            None => usual.ambiguous,
            Some(schema::Ambiguous::TrustSensors) => parameters::Ambiguous::TrustSensors,
            Some(schema::Ambiguous::TrustModel) => parameters::Ambiguous::TrustModel,
        },
        authority: sizes("estimator.authority", &given.authority, dims.outputs)?,
        input_load: sizes("estimator.input_load", &given.input_load, dims.inputs)?,
    })
}

fn database(given: &schema::Estimator, logs: &Logs) -> Result<DatabaseSource, String> {
    let is_log = |name: &str| {
        let name = name.to_lowercase();
        LOG_ENDINGS.iter().any(|ending| name.ends_with(ending))
    };
    let files = match &given.database {
        None => return Ok(defaults::DATABASE),
        Some(NameOrList::Name(name)) if name == "commission" => {
            return Ok(DatabaseSource::Commission);
        }
        Some(NameOrList::Name(name)) if name == "model" => return Ok(DatabaseSource::Model),
        Some(NameOrList::Name(name)) if !is_log(name) => {
            return Err(format!(
                "estimator.database = \"{}\" is not a known value and no CSV file: {}",
                crate::sentence::shorten(name),
                crate::suggest::nearest(name, &["commission", "model"])
            ));
        }
        Some(files) => files,
    };
    if let NameOrList::List(names) = files
        && let Some(name) = names.iter().find(|name| !is_log(name))
    {
        return Err(format!(
            "estimator.database lists \"{}\": list CSV files only, one per mode",
            crate::sentence::shorten(name)
        ));
    }
    if !matches!(given.method, None | Some(EstimatorMethod::Reference)) {
        return Err(
            "estimator.database names a log, which only method = \"reference\" uses: change one of them"
                .into(),
        );
    }
    at("estimator.database", logs.read(files)).map(DatabaseSource::Recorded)
}

fn threshold(given: &schema::Estimator, dims: Dimensions) -> Result<Threshold, String> {
    match (&given.threshold, given.sigmas) {
        (Some(_), Some(_)) => Err(
            "estimator.threshold and estimator.sigmas exclude each other: give one of them".into(),
        ),
        (Some(threshold), None) => {
            let values = at("estimator.threshold", threshold.spread(dims.outputs))?;
            at("estimator.threshold", check::each(&values, check::positive))?;
            Ok(Threshold::Given(values))
        }
        (None, sigmas) => {
            let sigmas = sigmas.unwrap_or(defaults::SIGMAS);
            at("estimator.sigmas", check::positive(sigmas))?;
            Ok(Threshold::Sigmas(sigmas))
        }
    }
}

fn compensation(file: &DesignFile) -> parameters::Compensation {
    match file.compensation.method.unwrap_or(defaults::COMPENSATION) {
        CompensationMethod::VirtualSensor => parameters::Compensation::VirtualSensor,
        CompensationMethod::Additive => parameters::Compensation::Additive,
        CompensationMethod::None => parameters::Compensation::None,
    }
}

/// Everything the scenario depends on.
struct ScenarioContext<'a> {
    scenario: &'a schema::Scenario,
    known: Option<&'a KnownDisturbance>,
    tracked: &'a [usize],
    signals: &'a Signals,
    plant: &'a SwitchedPlant,
    dims: Dimensions,
    tables: Tables<'a>,
}

impl ScenarioContext<'_> {
    fn resolve(&self) -> Result<Scenario, String> {
        let given = self.scenario;
        let steps = given.steps.map_or(Ok(defaults::STEPS), |steps| {
            at("scenario.steps", check::count(steps, 1, MOST_STEPS)).map(|steps| steps as u64)
        })?;
        let seed = given.seed.map_or(Ok(defaults::SEED), |seed| {
            u64::try_from(seed)
                .map_err(|_| format!("scenario.seed is {seed}: give a whole number, 0 or more"))
        })?;
        let (outputs, disturbances) = (self.dims.outputs, self.dims.disturbances);
        let schedule = self.schedule()?;
        let first = schedule[0].mode;
        Ok(Scenario {
            steps,
            noise: self.noise()?,
            seed,
            reference: self.channels("reference", &given.reference, self.tracked.len(), |at| {
                self.step(at, first, steps)
            })?,
            fault: self.channels("fault", &given.fault, outputs, |_| Waveform::ZERO)?,
            disturbance: self.channels("disturbance", &given.disturbance, disturbances, |at| {
                self.expected_disturbance(at)
            })?,
            events: self.events()?,
            schedule,
        })
    }

    fn noise(&self) -> Result<Vec<f64>, String> {
        let outputs = self.dims.outputs;
        let Some(given) = &self.scenario.noise else {
            return Ok(vec![0.0; outputs]);
        };
        let noise = at("scenario.noise", given.spread(outputs))?;
        at("scenario.noise", check::each(&noise, check::not_negative))?;
        Ok(noise)
    }

    fn schedule(&self) -> Result<Vec<ModeInterval>, String> {
        let whole = [schema::ModeInterval { from: 0.0, mode: 1 }];
        let given = self.scenario.schedule.as_deref().unwrap_or(&whole);
        if given.first().is_none_or(|interval| interval.from != 0.0) {
            return Err(
                "scenario.schedule must start at time 0: let its first entry say from = 0".into(),
            );
        }
        let ascending =
            |pair: &[schema::ModeInterval]| pair[0].from < pair[1].from && pair[1].from.is_finite();
        if let Some(pair) = given.windows(2).find(|pair| !ascending(pair)) {
            return Err(format!(
                "scenario.schedule goes from time {} to {}: give the times in ascending order",
                pair[0].from, pair[1].from
            ));
        }
        let total = self.plant.modes.len();
        let resolve = |(entry, interval): (usize, &schema::ModeInterval)| {
            let what = format!("scenario.schedule[{}].mode", entry + 1);
            let mode = check::index(&what, interval.mode, total, "modes")?;
            Ok(ModeInterval {
                from: interval.from,
                mode,
            })
        };
        given.iter().enumerate().map(resolve).collect()
    }

    fn channels(
        &self,
        key: &str,
        given: &Option<Vec<SignalOverTime>>,
        size: usize,
        default: impl Fn(usize) -> Waveform,
    ) -> Result<Vec<Waveform>, String> {
        let Some(given) = given else {
            return Ok((0..size).map(default).collect());
        };
        if given.len() != size {
            return Err(format!(
                "scenario.{key} has {} signals: give {size}, one per channel",
                given.len()
            ));
        }
        let waveform = |(index, signal): (usize, &SignalOverTime)| {
            signal
                .waveform(self.tables)
                .map_err(|what| format!("scenario.{key}[{}]: {what}", index + 1))
        };
        given.iter().enumerate().map(waveform).collect()
    }

    fn events(&self) -> Result<Vec<ftc_plant::scenario::FaultEvent>, String> {
        let events = self.scenario.events.iter().flatten().enumerate();
        events
            .map(|(index, event)| {
                event
                    .fault(self.dims.outputs)
                    .map_err(|what| format!("scenario.events[{}]: {what}", index + 1))
            })
            .collect()
    }

    /// A step of a tracked output from its operating point in the first mode.
    fn step(&self, tracked: usize, first_mode: usize, steps: u64) -> Waveform {
        let output = self.tracked[tracked];
        let start = self.plant.modes[first_mode].operating_point.y[output];
        let nominal = self.signals.outputs[output].nominal;
        let height = if nominal == 1.0 { 1.0 } else { nominal / 5.0 };
        let time = (steps / 10).max(1) as f64 * self.plant.sample_time;
        Waveform::Steps {
            points: vec![[0.0, start], [time, start + height]],
        }
    }

    /// A sine of the known period and amplitude.
    fn expected_disturbance(&self, channel: usize) -> Waveform {
        let sine = self.known.and_then(|known| {
            let amplitude = *known.amplitude.as_ref()?.get(channel)?;
            Some(Waveform::Sine {
                amplitude,
                period: known.period,
                phase: 0.0,
                offset: 0.0,
            })
        });
        sine.unwrap_or(Waveform::ZERO)
    }
}
