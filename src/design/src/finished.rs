//! A finished design: its record and what proves it.

use super::{Proof, Synthesis};
use ftc_record::DesignRecord;
use serde::{Deserialize, Serialize};
use std::ops::{Deref, DerefMut};

/// A record with the proof of its gains. Whatever needs the record alone takes a reference to this, too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Design {
    /// What an FMU holds.
    #[serde(flatten)]
    pub record: DesignRecord,
    /// What proves the gains; none where they were not made by synthesis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<Proof>,
}

impl Design {
    /// The gains and the observer that run, with what proves them; none where they were not made by
    /// synthesis.
    pub fn synthesis(&self) -> Option<Synthesis> {
        let running = &self.controller;
        Some(self.proof.clone()?.of(&running.feedback, &running.observer))
    }
}

impl From<DesignRecord> for Design {
    /// Without a proof.
    fn from(record: DesignRecord) -> Self {
        Self {
            record,
            proof: None,
        }
    }
}

impl Deref for Design {
    type Target = DesignRecord;

    fn deref(&self) -> &DesignRecord {
        &self.record
    }
}

impl DerefMut for Design {
    fn deref_mut(&mut self) -> &mut DesignRecord {
        &mut self.record
    }
}
