//! What is wrong with the experiment, the disturbance and the true plant, each by its key.

use crate::check::ValueError;
use crate::complaint::{Complaint, Key};
use ftc_control::parameters::MOST_HARMONICS;
use ftc_design::assembly::DisturbanceError;
use ftc_design::words::counted;
use ftc_plant::ScenarioError;
use ftc_plant::deviation::DeviationError;
use ftc_plant::scenario::{Channels, FaultError, IntervalError, WaveformError};

/// What is wrong with what is known of the disturbance.
pub(crate) fn of_disturbance(error: &DisturbanceError) -> Complaint {
    match error {
        DisturbanceError::Period(error) => Complaint::of("disturbance.period", error),
        DisturbanceError::Harmonics(count) => Complaint::of(
            "disturbance.harmonics",
            ValueError::Count {
                value: i64::try_from(*count).unwrap_or(i64::MAX),
                least: 1,
                most: MOST_HARMONICS,
            },
        ),
        DisturbanceError::TooShort {
            period,
            harmonics,
            above,
        } => {
            let (with, fewer) = match harmonics {
                1 => (String::new(), ""),
                _ => (
                    format!(" with {harmonics} harmonics"),
                    ", set fewer disturbance.harmonics",
                ),
            };
            Complaint::of(
                "disturbance.period",
                format!(
                    "is {period}, but{with} it has to be above {above} seconds at this sample_time: give a longer \
                     period{fewer}, or choose a shorter sample_time"
                ),
            )
        }
        DisturbanceError::AmplitudeCount { found, needed } => Complaint::of(
            "disturbance.amplitude",
            ValueError::Entries {
                found: *found,
                needed: *needed,
            },
        ),
        DisturbanceError::Amplitude { error, .. } => Complaint::of("disturbance.amplitude", error),
        other => Complaint::general(other.to_string()),
    }
}

/// Why a scenario cannot be run.
pub(crate) fn of_scenario(error: &ScenarioError) -> Complaint {
    match error {
        ScenarioError::Count { of, found, needed } => of_count(*of, *found, *needed),
        ScenarioError::Noise { error, .. } => Complaint::of("scenario.noise", error),
        ScenarioError::LateStart => Complaint::of(
            "scenario.schedule",
            "must start at time 0: let its first entry say from = 0",
        ),
        ScenarioError::ScheduleOrder { before, after } => Complaint::of(
            "scenario.schedule",
            format!("goes from time {before} to {after}: give the times in ascending order"),
        ),
        ScenarioError::Signal { of, channel, error } => {
            of_waveform(error).inside(list(*of).entry(channel - 1))
        }
        ScenarioError::Event { event, error } => {
            of_fault(error).inside(Key::from("scenario.events").entry(event - 1))
        }
        other => Complaint::general(other.to_string()),
    }
}

/// The key of a list.
fn list(of: Channels) -> Key {
    Key::from(match of {
        Channels::Noise => "scenario.noise",
        Channels::Reference => "scenario.reference",
        Channels::Fault => "scenario.fault",
        _ => "scenario.disturbance",
    })
}

/// A list of another length than the plant needs.
fn of_count(of: Channels, found: usize, needed: usize) -> Complaint {
    let one = match of {
        Channels::Noise => {
            return Complaint::of(list(of), ValueError::Entries { found, needed });
        }
        Channels::Reference => "tracked output",
        Channels::Fault => "output",
        _ => "disturbance",
    };
    let signals = counted(found, "signal", "signals");
    Complaint::of(
        list(of),
        format!("has {signals}: give {needed}, one per {one}"),
    )
}

/// Why a signal over time is refused; the key is that inside the signal's table.
pub(crate) fn of_waveform(error: &WaveformError) -> Complaint {
    match error {
        WaveformError::Number { of, error } => Complaint::of(of.name(), error),
        WaveformError::NoPoints => {
            Complaint::of("points", "is empty: give at least one [time, value] pair")
        }
        WaveformError::PointTime(time) => Complaint::of(
            "points",
            format!("has the time {time}: give seconds, 0 or later"),
        ),
        WaveformError::PointOrder { before, after } => Complaint::of(
            "points",
            format!("goes from time {before} to {after}: give the times in ascending order"),
        ),
        WaveformError::Point(error) => Complaint::of("points", error),
        WaveformError::Interval(error) => of_interval(error),
        other => Complaint::general(other.to_string()),
    }
}

/// Why a fault is refused; the key is that inside the event's table.
fn of_fault(error: &FaultError) -> Complaint {
    match error {
        FaultError::Number { of, error } => Complaint::of(of.name(), error),
        FaultError::Interval(error) => of_interval(error),
        other => Complaint::general(other.to_string()),
    }
}

/// When something begins or ends.
fn of_interval(error: &IntervalError) -> Complaint {
    match error {
        IntervalError::From(from) => Complaint::of(
            "from",
            format!("is {from}: give a time in seconds, 0 or later"),
        ),
        IntervalError::Until { from, until } => Complaint::of(
            "until",
            format!("is {until}: give a time in seconds after from = {from}, or leave until out"),
        ),
        other => Complaint::general(other.to_string()),
    }
}

/// How a true plant departs from the model in a way that does not fit it.
pub(crate) fn of_deviation(error: &DeviationError) -> Complaint {
    let entry =
        |list: &str, number: &usize| Key::from("scenario.plant").then(list).entry(number - 1);
    match error {
        DeviationError::InputGain { error, .. } => {
            Complaint::of("scenario.plant.input_gain", error)
        }
        DeviationError::LoadInterval { load, error } => {
            of_interval(error).inside(entry("loads", load))
        }
        DeviationError::LoadSize { load, error } => {
            Complaint::of("size", error).inside(entry("loads", load))
        }
        DeviationError::ActuatorFault { fault, error } => {
            of_fault(error).inside(entry("actuator", fault))
        }
        DeviationError::Told { told, error } => of_interval(error).inside(entry("told", told)),
        other => Complaint::general(other.to_string()),
    }
}
