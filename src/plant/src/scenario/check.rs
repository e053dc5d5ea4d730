//! Whether a scenario can be run: the ranges of its numbers, the order of its times, one of everything.

use super::{FaultEvent, FaultKind, MOST_STEPS, ModeInterval, Scenario, Waveform};
use crate::dimensions::Dimensions;
use crate::number::{NumberError, first, fraction, not_negative, number, positive};
use core::fmt;

/// One of the lists of a scenario that have an entry for each channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Channels {
    /// Noise of the outputs.
    Noise,
    /// References of the tracked outputs.
    Reference,
    /// Additive faults of the outputs.
    Fault,
    /// Disturbances.
    Disturbance,
}

impl Channels {
    /// What one of them is called.
    const fn one(self) -> &'static str {
        match self {
            Self::Noise => "the noise of output",
            Self::Reference => "reference",
            Self::Fault => "the fault of output",
            Self::Disturbance => "disturbance",
        }
    }
}

impl fmt::Display for Channels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Noise => "noise levels",
            Self::Reference => "references",
            Self::Fault => "faults",
            Self::Disturbance => "disturbances",
        })
    }
}

/// One of the numbers that describe a signal or a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// A constant, the value of a point or of a sample, or that before a ramp.
    Value,
    /// Of a square wave or of a sine.
    Amplitude,
    /// Of a square wave, of a sine or of an intermittent fault.
    Period,
    /// Of a sine.
    Phase,
    /// Of a square wave or of a sine.
    Offset,
    /// Of a ramp or of a drift.
    Slope,
    /// Of a fault or of a load.
    Size,
    /// Of a sensor's gain.
    Loss,
}

impl Quantity {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Value => "value",
            Self::Amplitude => "amplitude",
            Self::Period => "period",
            Self::Phase => "phase",
            Self::Offset => "offset",
            Self::Slope => "slope",
            Self::Size => "size",
            Self::Loss => "loss",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Why a scenario cannot be run. Outputs, modes and entries of lists count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// No sample, or too many.
    #[error("the scenario has {0} samples: give 1 to {MOST_STEPS}")]
    Steps(u64),
    /// A list has another length than the plant needs.
    #[error("the number of {of} in the scenario is {found}: give {needed}")]
    Count {
        /// Which list.
        of: Channels,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// The noise of an output is negative or no number.
    #[error("the noise of output {output} {error}")]
    Noise {
        /// The output.
        output: usize,
        /// What is wrong with it.
        error: NumberError,
    },
    /// No mode is active from the start.
    #[error("the schedule does not start at time 0: let its first mode be active from there")]
    LateStart,
    /// The schedule goes back in time.
    #[error("the schedule goes from time {before} to {after}: give the times in ascending order")]
    ScheduleOrder {
        /// Seconds.
        before: f64,
        /// Seconds.
        after: f64,
    },
    /// The schedule names a mode that does not exist.
    #[error(
        "entry {entry} of the schedule names mode {mode}, but the plant has {modes}: name one that it has"
    )]
    UnknownMode {
        /// The entry.
        entry: usize,
        /// The mode.
        mode: usize,
        /// Modes of the plant.
        modes: usize,
    },
    /// A signal is ill-formed.
    #[error("{} {channel}: {error}", .of.one())]
    Signal {
        /// Which list.
        of: Channels,
        /// Which of its entries.
        channel: usize,
        /// What is wrong with it.
        error: WaveformError,
    },
    /// A fault is ill-formed.
    #[error("event {event}: {error}")]
    Event {
        /// Which one.
        event: usize,
        /// What is wrong with it.
        error: FaultError,
    },
}

/// Why a signal over time is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WaveformError {
    /// A number is out of its range.
    #[error("its {of} {error}")]
    Number {
        /// Which number.
        of: Quantity,
        /// What is wrong with it.
        error: NumberError,
    },
    /// Steps without a point.
    #[error("it has no points: give at least one")]
    NoPoints,
    /// A point at no time (seconds) that the scenario has.
    #[error("it has a point at time {0}: give seconds, 0 or later")]
    PointTime(f64),
    /// The points go back in time.
    #[error("it goes from time {before} to {after}: give the times in ascending order")]
    PointOrder {
        /// Seconds.
        before: f64,
        /// Seconds.
        after: f64,
    },
    /// A point has a value out of range.
    #[error("one of its points {0}")]
    Point(NumberError),
    /// A table without a value.
    #[error("its table is empty: give at least one value")]
    NoValues,
    /// A ramp begins or ends at no time.
    #[error(transparent)]
    Interval(#[from] IntervalError),
}

