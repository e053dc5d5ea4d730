//! What happens to the plant: mode schedule, references, sensor faults, disturbance, noise.

mod check;

pub(crate) use check::interval;
pub use check::{Channels, FaultError, IntervalError, Quantity, ScenarioError, WaveformError};

use crate::Dimensions;
use serde::{Deserialize, Serialize};

/// The most samples of a scenario.
pub const MOST_STEPS: u64 = 1_000_000;

/// An end, in seconds, that never comes.
pub const NEVER: f64 = f64::MAX;

/// A complete experiment; every signal is a pure function of the tick.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Scenario {
    /// Number of samples.
    pub steps: u64,
    /// Standard deviation of the measurement noise per output (p).
    pub noise: Vec<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// Which mode is active from when on; the first entry starts at time 0.
    pub schedule: Vec<ModeInterval>,
    /// Reference per tracked output (r).
    pub reference: Vec<Waveform>,
    /// Additive fault per sensor (p).
    pub fault: Vec<Waveform>,
    /// Faults that are more than an addition.
    pub events: Vec<FaultEvent>,
    /// Disturbance per channel (s).
    pub disturbance: Vec<Waveform>,
}

/// A mode (0-based) and the time in seconds from which it is active.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "which mode, from when on")]
pub struct ModeInterval {
    /// Start in seconds.
    pub from: f64,
    /// Mode, 0-based.
    pub mode: usize,
}

/// A signal over time in seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new kind must be drawn and read everywhere: the compiler says where"
)]
pub enum Waveform {
    /// The same value for ever.
    Constant {
        /// The value.
        value: f64,
    },
    /// Each value holds from its time on; zero before the first.
    Steps {
        /// `[time, value]` pairs, times ascending.
        points: Vec<[f64; 2]>,
    },
    /// `offset + amplitude` for half a period, `offset - amplitude` for the other.
    Square {
        /// Half the height.
        amplitude: f64,
        /// Seconds.
        period: f64,
        /// Added to all.
        offset: f64,
    },
    /// `offset + amplitude sin(2 pi t / period + phase)`.
    Sine {
        /// Amplitude.
        amplitude: f64,
        /// Seconds.
        period: f64,
        /// Radians.
        phase: f64,
        /// Added to all.
        offset: f64,
    },
    /// `value` until `from`, then moving by `slope` per second until `until`, then still.
    Ramp {
        /// Value before.
        value: f64,
        /// Change per second.
        slope: f64,
        /// Seconds.
        from: f64,
        /// Seconds.
        until: f64,
    },
    /// One value per sample; the last one holds.
    Table {
        /// The values.
        values: Vec<f64>,
    },
}

/// A fault of one sensor during `[from, until)` seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "which sensor, when, what")]
pub struct FaultEvent {
    /// Sensor, 0-based.
    pub sensor: usize,
    /// First instant in seconds.
    pub from: f64,
    /// End in seconds.
    pub until: f64,
    /// What happens to the reading.
    pub kind: FaultKind,
}

/// What a faulty sensor reads instead of `y`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new kind must be simulated everywhere: the compiler says where"
)]
pub enum FaultKind {
    /// `y + size`.
    Bias {
        /// Output units.
        size: f64,
    },
    /// `y + slope (t - from)`.
    Drift {
        /// Output units per second.
        slope: f64,
    },
    /// `(1 - loss) y`.
    GainLoss {
        /// Fraction lost.
        loss: f64,
    },
    /// The last reading before the fault, for ever.
    Stuck,
    /// Bias during the first half of each period, healthy during the second.
    Intermittent {
        /// Output units.
        size: f64,
        /// Seconds.
        period: f64,
    },
    /// Not a number.
    Dropout,
}

/// The kinds of faults by name: what a file, a table or a random draw tells apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new kind must be read and drawn everywhere: the compiler says where"
)]
pub enum FaultName {
    /// [`FaultKind::Bias`].
    Bias,
    /// [`FaultKind::Drift`].
    Drift,
    /// [`FaultKind::GainLoss`].
    GainLoss,
    /// [`FaultKind::Stuck`].
    Stuck,
    /// [`FaultKind::Intermittent`].
    Intermittent,
    /// [`FaultKind::Dropout`].
    Dropout,
}

impl FaultName {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Bias,
        Self::Drift,
        Self::GainLoss,
        Self::Stuck,
        Self::Intermittent,
        Self::Dropout,
    ];

    /// Its letters, which are those of the serialised form, too.
    pub const fn letters(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::Drift => "drift",
            Self::GainLoss => "gain-loss",
            Self::Stuck => "stuck",
            Self::Intermittent => "intermittent",
            Self::Dropout => "dropout",
        }
    }
}

