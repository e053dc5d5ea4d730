//! Sensor faults that are set from outside while the plant runs, beside those of the scenario.

use super::{PlantSimulator, PlantState};
use ftc_plant::noise;
use ftc_plant::scenario::{InjectedKind, first_tick};

/// Keeps injected noise apart from that of the scenario.
const OTHER_SEED: u64 = 0x5eed_0f1a_7e57_ab1e;

/// One fault per sensor (p each); empty: none.
#[derive(Clone, Copy, Debug, Default)]
#[expect(
    clippy::exhaustive_structs,
    reason = "the four parameters of an injected fault"
)]
pub struct Injected<'a> {
    /// Number of the [`InjectedKind`]; 0: none.
    pub kind: &'a [f64],
    /// Size, in the units of the kind.
    pub size: &'a [f64],
    /// First instant in seconds.
    pub from: &'a [f64],
    /// End in seconds.
    pub until: &'a [f64],
}

impl Injected<'_> {
    /// Kind, size and beginning of the fault of each sensor, if it is present at `tick`.
    fn present(
        &self,
        tick: u64,
        sample_time: f64,
    ) -> impl Iterator<Item = Option<(InjectedKind, f64, f64)>> {
        let times = self.from.iter().zip(self.until);
        let faults = self.kind.iter().zip(self.size).zip(times);
        faults.map(move |((&kind, &size), (&from, &until))| {
            let within = first_tick(from, sample_time)..first_tick(until, sample_time);
            let kind = InjectedKind::of(kind).filter(|_| within.contains(&tick))?;
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
        let noisy = |&kind: &f64| InjectedKind::of(kind) == Some(InjectedKind::Noise);
        if injected.kind.iter().any(noisy) {
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
                InjectedKind::Bias => before + size,
                InjectedKind::Drift => before + size * (state.tick as f64 * te - from),
                InjectedKind::Gain => (1.0 - size) * before,
                InjectedKind::Stuck => *held,
                InjectedKind::Dropout => f64::NAN,
                InjectedKind::Noise => before + size * draw,
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
                InjectedKind::Bias | InjectedKind::Drift | InjectedKind::Noise => {}
                InjectedKind::Gain => {
                    *y *= 1.0 - size;
                    *fault += *y - before;
                }
                InjectedKind::Stuck => {
                    *y = 0.0;
                    *fault -= before;
                }
                InjectedKind::Dropout => (*y, *fault) = (0.0, 0.0),
            }
        }
    }
}