/// Why a fault is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FaultError {
    /// It is at a channel (from 1) that does not exist.
    #[error("it is at channel {channel} of {channels}: name one that there is")]
    Place {
        /// The sensor, or the input of an actuator.
        channel: usize,
        /// How many there are.
        channels: usize,
    },
    /// A number is out of its range.
    #[error("its {of} {error}")]
    Number {
        /// Which number.
        of: Quantity,
        /// What is wrong with it.
        error: NumberError,
    },
    /// It begins or ends at no time.
    #[error(transparent)]
    Interval(#[from] IntervalError),
}

/// Why `[from, until)` is no interval of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntervalError {
    /// It begins before 0, or at no time (seconds).
    #[error("it begins at {0}: give a time in seconds, 0 or later")]
    From(f64),
    /// It does not end after it begins, or at no time.
    #[error("it ends at {until}: give a time in seconds after its beginning at {from}")]
    Until {
        /// Seconds.
        from: f64,
        /// Seconds.
        until: f64,
    },
}

/// Whether `[from, until)` is an interval in seconds from 0 on.
///
/// # Errors
/// The end of it that is none.
pub(crate) fn interval(from: f64, until: f64) -> Result<(), IntervalError> {
    if !(from.is_finite() && from >= 0.0) {
        return Err(IntervalError::From(from));
    }
    if !(until.is_finite() && until > from) {
        return Err(IntervalError::Until { from, until });
    }
    Ok(())
}

impl Scenario {
    /// Whether it can be run on a plant of these sizes with so many modes, of which so many outputs are `tracked`.
    ///
    /// # Errors
    /// The first part that is out of its range.
    pub fn check(
        &self,
        dims: Dimensions,
        modes: usize,
        tracked: usize,
    ) -> Result<(), ScenarioError> {
        if !(1..=MOST_STEPS).contains(&self.steps) {
            return Err(ScenarioError::Steps(self.steps));
        }
        for (of, found, needed) in [
            (Channels::Noise, self.noise.len(), dims.outputs),
            (Channels::Reference, self.reference.len(), tracked),
            (Channels::Fault, self.fault.len(), dims.outputs),
            (
                Channels::Disturbance,
                self.disturbance.len(),
                dims.disturbances,
            ),
        ] {
            if found != needed {
                return Err(ScenarioError::Count { of, found, needed });
            }
        }
        check_schedule(&self.schedule, modes)?;
        if let Some((at, error)) = first(&self.noise, not_negative) {
            return Err(ScenarioError::Noise {
                output: at + 1,
                error,
            });
        }
        for (of, signals) in [
            (Channels::Reference, &self.reference),
            (Channels::Fault, &self.fault),
            (Channels::Disturbance, &self.disturbance),
        ] {
            for (at, signal) in signals.iter().enumerate() {
                signal.check().map_err(|error| ScenarioError::Signal {
                    of,
                    channel: at + 1,
                    error,
                })?;
            }
        }
        for (at, event) in self.events.iter().enumerate() {
            let event_error = |error| ScenarioError::Event {
                event: at + 1,
                error,
            };
            event.check(dims.outputs).map_err(event_error)?;
        }
        Ok(())
    }
}

/// A mode is active from time 0 on, each later one after the one before.
fn check_schedule(schedule: &[ModeInterval], modes: usize) -> Result<(), ScenarioError> {
    if schedule.first().is_none_or(|interval| interval.from != 0.0) {
        return Err(ScenarioError::LateStart);
    }
    let ascending =
        |pair: &&[ModeInterval]| pair[0].from < pair[1].from && pair[1].from.is_finite();
    if let Some(pair) = schedule.windows(2).find(|pair| !ascending(pair)) {
        return Err(ScenarioError::ScheduleOrder {
            before: pair[0].from,
            after: pair[1].from,
        });
    }
    match schedule.iter().position(|entry| entry.mode >= modes) {
        None => Ok(()),
        Some(at) => Err(ScenarioError::UnknownMode {
            entry: at + 1,
            mode: schedule[at].mode.saturating_add(1),
            modes,
        }),
    }
}

