//! `[scenario.plant]`: the plant that is simulated, where it is not the one that was designed for.

use crate::assemble::at;
use crate::check;
use crate::plant::Found;
use crate::schema::{self, DesignFile, PlantModel, TruePlant as Given};
use crate::signal::{finite, interval};
use ftc_plant::deviation::{LONGEST_DELAY, Load, Port, Told};
use ftc_plant::{Deviation, Dimensions, TruePlant};
use std::path::Path;

/// Seed of relative errors, where none is given.
const SEED: u64 = 1;

/// What is simulated: the modes themselves, the named model they are linearised from, or another
/// plant; other files are sought in `folder`.
///
/// # Errors
/// One sentence that names the key and what to do.
pub(crate) fn true_plant(
    file: &DesignFile,
    found: &Found,
    folder: &Path,
) -> Result<TruePlant, String> {
    let nominal = match &file.plant {
        None => TruePlant::AsDesigned,
        Some(PlantModel::Rectifier(rectifier)) => TruePlant::Rectifier(rectifier.clone()),
    };
    let Some(given) = &file.scenario.plant else {
        return Ok(nominal);
    };
    let motion = motion(file, given, found, folder, nominal)?;
    let deviation = deviation(given, found)?;
    Ok(motion.with_deviation(deviation))
}

/// Other matrices, and errors of all of them.
fn motion(
    file: &DesignFile,
    given: &Given,
    found: &Found,
    folder: &Path,
    nominal: TruePlant,
) -> Result<TruePlant, String> {
    let error = given.relative_error.unwrap_or(0.0);
    at("scenario.plant.relative_error", check::fraction(error))?;
    if given.modes.is_none() && error == 0.0 {
        return Ok(nominal);
    }
    if file.plant.is_some() {
        return Err(
            "scenario.plant.mode and relative_error change matrices, but [plant] has none: leave them out".into(),
        );
    }
    let mut plant = match &given.modes {
        None => found.plant.clone(),
        Some(modes) => found
            .with_other_matrices(file, modes, folder)
            .map_err(|what| format!("scenario.plant: {what}"))?,
    };
    if error > 0.0 {
        let seed = given.seed.map_or(Ok(SEED), |seed| {
            u64::try_from(seed).map_err(|_| {
                format!("scenario.plant.seed is {seed}: give a whole number, 0 or more")
            })
        })?;
        plant = plant.perturbed(error, seed);
    }
    Ok(TruePlant::Linear { plant })
}

fn deviation(given: &Given, found: &Found) -> Result<Deviation, String> {
    let dims = found.plant.dimensions();
    let modes = found.plant.modes.len();
    let input_gain = match &given.input_gain {
        None => Vec::new(),
        Some(gains) => {
            let gains = at("scenario.plant.input_gain", gains.spread(dims.inputs))?;
            at(
                "scenario.plant.input_gain",
                check::each(&gains, check::number),
            )?;
            gains
        }
    };
    let delay = |key: &str, samples: Option<i64>| {
        at(key, check::count(samples.unwrap_or(0), 0, LONGEST_DELAY))
    };
    let told = each("told", &given.told, |told| {
        interval(told.from, told.until)?;
        let mode = check::index("mode", told.mode, modes, "modes")?;
        Ok(Told {
            from: told.from,
            until: told.until,
            mode,
        })
    });
    let own = Dimensions {
        states: dims.states - found.held_inputs,
        ..dims
    };
    Ok(Deviation {
        input_gain,
        sensor_delay: delay("scenario.plant.sensor_delay", given.sensor_delay)?,
        loads: each("loads", &given.loads, |load| self::load(load, own))?,
        actuator_faults: each("actuator", &given.actuator, |fault| {
            fault.actuator_fault(dims.inputs)
        })?,
        mode_delay: delay("scenario.plant.mode_delay", given.mode_delay)? as u64,
        told: told?,
    })
}

/// Resolves the entries of a list, and names the one that is wrong.
fn each<T, U>(
    key: &str,
    given: &Option<Vec<T>>,
    resolve: impl Fn(&T) -> Result<U, String>,
) -> Result<Vec<U>, String> {
    let entries = given.iter().flatten().enumerate();
    entries
        .map(|(index, entry)| {
            resolve(entry).map_err(|what| format!("scenario.plant.{key}[{}]: {what}", index + 1))
        })
        .collect()
}

fn load(given: &schema::Load, dims: Dimensions) -> Result<Load, String> {
    interval(given.from, given.until)?;
    let at = match (given.input, given.disturbance, given.state) {
        (Some(input), None, None) => {
            Port::Input(check::index("input", input, dims.inputs, "inputs")?)
        }
        (None, Some(channel), None) => Port::Disturbance(check::index(
            "disturbance",
            channel,
            dims.disturbances,
            "disturbances",
        )?),
        (None, None, Some(state)) => {
            Port::State(check::index("state", state, dims.states, "states")?)
        }
        _ => {
            return Err(
                "name where it acts: one of input, disturbance and state, with its number".into(),
            );
        }
    };
    Ok(Load {
        at,
        from: given.from,
        until: given.until,
        size: finite("size", given.size)?,
    })
}
