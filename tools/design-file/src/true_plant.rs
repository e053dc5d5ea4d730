//! `[scenario.plant]`: the plant that is simulated, where it is not the one that was designed for.

use crate::assemble::names;
use crate::check;
use crate::complaint::{Complaint, Key, at};
use crate::defaults;
use crate::notes::Notes;
use crate::plant::{Found, Others, is_continuous};
use crate::schema::{self, DesignFile, PlantModel, TruePlant as Given};
use crate::wording::of_deviation;
use ftc_design::Signals;
use ftc_plant::deviation::{LONGEST_DELAY, Load, Port, Told};
use ftc_plant::{Deviation, SwitchedPlant, TruePlant};
use std::borrow::Cow;
use std::path::Path;

/// What is simulated: the modes themselves, the named model they are linearised from, or another
/// plant; other files are sought in `folder`.
///
/// # Errors
/// One sentence that names the key and what to do.
pub(crate) fn true_plant(
    file: &DesignFile,
    found: &Found,
    signals: &Signals,
    folder: &Path,
    notes: &Notes,
) -> Result<TruePlant, Complaint> {
    let nominal = match &file.plant {
        None => TruePlant::AsDesigned,
        Some(PlantModel::Rectifier(rectifier)) => TruePlant::Rectifier(rectifier.clone()),
    };
    let Some(given) = &file.scenario.plant else {
        return Ok(nominal);
    };
    let motion = motion(file, given, found, folder, notes, nominal)?;
    let end = end(file);
    let deviation = deviation(given, found, signals, &|key, from| {
        if from >= end {
            notes.add(beyond_the_end(key, from, end));
        }
    })?;
    Ok(motion.with_deviation(deviation))
}

/// When the scenario ends, in seconds.
pub(crate) fn end(file: &DesignFile) -> f64 {
    let steps = file.scenario.steps.unwrap_or(defaults::STEPS as i64);
    steps as f64 * file.sample_time
}

/// What is said of something that begins when the scenario is over.
pub(crate) fn beyond_the_end(key: &Key, from: f64, end: f64) -> String {
    format!(
        "{key}: it begins at {from} s, but the scenario ends at {end} s, so it never acts: raise scenario.steps, or let \
         it begin earlier"
    )
}

/// Other matrices, and errors of all of them.
fn motion(
    file: &DesignFile,
    given: &Given,
    found: &Found,
    folder: &Path,
    notes: &Notes,
    nominal: TruePlant,
) -> Result<TruePlant, Complaint> {
    let error = given.relative_error.unwrap_or(0.0);
    at("scenario.plant.relative_error", check::fraction(error))?;
    if given.modes.is_none() && given.continuous.is_some() {
        return Err(Complaint::of(
            "scenario.plant.continuous",
            "is about scenario.plant.mode, which is missing: leave it out",
        ));
    }
    if given.modes.is_none() && error == 0.0 {
        return Ok(nominal);
    }
    if file.plant.is_some() {
        let key = match given.modes {
            Some(_) => "scenario.plant.mode",
            None => "scenario.plant.relative_error",
        };
        return Err(Complaint::of(
            key,
            "changes matrices, but [plant] has none: leave it out",
        ));
    }
    let mut plant = match &given.modes {
        None => found.plant.clone(),
        Some(modes) => found
            .with_other_matrices(
                file,
                &Others {
                    modes,
                    continuous: given.continuous.unwrap_or(is_continuous(file)),
                    folder,
                    notes,
                },
            )
            .map_err(|what| what.inside("scenario.plant"))?,
    };
    if error > 0.0 {
        let seed = given.seed.map_or(Ok(defaults::SEED), |seed| {
            at("scenario.plant.seed", check::seed(seed))
        })?;
        plant = plant.perturbed(error, seed);
    }
    Ok(TruePlant::Linear { plant })
}

