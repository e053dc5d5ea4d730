//! From a design file to a request the method understands: sizes, indices, defaults, refusals.
//!
//! Every error is the end of a sentence that begins with the file's name.

use crate::check;
use crate::complaint::{Complaint, Key, at};
use crate::estimator::estimator;
use crate::experiment::ScenarioContext;
use crate::healthy_log::Logs;
use crate::notes::Notes;
use crate::plant;
use crate::schema::{
    self, CompensationMethod, DesignFile, LyapunovKind, ObjectiveKind, ObserverKind, SignalInfo,
};
use crate::signal::Tables;
use crate::true_plant;
use crate::values::{NumberOrList, Which};
use crate::wording;
use ftc_control::parameters;
use ftc_design::assembly::{KnownDisturbance, Request};
use ftc_design::spec::LONGEST_LATENCY;
use ftc_design::words::counted;
use ftc_design::{ControlSpec, Lyapunov, Objective, ObserverSpec, Signal, Signals};
use ftc_plant::scaling::{Known, Scaling};
use ftc_plant::scenario::MOST_STEPS;
use ftc_plant::{Dimensions, OperatingPoint, SwitchedPlant};
use std::path::Path;

/// The largest number of states, inputs, outputs, disturbances or modes.
pub(crate) const LARGEST_SIZE: usize = 64;

/// Checks a design file and turns it into a request; other files are sought in `folder`, and `notes`
/// gets what the user should know of them.
///
/// # Errors
/// What is wrong with which key, and what to do.
pub(crate) fn request(
    file: &DesignFile,
    folder: &Path,
    notes: &Notes,
) -> Result<Request, Complaint> {
    at("name", check::identifier(&file.name))?;
    let given = plant::read(file, folder, notes)?;
    let signals = signals(&file.signals, &given)?;
    let true_plant = true_plant::true_plant(file, &given, &signals, folder, notes)?;
    let plant = given.plant;
    let dims = plant.dimensions();
    let disturbance = disturbance(file, dims)?;
    let mut control = control(&file.controller, &signals, dims)?;
    if let Some(wanted) = file.controller.internal_model {
        control.resonators = resonators(wanted, file.sample_time, disturbance.as_ref())?;
    }
    control
        .check(dims)
        .map_err(|error| wording::of_spec(&error))?;
    let observer = observer(&file.observer, &control);
    observer.check().map_err(|error| wording::of_spec(&error))?;
    let logs = Logs {
        plant: &plant,
        signals: &signals,
        folder,
        time: file.estimator.time.as_deref(),
        notes,
    };
    let estimator = estimator(&file.estimator, disturbance, dims, &logs)?;
    estimator
        .check_modes(plant.modes.len())
        .map_err(|error| wording::of_spec(&error))?;
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
            most_samples: MOST_STEPS as usize,
            notes,
        },
        end: true_plant::end(file),
    }
    .resolve()?;
    let mut request = Request::new(&file.name, plant, signals, scenario);
    request.true_plant = true_plant;
    request.control = control;
    request.bumpless = file.controller.bumpless.unwrap_or(request.bumpless);
    request.feedforward = file.controller.feedforward.unwrap_or(request.feedforward);
    request.observer = observer;
    request.estimator = estimator;
    request.compensation = compensation(file, request.compensation);
    Ok(request)
}

fn signals(given: &schema::Signals, found: &plant::Found) -> Result<Signals, Complaint> {
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
    let mut signals = Signals::new(inputs, outputs, states);
    signals.disturbances = disturbances;
    complete_nominal_values(&mut signals, plant);
    for signal in &mut signals.disturbances {
        signal.nominal = Some(signal.nominal)
            .filter(|n| n.is_finite())
            .unwrap_or(1.0);
    }
    Ok(signals)
}

/// The state that holds a past input.
fn held(input: &Signal) -> Signal {
    let mut signal = Signal::new(&format!("{} held", input.name));
    signal.unit = input.unit.clone();
    signal.nominal = input.nominal;
    signal
}

fn channels(
    key: &str,
    letter: &str,
    given: &Option<Vec<SignalInfo>>,
    size: usize,
    points: &[&[f64]],
) -> Result<Vec<Signal>, Complaint> {
    let list = Key::from("signals").then(key);
    let unnamed = vec![SignalInfo::default(); size];
    let given = given.as_ref().unwrap_or(&unnamed);
    if given.len() != size {
        return Err(Complaint::of(
            list,
            format!(
                "has {}, but the plant has {size}: give one for each",
                counted(given.len(), "entry", "entries")
            ),
        ));
    }
    let signals: Result<Vec<Signal>, Complaint> = given
        .iter()
        .enumerate()
        .map(|(index, info)| {
            let largest = points.iter().map(|point| point[index].abs());
            let name = format!("{letter}[{}]", index + 1);
            signal(info, name, largest.fold(0.0, f64::max))
                .map_err(|what| what.inside(list.clone().entry(index)))
        })
        .collect();
    let signals = signals?;
    for (index, signal) in signals.iter().enumerate() {
        if signals[..index]
            .iter()
            .any(|other| other.name == signal.name)
        {
            return Err(Complaint::of(
                list.entry(index).then("name"),
                format!(
                    "= \"{}\" is used twice: give each signal its own",
                    signal.name
                ),
            ));
        }
    }
    Ok(signals)
}