impl Waveform {
    /// Whether every number lies in its range.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self) -> Result<(), WaveformError> {
        let of = |of: Quantity, found: Result<(), NumberError>| {
            found.map_err(|error| WaveformError::Number { of, error })
        };
        match self {
            Self::Constant { value } => of(Quantity::Value, number(*value)),
            Self::Steps { points } => check_points(points),
            Self::Square {
                amplitude,
                period,
                offset,
            } => {
                of(Quantity::Amplitude, number(*amplitude))?;
                of(Quantity::Period, positive(*period))?;
                of(Quantity::Offset, number(*offset))
            }
            Self::Sine {
                amplitude,
                period,
                phase,
                offset,
            } => {
                of(Quantity::Amplitude, number(*amplitude))?;
                of(Quantity::Period, positive(*period))?;
                of(Quantity::Phase, number(*phase))?;
                of(Quantity::Offset, number(*offset))
            }
            Self::Ramp {
                value,
                slope,
                from,
                until,
            } => {
                interval(*from, *until)?;
                of(Quantity::Value, number(*value))?;
                of(Quantity::Slope, number(*slope))
            }
            Self::Table { values } if values.is_empty() => Err(WaveformError::NoValues),
            Self::Table { values } => match first(values, number) {
                None => Ok(()),
                Some((_, error)) => of(Quantity::Value, Err(error)),
            },
        }
    }
}

/// There is a point, and the times ascend.
fn check_points(points: &[[f64; 2]]) -> Result<(), WaveformError> {
    if points.is_empty() {
        return Err(WaveformError::NoPoints);
    }
    for &[time, value] in points {
        if !(time.is_finite() && time >= 0.0) {
            return Err(WaveformError::PointTime(time));
        }
        number(value).map_err(WaveformError::Point)?;
    }
    match points.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
        None => Ok(()),
        Some(pair) => Err(WaveformError::PointOrder {
            before: pair[0][0],
            after: pair[1][0],
        }),
    }
}

