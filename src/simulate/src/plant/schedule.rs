//! The scenario by ticks: its times are turned into ticks once, not at every sample, and what is constant
//! is looked up where it changes.

use ftc_plant::Deviation;
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
    /// In order, the ticks at which anything changes but a signal that moves.
    changes: Vec<u64>,
    /// The signals that move.
    pub(super) moving: Vec<Moving>,
}

/// A signal that moves, and which it is.
#[derive(Clone, Debug)]
pub(super) struct Moving {
    pub(super) of: Of,
    pub(super) index: usize,
    pub(super) waveform: Waveform,
}

/// What a scenario's signals are.
#[derive(Clone, Copy, Debug)]
pub(super) enum Of {
    Reference,
    Fault,
    Disturbance,
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
    /// Of a scenario whose samples are `sample_time` seconds apart, and of what is told of its modes.
    pub(super) fn new(scenario: &Scenario, deviation: &Deviation, sample_time: f64) -> Self {
        let tick = |time| first_tick(time, sample_time);
        let signals = |waveforms: &[Waveform]| {
            let signals = waveforms.iter().map(|it| Signal::of(it, sample_time));
            signals.collect()
        };
        let events = scenario.events.iter();
        let modes = scenario.schedule.iter();
        let mut schedule = Self {
            reference: signals(&scenario.reference),
            fault: signals(&scenario.fault),
            disturbance: signals(&scenario.disturbance),
            events: events
                .map(|event| (tick(event.from)..tick(event.until), event.clone()))
                .collect(),
            modes: modes.map(|it| (tick(it.from), it.mode)).collect(),
            changes: Vec::new(),
            moving: Vec::new(),
        };
        let told = deviation.told.iter();
        let mut changes: Vec<u64> = told
            .flat_map(|told| [tick(told.from), tick(told.until)])
            .collect();
        let lasting = schedule.events.iter();
        changes.extend(lasting.flat_map(|(lasts, _)| [lasts.start, lasts.end]));
        for &(from, _) in &schedule.modes {
            changes.extend([from, from.saturating_add(deviation.mode_delay)]);
        }
        let mut moving = Vec::new();
        for (of, index, signal) in schedule.signals() {
            match signal {
                Signal::Steps(points) => changes.extend(points.iter().map(|(from, _)| *from)),
                Signal::Waveform(waveform) => moving.push(Moving {
                    of,
                    index,
                    waveform: waveform.clone(),
                }),
            }
        }
        changes.sort_unstable();
        changes.dedup();
        (schedule.changes, schedule.moving) = (changes, moving);
        schedule
    }

    fn signals(&self) -> impl Iterator<Item = (Of, usize, &Signal)> {
        let kinds = [
            (Of::Reference, &self.reference),
            (Of::Fault, &self.fault),
            (Of::Disturbance, &self.disturbance),
        ];
        kinds.into_iter().flat_map(|(of, signals)| {
            let signals = signals.iter().enumerate();
            signals.map(move |(index, signal)| (of, index, signal))
        })
    }

    /// The ticks around `tick` over which nothing changes but signals that move: the first, and the first after
    /// them.
    pub(super) fn constant_around(&self, tick: u64) -> (u64, u64) {
        let after = self.changes.partition_point(|&change| change <= tick);
        let at = |index: usize| self.changes.get(index).copied();
        let first = after.checked_sub(1).and_then(at).unwrap_or(0);
        (first, at(after).unwrap_or(u64::MAX))
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
            let schedule = Schedule::new(&scenario, &Deviation::default(), sample_time);
            for tick in (0..100).chain([u64::MAX]) {
                let (first, end) = schedule.constant_around(tick);
                prop_assert!(first <= tick && tick <= end && (tick < end || tick == u64::MAX));
                prop_assert_eq!(schedule.mode(tick), schedule.mode(first));
                for (_, _, signal) in schedule.signals() {
                    if let Signal::Steps(_) = signal {
                        prop_assert_eq!(signal.at(tick, sample_time), signal.at(first, sample_time));
                    }
                }
                prop_assert_eq!(schedule.mode(tick), scenario.mode(tick, sample_time));
                for (signal, waveform) in schedule.reference.iter().zip(&waveforms) {
                    prop_assert_eq!(signal.at(tick, sample_time), waveform.at(tick, sample_time));
                }
            }
        }
    }
}
