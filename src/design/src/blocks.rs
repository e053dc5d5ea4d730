//! The names of the inequalities a design is made of.

use serde::{Deserialize, Serialize};
use std::fmt;

/// What an inequality demands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum BlockKind {
    /// The closed loop's state shrinks by the decay rate each sample.
    Decay,
    /// The disturbance reaches the performance signal attenuated to gamma.
    Attenuation,
    /// The observer's error shrinks by its decay rate each sample.
    ObserverDecay,
    /// The Lyapunov functions of two modes differ by at most the factor mu.
    LyapunovRatio,
    /// The disturbance reaches the performance signal of the running loop attenuated to its gain.
    RunningLoop,
    /// Sensor noise reaches the true tracking error of the running loop with at most its gain.
    NoiseGain,
    /// Bumpless transfer keeps the loop stable.
    Transfer,
    /// A fault that is not noticed reaches the true tracking error with at most its gain.
    FaultGain,
    /// The Lyapunov matrix itself is positive definite.
    Lyapunov,
    /// A theorem as the paper prints it.
    Printed,
}

/// The name of an inequality: its kind, the mode, and the mode that follows it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BlockName {
    /// What it demands.
    pub kind: BlockKind,
    /// Number of the active mode, from 1.
    pub mode: usize,
    /// Number of the mode that is active one sample later, from 1.
    pub successor: usize,
}

impl BlockName {
    /// Names an inequality by mode *indices* (from 0).
    pub fn new(kind: BlockKind, mode: usize, successor: usize) -> Self {
        Self {
            kind,
            mode: mode + 1,
            successor: successor + 1,
        }
    }
}

impl fmt::Display for BlockName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            BlockKind::Decay => "decay",
            BlockKind::Attenuation => "attenuation",
            BlockKind::ObserverDecay => "observer decay",
            BlockKind::LyapunovRatio => "Lyapunov ratio",
            BlockKind::RunningLoop => "gamma_loop",
            BlockKind::NoiseGain => "noise gain",
            BlockKind::Transfer => "bumpless transfer",
            BlockKind::FaultGain => "fault gain",
            BlockKind::Lyapunov => "Lyapunov matrix",
            BlockKind::Printed => "printed inequality",
        };
        write!(f, "{kind} of mode {}", self.mode)?;
        if self.successor != self.mode {
            write!(f, " when mode {} follows", self.successor)?;
        }
        Ok(())
    }
}