fn deviation(
    given: &Given,
    found: &Found,
    signals: &Signals,
    begins: &dyn Fn(&Key, f64),
) -> Result<Deviation, Complaint> {
    let dims = found.plant.dimensions();
    let input_gain = match &given.input_gain {
        None => Vec::new(),
        Some(gains) => at("scenario.plant.input_gain", gains.spread(dims.inputs))?,
    };
    let delay = |key: &str, samples: Option<i64>| {
        at(key, check::count(samples.unwrap_or(0), 0, LONGEST_DELAY))
    };
    let modes = mode_names(&found.plant);
    let told = each("told", &given.told, |told, key| {
        begins(key, told.from);
        Ok(Told {
            from: told.from,
            until: told.until,
            mode: at("mode", told.mode.index(&modes, "modes"))?,
        })
    });
    let names = Names::new(found, signals);
    let mut deviation = Deviation::default();
    deviation.input_gain = input_gain;
    deviation.sensor_delay = delay("scenario.plant.sensor_delay", given.sensor_delay)?;
    deviation.loads = each("loads", &given.loads, |load, key| {
        let found = self::load(load, &names)?;
        begins(key, found.from);
        Ok(found)
    })?;
    deviation.actuator_faults = each("actuator", &given.actuator, |fault, key| {
        let found = fault.actuator_fault(&names.inputs)?;
        begins(key, found.from);
        Ok(found)
    })?;
    deviation.mode_delay = delay("scenario.plant.mode_delay", given.mode_delay)? as u64;
    deviation.told = told?;
    deviation
        .check(&found.plant)
        .map_err(|error| of_deviation(&error))?;
    Ok(deviation)
}

/// What modes are called.
pub(crate) fn mode_names(plant: &SwitchedPlant) -> Vec<&str> {
    let modes = plant.modes.iter();
    modes.map(|mode| mode.name.as_str()).collect()
}

/// What the places are called on which a load may act.
struct Names<'a> {
    inputs: Vec<&'a str>,
    disturbances: Vec<Cow<'a, str>>,
    states: Vec<&'a str>,
}

impl<'a> Names<'a> {
    fn new(found: &Found, signals: &'a Signals) -> Self {
        let dims = found.plant.dimensions();
        let mut states = names(&signals.states);
        states.truncate(dims.states - found.held_inputs);
        let named = signals.disturbances.iter();
        let mut disturbances: Vec<Cow<str>> = named.map(|w| w.name.as_str().into()).collect();
        let rest = disturbances.len()..dims.disturbances;
        disturbances.extend(rest.map(|at| Cow::from(format!("w[{}]", at + 1))));
        Self {
            inputs: names(&signals.inputs),
            disturbances,
            states,
        }
    }
}

/// Resolves the entries of a list, and names the one that is wrong.
fn each<T, U>(
    key: &str,
    given: &Option<Vec<T>>,
    resolve: impl Fn(&T, &Key) -> Result<U, Complaint>,
) -> Result<Vec<U>, Complaint> {
    let entries = given.iter().flatten().enumerate();
    entries
        .map(|(index, entry)| {
            let key = Key::from("scenario.plant").then(key).entry(index);
            resolve(entry, &key).map_err(|what| what.inside(key))
        })
        .collect()
}

fn load(given: &schema::Load, names: &Names) -> Result<Load, Complaint> {
    let disturbances: Vec<&str> = names.disturbances.iter().map(AsRef::as_ref).collect();
    let port = match (&given.input, &given.disturbance, &given.state) {
        (Some(which), None, None) => {
            Port::Input(at("input", which.index(&names.inputs, "inputs"))?)
        }
        (None, Some(which), None) => Port::Disturbance(at(
            "disturbance",
            which.index(&disturbances, "disturbances"),
        )?),
        (None, None, Some(which)) => {
            Port::State(at("state", which.index(&names.states, "states"))?)
        }
        _ => {
            return Err(Complaint::general(
                "say where it acts: one of input, disturbance and state, with its number or its name",
            ));
        }
    };
    Ok(Load {
        at: port,
        from: given.from,
        until: given.until,
        size: given.size,
    })
}