/// One signal; `operating` is its largest magnitude among the operating points.
fn signal(info: &SignalInfo, default_name: String, operating: f64) -> Result<Signal, Complaint> {
    let SignalInfo { min, max, .. } = *info;
    for (key, bound) in [("min", min), ("max", max)] {
        at(key, bound.map_or(Ok(()), check::number))?;
    }
    if let (Some(min), Some(max)) = (min, max)
        && min >= max
    {
        return Err(Complaint::of(
            "min",
            format!("is {min}, max is {max}: give a min below max"),
        ));
    }
    at("nominal", info.nominal.map_or(Ok(()), check::positive))?;
    let range = min.zip(max).map(|(min, max)| (max - min) / 2.0);
    let operating = (operating > 0.0).then_some(operating);
    let name = info.name.clone().unwrap_or(default_name);
    if name.trim().is_empty() || !check::printable(&name) {
        return Err(Complaint::of(
            "name",
            "is empty or not printable: give a name, or leave the key out",
        ));
    }
    let unit = info.unit.clone().filter(|unit| !unit.trim().is_empty());
    if unit.as_deref().is_some_and(|unit| !check::printable(unit)) {
        return Err(Complaint::of(
            "unit",
            "has a character that is not printable: give the unit's letters",
        ));
    }
    let mut signal = Signal::new(&name);
    signal.unit = unit;
    signal.nominal = info.nominal.or(operating).or(range).unwrap_or(UNKNOWN);
    signal.min = min;
    signal.max = max;
    Ok(signal)
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
) -> Result<ControlSpec, Complaint> {
    let usual = ControlSpec::tracking(tracked(given, signals, dims)?, &signals.scaling());
    let latency = given.latency.map_or(Ok(usual.latency), |latency| {
        at(
            "controller.latency",
            check::count(latency, 0, LONGEST_LATENCY),
        )
    })?;
    let mut spec = usual;
    spec.latency = latency;
    spec.lyapunov = given.lyapunov.map_or(spec.lyapunov, lyapunov);
    spec.decay = given.decay.unwrap_or(spec.decay);
    spec.objective = match given.objective {
        None => spec.objective,
        Some(ObjectiveKind::Attenuation) => Objective::Attenuation,
        Some(ObjectiveKind::Decay) => Objective::Decay,
    };
    spec.output_weight = weight("output_weight", &given.output_weight, spec.output_weight)?;
    spec.integral_weight = weight(
        "integral_weight",
        &given.integral_weight,
        spec.integral_weight,
    )?;
    spec.input_weight = weight("input_weight", &given.input_weight, spec.input_weight)?;
    Ok(spec)
}

/// The angles of the internal model's resonators; none where no internal model is wanted.
fn resonators(
    wanted: bool,
    sample_time: f64,
    disturbance: Option<&KnownDisturbance>,
) -> Result<Vec<f64>, Complaint> {
    match (wanted, disturbance) {
        (false, _) => Ok(Vec::new()),
        (true, Some(known)) => Ok(known.angles(sample_time)),
        (true, None) => Err(Complaint::of(
            "controller.internal_model",
            "= true needs to know the disturbance: give [disturbance] with its period",
        )),
    }
}

fn lyapunov(kind: LyapunovKind) -> Lyapunov {
    match kind {
        LyapunovKind::Common => Lyapunov::Common,
        LyapunovKind::Switched => Lyapunov::Switched,
        LyapunovKind::Dwell => Lyapunov::Dwell,
    }
}

fn tracked(
    given: &schema::Controller,
    signals: &Signals,
    dims: Dimensions,
) -> Result<Vec<usize>, Complaint> {
    let Some(given) = &given.tracked else {
        return Ok((0..dims.outputs.min(dims.inputs)).collect());
    };
    let names = names(&signals.outputs);
    let key = Key::from("controller.tracked");
    let output = |(index, which): (usize, &Which)| {
        at(key.clone().entry(index), which.index(&names, "outputs"))
    };
    given.iter().enumerate().map(output).collect()
}

/// What signals are called.
pub(crate) fn names(signals: &[Signal]) -> Vec<&str> {
    signals.iter().map(|signal| signal.name.as_str()).collect()
}

/// The weight of each channel.
fn weight(key: &str, given: &Option<NumberOrList>, usual: Vec<f64>) -> Result<Vec<f64>, Complaint> {
    let Some(given) = given else {
        return Ok(usual);
    };
    at(Key::from("controller").then(key), given.spread(usual.len()))
}

fn observer(given: &schema::Observer, control: &ControlSpec) -> ObserverSpec {
    use ftc_design::ObserverChoice as Kind;
    let mut observer = ObserverSpec::beside(control);
    observer.kind = match given.kind {
        None => observer.kind,
        Some(ObserverKind::Uio) => Kind::Uio,
        Some(ObserverKind::Luenberger) => Kind::Luenberger,
        Some(ObserverKind::Kalman) => Kind::Kalman,
        Some(ObserverKind::Auto) => Kind::Auto,
    };
    observer.decay = given.decay.unwrap_or(observer.decay);
    observer
}

fn disturbance(file: &DesignFile, dims: Dimensions) -> Result<Option<KnownDisturbance>, Complaint> {
    let Some(given) = &file.disturbance else {
        return Ok(None);
    };
    let mut disturbance = KnownDisturbance::new(given.period);
    disturbance.harmonics = given.harmonics.unwrap_or(disturbance.harmonics);
    if let Some(amplitude) = &given.amplitude {
        let values = at("disturbance.amplitude", amplitude.spread(dims.disturbances))?;
        disturbance.amplitude = Some(values);
    }
    let checked = disturbance.check(file.sample_time, dims.disturbances);
    checked.map_err(|error| wording::of_disturbance(&error))?;
    Ok(Some(disturbance))
}

fn compensation(file: &DesignFile, usual: parameters::Compensation) -> parameters::Compensation {
    match file.compensation.method {
        None => usual,
        Some(CompensationMethod::VirtualSensor) => parameters::Compensation::VirtualSensor,
        Some(CompensationMethod::Additive) => parameters::Compensation::Additive,
        Some(CompensationMethod::None) => parameters::Compensation::None,
    }
}
