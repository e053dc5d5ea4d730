//! The scenario by ticks: its times are turned into ticks once, not at every sample.

use ftc_plant::scenario::{FaultEvent, Scenario, Waveform, first_tick};
use std::ops::Range;

/// Which mode, faults and loads a scenario has at each tick.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    /// Reference per tracked output (r).
    pub(super) reference: Vec<Signal>,
    /// Additive fault per sensor (p).
    pub(super) fault: Vec<Signal>,
    /// Disturbance per channel (s).
    pub(super) disturbance: Vec<Signal>,
    /// Faults that are more than an addition, each while it lasts.
    pub(super) events: Vec<(Range<u64>, FaultEvent)>,
    /// Modes (0-based) and the ticks from which they are active.
    modes: Vec<(u64, usize)>,
}

/// A signal over ticks.
#[derive(Clone, Debug)]
pub(super) enum Signal {
    /// Each value holds from its tick on; zero before the first.
    Steps(Vec<(u64, f64)>),
    /// Any other.
    Waveform(Waveform),
}

impl Signal {
    fn of(waveform: &Waveform, sample_time: f64) -> Self {
        match waveform {
            Waveform::Constant { value } => Self::Steps(vec![(0, *value)]),
            Waveform::Steps { points } => {
                let points = points.iter();
                let ticks = points.map(|&[from, value]| (first_tick(from, sample_time), value));
                Self::Steps(ticks.collect())
            }
            other => Self::Waveform(other.clone()),
        }
    }

    /// The value at tick `tick` of a system sampled every `sample_time` seconds.
    pub(super) fn at(&self, tick: u64, sample_time: f64) -> f64 {
        match self {
            Self::Steps(points) => last(points, tick).unwrap_or(0.0),
            Self::Waveform(waveform) => waveform.at(tick, sample_time),
        }
    }
}

impl Schedule {
    /// Of a scenario whose samples are `sample_time` seconds apart.
    pub(super) fn new(scenario: &Scenario, sample_time: f64) -> Self {
        let tick = |time| first_tick(time, sample_time);
        let signals = |waveforms: &[Waveform]| {
            let signals = waveforms.iter().map(|it| Signal::of(it, sample_time));
            signals.collect()
        };
        let events = scenario.events.iter();
        let modes = scenario.schedule.iter();
        Self {
            reference: signals(&scenario.reference),
            fault: signals(&scenario.fault),
            disturbance: signals(&scenario.disturbance),
            events: events
                .map(|event| (tick(event.from)..tick(event.until), event.clone()))
                .collect(),
            modes: modes.map(|it| (tick(it.from), it.mode)).collect(),
        }
    }

    /// The mode (0-based) active at `tick`.
    pub(super) fn mode(&self, tick: u64) -> usize {
        last(&self.modes, tick).unwrap_or(0)
    }
}

/// What holds at `tick`: the last before one that begins later.
fn last<T: Copy>(points: &[(u64, T)], tick: u64) -> Option<T> {
    let mut found = None;
    for &(from, value) in points {
        if from > tick {
            break;
        }
        found = Some(value);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use ftc_plant::scenario::ModeInterval;
    use proptest::prelude::*;

    proptest! {
        /// The same, to the bit, as by times; also where these are out of order.
        #[test]
        fn ticks_play_what_times_say(
            times in prop::collection::vec(-1.0..9.0f64, 0..5), values in prop::array::uniform5(-2.0..2.0f64),
            sample_time in prop::sample::select(vec![0.1, 1.0, 1.0 / 60.0]),
        ) {
            let points: Vec<_> = times.iter().zip(values).map(|(&time, value)| [time, value]).collect();
            let waveforms = [
                Waveform::Steps { points },
                Waveform::Constant { value: values[0] },
                Waveform::Sine { amplitude: 1.0, period: 2.0, phase: 0.3, offset: 0.1 },
            ];
            let intervals = times.iter().enumerate().map(|(mode, &from)| ModeInterval { from, mode });
            let dims = ftc_plant::Dimensions { states: 1, inputs: 1, outputs: 1, disturbances: 1 };
            let mut scenario = Scenario::new(9, waveforms.to_vec(), dims);
            scenario.schedule = intervals.collect();
            let schedule = Schedule::new(&scenario, sample_time);
            for tick in (0..100).chain([u64::MAX]) {
                prop_assert_eq!(schedule.mode(tick), scenario.mode(tick, sample_time));
                for (signal, waveform) in schedule.reference.iter().zip(&waveforms) {
                    prop_assert_eq!(signal.at(tick, sample_time), waveform.at(tick, sample_time));
                }
            }
        }
    }
}
