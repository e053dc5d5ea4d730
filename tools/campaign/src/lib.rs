//! A campaign: thousands of seeded random runs of one design, each with other faults, schedules,
//! references, disturbances, noise and model error; each with fault tolerance, without, and told the
//! fault.
//!
//! Run `i` depends on the design, the [`Options`] and `i` alone, and statistics are integer counts.
//! So any range of runs can be done anywhere ([`run_shard`]), in any number of threads, and
//! [`merge`] gives the same [`Partial`] to the last digit, whatever the order; runs that two parts
//! share are refused rather than counted twice.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let request = design_file::read("../../examples/paper.toml".as_ref())?.request;
//! let design = ftc_design::assembly::assemble(request)?;
//! let options = campaign::Options::default();
//! let first = campaign::run_shard(&design, &options, 0..3);
//! let others = campaign::run_shard(&design, &options, 3..8);
//! let whole = campaign::merge([others, first])?;
//! assert_eq!(whole, campaign::run_shard(&design, &options, 0..8));
//! println!("{}", campaign::page::text(&whole));
//! # Ok(())
//! # }
//! ```

mod draw;
pub mod files;
mod histogram;
pub mod page;
mod partial;
#[cfg(feature = "parquet")]
pub mod rows;
mod run;
mod statistics;

pub use draw::{Drawn, draw};
pub use ftc_simulate::detection::FaultDetection;
pub use histogram::Histogram;
pub use partial::{MergeError, Partial, merge};
pub use run::{Outcome, run_one};
pub use statistics::{Healthy, KindStatistics, Statistics, Unstable, Worst};

use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::TruePlant;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Runs that are worked on together; what is kept in memory is bounded by it.
const BATCH: u64 = 256;

/// Runs of a campaign, where no number is given.
pub const RUNS: u64 = 1000;

/// The most faults that a run may be asked to have.
pub const MOST_FAULTS: u32 = 16;

/// What is drawn in each run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Options {
    /// Seed of the campaign.
    pub seed: u64,
    /// Largest relative error of the entries of `A`, `B` and `E`.
    pub model_error: f64,
    /// Largest fault, in thresholds of its sensor.
    pub largest_fault: f64,
    /// The most faults in one run.
    pub most_faults: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            model_error: 0.02,
            largest_fault: 30.0,
            most_faults: 2,
        }
    }
}

/// An option out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{} {}", self.option(), self.reason())]
#[non_exhaustive]
pub enum OptionsError {
    /// [`Options::model_error`].
    ModelError(f64),
    /// [`Options::model_error`] of a design whose plant is nonlinear.
    NoMatrices(f64),
    /// [`Options::largest_fault`].
    LargestFault(f64),
    /// [`Options::most_faults`].
    MostFaults(u32),
}

impl OptionsError {
    /// Name of the option.
    pub fn option(&self) -> &'static str {
        match self {
            Self::ModelError(_) | Self::NoMatrices(_) => "model_error",
            Self::LargestFault(_) => "largest_fault",
            Self::MostFaults(_) => "most_faults",
        }
    }

    /// The sentence behind the option's name.
    pub fn reason(&self) -> String {
        match self {
            Self::ModelError(value) => format!("is {value}: give a fraction from 0 to 1"),
            Self::NoMatrices(value) => format!(
                "is {value}, but it changes matrices and the plant of this design is nonlinear: leave it out"
            ),
            Self::LargestFault(value) => format!("is {value}: give 1 to 1e6 thresholds"),
            Self::MostFaults(value) => format!("is {value}: give at most {MOST_FAULTS}"),
        }
    }
}

impl Options {
    /// These options with another seed.
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// These options for a design: a nonlinear plant has no matrices that could be off.
    pub fn for_design(self, design: &Design) -> Self {
        let model_error = match is_linear(design) {
            true => self.model_error,
            false => 0.0,
        };
        Self {
            model_error,
            ..self
        }
    }