impl FaultKind {
    /// The name of its kind.
    pub const fn name(&self) -> FaultName {
        match self {
            Self::Bias { .. } => FaultName::Bias,
            Self::Drift { .. } => FaultName::Drift,
            Self::GainLoss { .. } => FaultName::GainLoss,
            Self::Stuck => FaultName::Stuck,
            Self::Intermittent { .. } => FaultName::Intermittent,
            Self::Dropout => FaultName::Dropout,
        }
    }
}

/// What an importer may do to a reading while the plant FMU runs; its number is its place in `ALL`, from 1 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new kind must be simulated everywhere: the compiler says where"
)]
pub enum InjectedKind {
    /// `y + size`.
    Bias,
    /// `y + size (t - from)`.
    Drift,
    /// `(1 - size) y`.
    Gain,
    /// The last reading before.
    Stuck,
    /// Not a number.
    Dropout,
    /// `y + size n`, `n` standard normal.
    Noise,
}

impl InjectedKind {
    /// All of them, each with its name, in the order of their numbers.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Bias, "bias"),
        (Self::Drift, "drift"),
        (Self::Gain, "gain"),
        (Self::Stuck, "stuck"),
        (Self::Dropout, "dropout"),
        (Self::Noise, "noise"),
    ];

    /// The number of the last one.
    pub const LAST: i32 = Self::ALL.len() as i32;

    /// The one with this number.
    pub fn of(number: f64) -> Option<Self> {
        // A conversion rounds towards zero, and what is no number becomes zero.
        let at = (number as usize).checked_sub(1)?;
        Self::ALL.get(at).map(|(kind, _)| *kind)
    }
}

/// The first tick at or after `time` seconds; a time that is a whole number of samples but for rounding counts as one.
pub fn first_tick(time: f64, sample_time: f64) -> u64 {
    let ticks = time / sample_time - 1e-9;
    // A conversion rounds towards zero, and what is no number becomes zero.
    let below = ticks as u64;
    below.saturating_add(u64::from((below as f64) < ticks))
}

impl Waveform {
    /// Zero at every sample.
    pub const ZERO: Self = Self::Constant { value: 0.0 };

    /// Its least and its largest value in the first `steps` ticks, of which [`MOST_STEPS`] are looked at; infinite
    /// the wrong way round if there are none.
    pub fn range(&self, steps: u64, sample_time: f64) -> [f64; 2] {
        let values = (0..steps.min(MOST_STEPS)).map(|tick| self.at(tick, sample_time));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    }

    /// The value at tick `tick` of a system sampled every `sample_time` seconds.
    pub fn at(&self, tick: u64, sample_time: f64) -> f64 {
        let time = tick as f64 * sample_time;
        match self {
            Self::Constant { value } => *value,
            Self::Steps { points } => points
                .iter()
                .take_while(|[from, _]| first_tick(*from, sample_time) <= tick)
                .last()
                .map_or(0.0, |[_, value]| *value),
            Self::Square {
                amplitude,
                period,
                offset,
            } => {
                // A sample on an edge belongs to what follows it, whatever the rounding of `time`.
                let turns = time / period + 1e-9;
                let high = turns - libm::floor(turns) < 0.5;
                offset + if high { *amplitude } else { -amplitude }
            }
            Self::Sine {
                amplitude,
                period,
                phase,
                offset,
            } => {
                let turns = libm::fmod(time, *period) / period;
                offset + amplitude * libm::sin(core::f64::consts::TAU * turns + phase)
            }
            Self::Ramp {
                value,
                slope,
                from,
                until,
            } => value + slope * (time.min(*until) - from).max(0.0),
            Self::Table { values } => {
                let last = values.len().saturating_sub(1) as u64;
                values.get(tick.min(last) as usize).copied().unwrap_or(0.0)
            }
        }
    }
}

impl Scenario {
    /// The seed where no other is asked for.
    pub const SEED: u64 = 1;

    /// So many samples in the first mode under a reference (r), without noise, fault and disturbance;
    /// [`Scenario::check`] says whether it can be run on a plant.
    pub fn new(steps: u64, reference: Vec<Waveform>, dims: Dimensions) -> Self {
        Self {
            steps,
            noise: vec![0.0; dims.outputs],
            seed: Self::SEED,
            schedule: vec![ModeInterval { from: 0.0, mode: 0 }],
            reference,
            fault: vec![Waveform::ZERO; dims.outputs],
            events: Vec::new(),
            disturbance: vec![Waveform::ZERO; dims.disturbances],
        }
    }

    /// The mode (0-based) active at `tick`.
    pub fn mode(&self, tick: u64, sample_time: f64) -> usize {
        self.schedule
            .iter()
            .take_while(|interval| first_tick(interval.from, sample_time) <= tick)
            .last()
            .map_or(0, |interval| interval.mode)
    }
}

