//! What may have happened to a hypothesis since the last sample, and a list of it.

use super::hypothesis::Sensors;
use super::model_run::ModelRun;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// What may have happened since the last sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Action {
    /// Nothing happened.
    Stay,
    /// Loads jump, and input gains with them: the number of the jump.
    Load(usize),
    /// The plant is no longer the model: its matrices may be wrong in any way.
    PlantChanged,
    /// The plant is the model again.
    PlantRestored,
    /// These sensors have a bias.
    Bias(Sensors),
    /// This sensor's gain is wrong.
    Scale(usize),
    /// The faults of these sensors jump.
    Change(Sensors),
    /// These sensors have recovered.
    Release(Sensors),
    /// This sensor has frozen.
    Freeze(usize),
    /// The plant was not at rest at the start.
    Start,
    /// No load acts: the readings have come back to the model in open loop.
    Unloaded,
    /// No load acts but the usual ones: the readings have come back to the model's run under those.
    UsualLoad,
    /// No load acts: these sensors have drifted away from the model in open loop.
    Drift(Sensors),
}

impl Action {
    /// Of the model in open loop as `unloaded` and that under the `usual` loads, the one to which it puts a hypothesis back.
    pub(super) const fn run<'a>(self, unloaded: &'a ModelRun, usual: &'a ModelRun) -> &'a ModelRun {
        match self {
            Self::UsualLoad => usual,
            _ => unloaded,
        }
    }
}

/// One of them, and what it leaves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Candidate {
    pub score: f64,
    pub parent: usize,
    pub action: Action,
    pub convinced: bool,
}

/// Room for all that may have happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Candidates {
    pub(super) list: Vec<Candidate>,
    pub(super) count: usize,
}

impl Candidates {
    /// For so many `slots`, `outputs` and jumps of loads.
    pub(super) fn new(slots: usize, outputs: usize, jumps: usize) -> Self {
        let none = Candidate {
            score: 0.0,
            parent: 0,
            action: Action::Stay,
            convinced: false,
        };
        Self {
            list: vec![none; slots * (7 + jumps + 6 * outputs + outputs * outputs)],
            count: 0,
        }
    }

    /// One more.
    pub(super) fn add(&mut self, candidate: Candidate) {
        if let Some(entry) = self.list.get_mut(self.count) {
            *entry = candidate;
            self.count += 1;
        }
    }

    pub(super) fn all(&self) -> &[Candidate] {
        &self.list[..self.count]
    }

    pub(super) fn sort(&mut self, order: impl Fn(&Candidate, &Candidate) -> core::cmp::Ordering) {
        self.list[..self.count].sort_unstable_by(order);
    }
}

impl crate::state::State for Candidates {
    fn same_shape(&self, other: &Self) -> bool {
        self.list.len() == other.list.len()
    }
}