impl FaultEvent {
    /// Whether it is at one of so many `channels` and every number lies in its range.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self, channels: usize) -> Result<(), FaultError> {
        let of = |of: Quantity, found: Result<(), NumberError>| {
            found.map_err(|error| FaultError::Number { of, error })
        };
        match self.kind {
            FaultKind::Bias { size } => of(Quantity::Size, number(size))?,
            FaultKind::Drift { slope } => of(Quantity::Slope, number(slope))?,
            FaultKind::GainLoss { loss } => of(Quantity::Loss, fraction(loss))?,
            FaultKind::Intermittent { size, period } => {
                of(Quantity::Size, number(size))?;
                of(Quantity::Period, positive(period))?;
            }
            FaultKind::Stuck | FaultKind::Dropout => {}
        }
        interval(self.from, self.until)?;
        match self.sensor < channels {
            true => Ok(()),
            false => Err(FaultError::Place {
                channel: self.sensor.saturating_add(1),
                channels,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::scenario::NEVER;

    type Change = fn(&mut Scenario);

    /// What is said of a scenario for two outputs, one of them tracked, and two modes.
    fn refusal(change: Change) -> Result<(), String> {
        let dims = Dimensions {
            states: 1,
            inputs: 1,
            outputs: 2,
            disturbances: 1,
        };
        let mut scenario = Scenario::new(10, vec![Waveform::ZERO], dims);
        scenario.events.push(FaultEvent {
            sensor: 1,
            from: 1.0,
            until: NEVER,
            kind: FaultKind::Stuck,
        });
        change(&mut scenario);
        scenario
            .check(dims, 2, 1)
            .map_err(|error| error.to_string())
    }

    fn all_refused(cases: &[(Change, &str)]) {
        for (change, words) in cases {
            let said = refusal(*change).expect_err(words);
            assert!(said.starts_with(words), "{said}");
        }
    }

    #[test]
    fn a_scenario_has_samples_and_one_of_everything() {
        assert_eq!(refusal(|_| ()), Ok(()));
        all_refused(&[
            (
                |scenario| scenario.steps = 0,
                "the scenario has 0 samples: give 1 to 1000000",
            ),
            (
                |scenario| scenario.steps = MOST_STEPS + 1,
                "the scenario has 1000001",
            ),
            (
                |scenario| scenario.noise.clear(),
                "the number of noise levels in the scenario is 0: give 2",
            ),
            (
                |scenario| scenario.reference.clear(),
                "the number of references",
            ),
            (|scenario| scenario.fault.clear(), "the number of faults"),
            (
                |scenario| scenario.disturbance.push(Waveform::ZERO),
                "the number of disturbances in the scenario is 2: give 1",
            ),
            (
                |scenario| scenario.noise[1] = -0.5,
                "the noise of output 2 is -0.5: give 0",
            ),
            (
                |scenario| scenario.noise[0] = f64::NAN,
                "the noise of output 1 is NaN",
            ),
        ]);
    }

    #[test]
    fn a_schedule_starts_at_once_and_ascends_through_modes_of_the_plant() {
        let later = |from, mode| ModeInterval { from, mode };
        assert_eq!(check_schedule(&[later(0.0, 1), later(2.0, 0)], 2), Ok(()));
        let found = |schedule: &[ModeInterval]| check_schedule(schedule, 2).unwrap_err();
        assert_eq!(found(&[]), ScenarioError::LateStart);
        assert_eq!(found(&[later(1.0, 0)]), ScenarioError::LateStart);
        for after in [3.0, 2.0, f64::NAN, f64::INFINITY] {
            let error = found(&[later(0.0, 0), later(3.0, 1), later(after, 0)]);
            assert!(matches!(
                error,
                ScenarioError::ScheduleOrder { before: 3.0, .. }
            ));
        }
        let (entry, mode, modes) = (2, 3, 2);
        let unknown = ScenarioError::UnknownMode { entry, mode, modes };
        assert_eq!(found(&[later(0.0, 0), later(1.0, 2)]), unknown);
    }

    #[test]
    fn a_signal_is_refused_by_its_number() {
        let cases: [(Waveform, &str); 9] = [
            (
                Waveform::Constant { value: f64::NAN },
                "its value is NaN: give a finite number",
            ),
            (
                Waveform::Square {
                    amplitude: 1.0,
                    period: 0.0,
                    offset: 0.0,
                },
                "its period is 0: give a positive number",
            ),
            (
                Waveform::Sine {
                    amplitude: 1.0,
                    period: 1.0,
                    phase: f64::INFINITY,
                    offset: 0.0,
                },
                "its phase is inf",
            ),
            (
                Waveform::Ramp {
                    value: 0.0,
                    slope: 1.0,
                    from: 2.0,
                    until: 2.0,
                },
                "it ends at 2: give a time in seconds after its beginning at 2",
            ),
            (Waveform::Steps { points: Vec::new() }, "it has no points"),
            (
                Waveform::Steps {
                    points: vec![[-1.0, 0.0]],
                },
                "it has a point at time -1",
            ),
            (
                Waveform::Steps {
                    points: vec![[0.0, f64::INFINITY]],
                },
                "one of its points is inf",
            ),
            (
                Waveform::Steps {
                    points: vec![[1.0, 0.0], [1.0, 1.0]],
                },
                "it goes from time 1 to 1",
            ),
            (Waveform::Table { values: Vec::new() }, "its table is empty"),
        ];
        for (signal, words) in cases {
            let said = signal.check().unwrap_err().to_string();
            assert!(said.starts_with(words), "{said}");
        }
        all_refused(&[(
            |scenario| scenario.fault[1] = Waveform::Steps { points: Vec::new() },
            "the fault of output 2: it has no points",
        )]);
    }

    #[test]
    fn a_fault_is_refused_by_its_number() {
        all_refused(&[
            (
                |scenario| scenario.events[0].sensor = 2,
                "event 1: it is at channel 3 of 2",
            ),
            (
                |scenario| scenario.events[0].from = -1.0,
                "event 1: it begins at -1: give a time in seconds, 0 or later",
            ),
            (
                |scenario| scenario.events[0].until = 1.0,
                "event 1: it ends at 1",
            ),
            (
                |scenario| scenario.events[0].kind = FaultKind::GainLoss { loss: 3.0 },
                "event 1: its loss is 3: give a fraction",
            ),
            (
                |scenario| {
                    let (size, period) = (1.0, -2.0);
                    scenario.events[0].kind = FaultKind::Intermittent { size, period };
                },
                "event 1: its period is -2",
            ),
            (
                |scenario| {
                    scenario.events[0].kind = FaultKind::Drift {
                        slope: f64::INFINITY,
                    };
                },
                "event 1: its slope is inf",
            ),
        ]);
    }
}