impl FaultEvent {
    /// Whether the fault is present at `tick`.
    pub fn active(&self, tick: u64, sample_time: f64) -> bool {
        (first_tick(self.from, sample_time)..first_tick(self.until, sample_time)).contains(&tick)
    }

    /// The reading of a sensor whose healthy reading is `healthy` and whose last healthy one was `last`.
    pub fn reading(&self, healthy: f64, last: f64, tick: u64, sample_time: f64) -> f64 {
        let since = tick as f64 * sample_time - self.from;
        match self.kind {
            FaultKind::Bias { size } => healthy + size,
            FaultKind::Drift { slope } => healthy + slope * since,
            FaultKind::GainLoss { loss } => (1.0 - loss) * healthy,
            FaultKind::Stuck => last,
            FaultKind::Intermittent { size, period } => {
                let turns = since / period + 1e-9;
                healthy
                    + if turns - libm::floor(turns) < 0.5 {
                        size
                    } else {
                        0.0
                    }
            }
            FaultKind::Dropout => f64::NAN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The conversion in [`first_tick`] is a ceiling, for whatever time a file may hold.
    #[test]
    fn the_first_tick_is_the_ceiling() {
        let near = (-40..400).map(|k| f64::from(k) * 0.05);
        let far = [1e15, 1.8e19, 1e20, 1e300, -1e300, 0.0, -0.0];
        let none = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        for time in near.chain(far).chain(none) {
            for sample_time in [0.1, 1.0, 1.0 / 60.0] {
                let wanted = libm::ceil(time / sample_time - 1e-9).max(0.0) as u64;
                assert_eq!(
                    first_tick(time, sample_time),
                    wanted,
                    "{time} {sample_time}"
                );
            }
        }
    }

    #[test]
    fn every_kind_is_listed_and_read_by_its_letters() {
        type Letters = serde::de::value::StrDeserializer<'static, serde::de::value::Error>;
        assert_eq!(FaultName::ALL.len(), FaultName::Dropout as usize + 1);
        for (at, name) in FaultName::ALL.into_iter().enumerate() {
            assert_eq!(name as usize, at);
            assert_eq!(
                FaultName::deserialize(Letters::new(name.letters())),
                Ok(name)
            );
        }
    }

    #[test]
    fn an_injected_kind_is_found_by_its_number() {
        let kinds = [0.0, 1.0, 6.0, 7.0, -1.0, f64::NAN].map(InjectedKind::of);
        let (first, last) = (Some(InjectedKind::Bias), Some(InjectedKind::Noise));
        assert_eq!(kinds, [None, first, last, None, None, None]);
        // A new kind must be listed: this match does not compile without it.
        for (at, (kind, _)) in InjectedKind::ALL.iter().enumerate() {
            let place = match kind {
                InjectedKind::Bias => 0,
                InjectedKind::Drift => 1,
                InjectedKind::Gain => 2,
                InjectedKind::Stuck => 3,
                InjectedKind::Dropout => 4,
                InjectedKind::Noise => 5,
            };
            assert_eq!(at, place);
        }
    }

    #[test]
    fn steps_hold_from_their_time_on() {
        let signal = Waveform::Steps {
            points: vec![[0.3, 1.0], [0.5, -1.0]],
        };
        let values: Vec<f64> = (0..7).map(|k| signal.at(k, 0.1)).collect();
        assert_eq!(values, [0.0, 0.0, 0.0, 1.0, 1.0, -1.0, -1.0]);
    }

    /// The range is found in a bounded time, whatever the length of a scenario.
    #[test]
    fn the_range_of_a_scenario_without_end_is_found() {
        let signal = Waveform::Sine {
            amplitude: 2.0,
            period: 40.0,
            phase: 0.0,
            offset: 1.0,
        };
        assert_eq!(signal.range(u64::MAX, 1.0), [-1.0, 3.0]);
        assert_eq!(signal.range(0, 1.0), [f64::INFINITY, f64::NEG_INFINITY]);
    }

    #[test]
    fn a_square_wave_changes_exactly_every_half_period() {
        let signal = Waveform::Square {
            amplitude: 1.0,
            period: 0.4,
            offset: 0.0,
        };
        for k in 0..100_000 {
            let expected = if k % 4 < 2 { 1.0 } else { -1.0 };
            assert_eq!(signal.at(k, 0.1), expected, "tick {k}");
        }
    }

    #[test]
    fn a_stuck_sensor_keeps_its_last_reading() {
        let event = FaultEvent {
            sensor: 0,
            from: 2.0,
            until: 4.0,
            kind: FaultKind::Stuck,
        };
        assert!(
            !event.active(1, 1.0)
                && event.active(2, 1.0)
                && event.active(3, 1.0)
                && !event.active(4, 1.0)
        );
        assert_eq!(event.reading(5.0, 3.0, 3, 1.0), 3.0);
    }
}
