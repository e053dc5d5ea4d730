//! Some of the runs of a campaign, and how parts become a whole.

use crate::{Options, Outcome, Statistics};
use ftc_design::Design;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The runs of a campaign that were done, and what they say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Partial {
    /// Name of the design.
    pub design: String,
    /// Fingerprint of the design: parts of different designs do not merge.
    pub fingerprint: String,
    /// What was drawn.
    pub options: Options,
    /// Runs that were done: `[first, after the last]`, ascending, neither touching nor overlapping.
    pub done: Vec<[u64; 2]>,
    /// What they say.
    pub statistics: Statistics,
}

/// Why parts do not become a whole.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// There is nothing to merge.
    #[error("there is no part: give at least one")]
    Empty,
    /// They belong to different designs.
    #[error("the parts belong to different designs: run all shards with the same design file")]
    Design,
    /// Different things were drawn.
    #[error("the parts have different seeds or options: run all shards with the same ones")]
    Options,
    /// A run was done in two of them.
    #[error("run {0} is in two parts: give each shard once")]
    Overlap(u64),
}

impl Partial {
    /// No run done yet.
    pub fn new(design: &Design, options: &Options) -> Self {
        Self {
            design: design.name.clone(),
            fingerprint: fingerprint(design),
            options: options.for_design(design),
            done: Vec::new(),
            statistics: Statistics::new(design.signals.outputs.len()),
        }
    }

    /// How many runs were done.
    pub fn runs(&self) -> u64 {
        self.statistics.runs
    }

    /// The runs of `range` that were not done, ascending.
    pub fn missing(&self, range: Range<u64>) -> Vec<Range<u64>> {
        let mut missing = Vec::new();
        let mut from = range.start;
        for &[first, last] in &self.done {
            if from < first.min(range.end) {
                missing.push(from..first.min(range.end));
            }
            from = from.max(last);
        }
        if from < range.end {
            missing.push(from..range.end);
        }
        missing
    }

    /// Whether these are runs of this design.
    pub fn is_of(&self, design: &Design) -> bool {
        self.fingerprint == fingerprint(design)
    }

    /// Adds a part with other runs of the same design and options.
    pub(crate) fn join(&mut self, part: Self) {
        self.done.extend(part.done);
        join(&mut self.done);
        self.statistics.merge(&part.statistics);
    }

    /// Counts runs that follow one another.
    pub(crate) fn add(&mut self, outcomes: &[Outcome]) {
        let (Some(first), Some(last)) = (outcomes.first(), outcomes.last()) else {
            return;
        };
        for outcome in outcomes {
            self.statistics.add(outcome);
        }
        self.done.push([first.run, last.run + 1]);
        join(&mut self.done);
    }
}

/// Joins intervals that touch.
fn join(done: &mut Vec<[u64; 2]>) {
    done.sort_unstable();
    done.dedup_by(|next, before| {
        let touch = next[0] <= before[1];
        if touch {
            before[1] = before[1].max(next[1]);
        }
        touch
    });
}

/// Puts parts together. The result is the same in any order.
///
/// # Errors
/// [`MergeError`]
pub fn merge(parts: impl IntoIterator<Item = Partial>) -> Result<Partial, MergeError> {
    let mut parts = parts.into_iter();
    let mut whole = parts.next().ok_or(MergeError::Empty)?;
    for part in parts {
        if part.fingerprint != whole.fingerprint {
            return Err(MergeError::Design);
        }
        if part.options != whole.options {
            return Err(MergeError::Options);
        }
        let shared = part.done.iter().find_map(|new| {
            let mut old = whole.done.iter();
            old.find(|old| new[0] < old[1] && old[0] < new[1])
                .map(|old| new[0].max(old[0]))
        });
        if let Some(run) = shared {
            return Err(MergeError::Overlap(run));
        }
        whole.join(part);
    }
    Ok(whole)
}

/// A hash (FNV-1a) of the design's record: it tells designs apart, it proves nothing.
fn fingerprint(design: &Design) -> String {
    let bytes = serde_json::to_vec(design).unwrap_or_default();
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("{hash:016x}")
}
