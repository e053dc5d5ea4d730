//! Trying the loop before trusting it: a plant under a scenario, the closed loop, its figures of merit.

pub mod baselines;
pub mod closed_loop;
pub mod integrate;
pub mod metrics;
pub mod plant;
pub mod warnings;

pub use closed_loop::{Trajectory, Variant, run, run_with};
pub use plant::{PlantSimulator, PlantState};