    /// Refuses a model error that the design's plant cannot have.
    ///
    /// # Errors
    /// A model error of a nonlinear plant.
    pub fn check_model_error(&self, design: &Design) -> Result<(), OptionsError> {
        match self.model_error > 0.0 && !is_linear(design) {
            true => Err(OptionsError::NoMatrices(self.model_error)),
            false => Ok(()),
        }
    }

    /// Whether every option is in its range.
    ///
    /// # Errors
    /// The first that is not.
    pub fn check(&self) -> Result<(), OptionsError> {
        if !(0.0..=1.0).contains(&self.model_error) {
            return Err(OptionsError::ModelError(self.model_error));
        }
        if !(1.0..=1e6).contains(&self.largest_fault) {
            return Err(OptionsError::LargestFault(self.largest_fault));
        }
        if self.most_faults > MOST_FAULTS {
            return Err(OptionsError::MostFaults(self.most_faults));
        }
        Ok(())
    }
}

/// Whether the true plant has matrices of its own.
fn is_linear(design: &Design) -> bool {
    let (motion, _) = design.true_plant.clone().into_parts();
    matches!(motion, TruePlant::AsDesigned | TruePlant::Linear { .. })
}

/// How a shard is watched and stopped.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Watch {
    /// Set it to stop: runs that are done are kept.
    pub stop: AtomicBool,
    /// Counts the runs that are done.
    pub done: AtomicU64,
}

/// Does the runs of `range` in the present pool of threads.
pub fn run_shard(design: &Design, options: &Options, range: Range<u64>) -> Partial {
    let kept = run_watched(design, options, range, &Watch::default(), |_| {
        Ok::<(), ()>(())
    });
    kept.unwrap_or_else(|()| Partial::new(design, options))
}

/// As [`run_shard`]: can be stopped, and hands the outcomes of each batch over, in the order of the
/// runs.
///
/// # Errors
/// What `keep` says.
pub fn run_watched<E>(
    design: &Design,
    options: &Options,
    range: Range<u64>,
    watch: &Watch,
    mut keep: impl FnMut(&[Outcome]) -> Result<(), E>,
) -> Result<Partial, E> {
    let controller =
        Controller::new(design.parameters()).expect("a finished design has matching sizes");
    let mut partial = Partial::new(design, options);
    let mut first = range.start;
    while first < range.end && !watch.stop.load(Ordering::Relaxed) {
        let last = range.end.min(first + BATCH);
        // One by one: a thread that took many at once would be waited for at the end of the batch.
        let outcomes: Vec<Option<Outcome>> = (0..(last - first) as usize)
            .into_par_iter()
            .with_max_len(1)
            .map(|at| {
                let run = first + at as u64;
                if watch.stop.load(Ordering::Relaxed) {
                    return None;
                }
                let outcome = run_one(design, &controller, options, run);
                watch.done.fetch_add(1, Ordering::Relaxed);
                Some(outcome)
            })
            .collect();
        let outcomes: Vec<Outcome> = outcomes.into_iter().map_while(|outcome| outcome).collect();
        keep(&outcomes)?;
        partial.add(&outcomes);
        first = last;
    }
    Ok(partial)
}

/// Does the runs of `range` that `whole` lacks, and returns both together.
///
/// # Errors
/// What `keep` says.
pub fn complete<E>(
    mut whole: Partial,
    (design, options): (&Design, &Options),
    range: Range<u64>,
    watch: &Watch,
    mut keep: impl FnMut(&[Outcome]) -> Result<(), E>,
) -> Result<Partial, E> {
    for missing in whole.missing(range) {
        let part = run_watched(design, options, missing, watch, &mut keep)?;
        whole.join(part);
    }
    Ok(whole)
}

/// The runs of shard `index` (from 1) of `count`, out of `runs`.
pub fn shard(runs: u64, index: u64, count: u64) -> Range<u64> {
    let end = |i: u64| (u128::from(runs) * u128::from(i) / u128::from(count.max(1))) as u64;
    end(index.saturating_sub(1))..end(index)
}
