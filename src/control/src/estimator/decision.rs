//! Raise and release: one sensor's fault flag with debouncing.

use serde::{Deserialize, Serialize};

/// What one sample says of one sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(
    clippy::exhaustive_enums,
    reason = "below, above, or not to be compared"
)]
pub enum Verdict {
    /// The residual is within its threshold.
    Healthy,
    /// The residual exceeds its threshold.
    Faulty,
    /// The sensor gave no number: a fault beyond doubt.
    Lost,
}

impl Verdict {
    /// Compares a residual with its threshold.
    pub fn of(residual: f64, threshold: f64) -> Self {
        if residual.abs() > threshold {
            Self::Faulty
        } else {
            Self::Healthy
        }
    }
}

/// A fault flag that changes only after `debounce` samples in a row say so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    flagged: bool,
    /// Samples in a row that contradict the flag.
    contradictions: u32,
}

impl crate::state::State for Decision {
    fn same_shape(&self, _: &Self) -> bool {
        true
    }
}

impl Decision {
    /// Whether a fault is declared.
    pub fn flagged(&self) -> bool {
        self.flagged
    }

    /// Takes one sample's verdict into account; a lost sensor is declared at once.
    pub fn update(&mut self, verdict: Verdict, debounce: u32) {
        let faulty = verdict != Verdict::Healthy;
        if faulty == self.flagged {
            self.contradictions = 0;
            return;
        }
        self.contradictions = self.contradictions.saturating_add(1);
        if verdict == Verdict::Lost || self.contradictions >= debounce {
            self.flagged = faulty;
            self.contradictions = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_rises_and_falls_only_after_debounce_samples() {
        let mut decision = Decision::default();
        let verdicts = [
            Verdict::Faulty,
            Verdict::Faulty,
            Verdict::Healthy,
            Verdict::Faulty,
            Verdict::Faulty,
            Verdict::Faulty,
        ];
        let flags: Vec<bool> = verdicts
            .iter()
            .map(|&v| {
                decision.update(v, 3);
                decision.flagged()
            })
            .collect();
        assert_eq!(flags, [false, false, false, false, false, true]);
        decision.update(Verdict::Healthy, 3);
        decision.update(Verdict::Healthy, 3);
        assert!(decision.flagged());
        decision.update(Verdict::Healthy, 3);
        assert!(!decision.flagged());
    }

    #[test]
    fn a_lost_sensor_is_declared_at_once() {
        let mut decision = Decision::default();
        decision.update(Verdict::Lost, 5);
        assert!(decision.flagged());
    }
}
