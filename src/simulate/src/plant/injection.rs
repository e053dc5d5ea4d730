//! Sensor faults that are set from outside while the plant runs, beside those of the scenario.

use super::{PlantSimulator, PlantState};
use ftc_plant::noise;
use ftc_plant::scenario::first_tick;

/// Keeps injected noise apart from that of the scenario.
const OTHER_SEED: u64 = 0x5eed_0f1a_7e57_ab1e;

/// One fault per sensor (p each); empty: none.
#[derive(Clone, Copy, Debug, Default)]
#[expect(
    clippy::exhaustive_structs,
    reason = "the four parameters of an injected fault"
)]
pub struct Injected<'a> {
    /// What happens to the reading, by number:
    ///
    /// | kind | reading |
    /// |---|---|
    /// | 0 | as it is |
    /// | 1 | bias: `y + size` |
    /// | 2 | drift: `y + size (t - from)` |
    /// | 3 | gain: `(1 - size) y` |
    /// | 4 | stuck: the last reading before |
    /// | 5 | dropout: not a number |
    /// | 6 | noise: `y + size n`, `n` standard normal |
    pub kind: &'a [f64],
    /// Size, in the units above.
    pub size: &'a [f64],
    /// First instant in seconds.
    pub from: &'a [f64],
    /// End in seconds.
    pub until: &'a [f64],
}

/// The kinds with a number.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Bias,
    Drift,
    Gain,
    Stuck,
    Dropout,
    Noise,
}

/// The number of the last kind.
pub const LAST_INJECTED_KIND: i32 = 6;

impl Kind {
    fn of(number: f64) -> Option<Self> {
        match number as i64 {
            1 => Some(Self::Bias),
            2 => Some(Self::Drift),
            3 => Some(Self::Gain),
            4 => Some(Self::Stuck),
            5 => Some(Self::Dropout),
            6 => Some(Self::Noise),
            _ => None,
        }
    }
}

impl Injected<'_> {
    /// Kind, size and beginning of the fault of each sensor, if it is present at `tick`.
    fn present(
        &self,
        tick: u64,
        sample_time: f64,
    ) -> impl Iterator<Item = Option<(Kind, f64, f64)>> {
        let times = self.from.iter().zip(self.until);
        let faults = self.kind.iter().zip(self.size).zip(times);
        faults.map(move |((&kind, &size), (&from, &until))| {
            let within = first_tick(from, sample_time)..first_tick(until, sample_time);
            let kind = Kind::of(kind).filter(|_| within.contains(&tick))?;
            Some((kind, size, from))
        })
    }
}

impl PlantSimulator {
    /// Changes the readings that were just observed.
    #[inline]
    pub fn inject(&self, state: &mut PlantState, injected: &Injected<'_>) {
        if injected.kind.iter().all(|&kind| kind == 0.0) {
            ftc_control::kernel::copy(&mut state.departed.reading, &state.y);
        } else {
            self.inject_some(state, injected);
        }
    }

    fn inject_some(&self, state: &mut PlantState, injected: &Injected<'_>) {
        let te = self.plant.sample_time;
        let departed = &mut state.departed;
        if injected.kind.contains(&f64::from(LAST_INJECTED_KIND)) {
            let seed = self.scenario.seed ^ OTHER_SEED;
            noise::standard_normal(seed, state.tick, &mut departed.draws);
        }
        let faults = injected.present(state.tick, te);
        let sensors = state.y.iter_mut().zip(&mut state.fault);
        let kept = departed.reading.iter_mut().zip(&departed.draws);
        for ((present, (y, fault)), (held, draw)) in faults.zip(sensors).zip(kept) {
            let Some((kind, size, from)) = present else {
                *held = *y;
                continue;
            };
            let before = *y;
            *y = match kind {
                Kind::Bias => before + size,
                Kind::Drift => before + size * (state.tick as f64 * te - from),
                Kind::Gain => (1.0 - size) * before,
                Kind::Stuck => *held,
                Kind::Dropout => f64::NAN,
                Kind::Noise => before + size * draw,
            };
            let change = *y - before;
            *fault = if change.is_finite() {
                *fault + change
            } else {
                0.0
            };
        }
    }

    /// The same for the changes of readings and faults under small changes of the inputs.
    pub fn inject_change(&self, trial: &mut PlantState, injected: &Injected<'_>) {
        let faults = injected.present(trial.tick, self.plant.sample_time);
        let sensors = trial.y.iter_mut().zip(&mut trial.fault);
        for (present, (y, fault)) in faults.zip(sensors) {
            let Some((kind, size, _)) = present else {
                continue;
            };
            let before = *y;
            match kind {
                Kind::Bias | Kind::Drift | Kind::Noise => {}
                Kind::Gain => {
                    *y *= 1.0 - size;
                    *fault += *y - before;
                }
                Kind::Stuck => {
                    *y = 0.0;
                    *fault -= before;
                }
                Kind::Dropout => (*y, *fault) = (0.0, 0.0),
            }
        }
    }
}
