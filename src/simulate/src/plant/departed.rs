//! What the true plant's departures carry from one tick to the next.

use ftc_control::kernel;
use ftc_plant::{Deviation, OperatingPoint};
use serde::{Deserialize, Serialize};

/// What the departures carry from one tick to the next.
#[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Departed {
    /// The input behind the actuators (m).
    pub(super) applied: Vec<f64>,
    /// Its change (m).
    pub(super) change: Vec<f64>,
    /// What each actuator gave last outside any fault (m).
    pub(super) held: Vec<f64>,
    /// True outputs that are on their way to the sensors, the oldest first (p times the delay).
    pub(super) late: Vec<f64>,
    /// Last readings outside any injected fault (p).
    pub(super) reading: Vec<f64>,
    /// Scratch for injected noise (p).
    pub(super) draws: Vec<f64>,
    /// Whether the scenario runs.
    pub(super) scenario_enabled: bool,
}

ftc_control::state!(Departed {
    parts: [applied, change, held, late, reading, draws],
    constants: [],
    counters: [scenario_enabled]
});

impl Departed {
    /// At rest at an operating point.
    pub(super) fn new(point: &OperatingPoint, deviation: &Deviation) -> Self {
        Self {
            applied: point.u.clone(),
            change: vec![0.0; point.u.len()],
            held: point.u.clone(),
            late: point.y.repeat(deviation.sensor_delay),
            reading: point.y.clone(),
            draws: vec![0.0; point.y.len()],
            scenario_enabled: true,
        }
    }

    /// The outputs that the sensors read now (p), where the true ones are `y_true` (p).
    pub(super) fn seen<'a>(&'a self, y_true: &'a [f64]) -> &'a [f64] {
        match self.late.get(..y_true.len()) {
            Some(late) if !late.is_empty() => late,
            _ => y_true,
        }
    }

    /// Whether readings are late.
    pub(super) fn is_late(&self) -> bool {
        !self.late.is_empty()
    }

    /// Sends the true outputs of this tick (p) to the sensors.
    pub(super) fn read(&mut self, y_true: &[f64]) {
        let Some(kept) = self.late.len().checked_sub(y_true.len()) else {
            return;
        };
        self.late.copy_within(y_true.len().., 0);
        if let Some(newest) = self.late.get_mut(kept..) {
            kernel::copy(newest, y_true);
        }
    }
}
