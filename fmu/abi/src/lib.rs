//! The FMI 2.0 co-simulation interface, written once for every slave.
//!
//! An FMU binary of this project is a [`Slave`] (about a hundred lines: load a design, compute
//! at a tick) and one line that exports the C functions:
//!
//! ```text
//! struct Controller { /* the design, never changed */ }
//! impl fmu_abi::Slave for Controller { /* ... */ }
//! fmu_abi::export_fmu!(Controller);
//! ```
//!
//! Everything else is here, in one direction from C to the slave:
//!
//! | module | what it decides |
//! |---|---|
//! | [`types`] | the C types |
//! | [`exported`] | pointers, counts, panics: with `memory` the only unsafe code |
//! | [`memory`] | what happens when memory runs out |
//! | [`life_cycle`] | which function may be called when: the standard's table |
//! | [`component`] | what each function does to an instance, in safe code |
//! | [`clock`] | which ticks a communication step runs |
//! | [`values`](Values) | the values of the variables, one array |
//! | [`snapshot`] | what a saved state holds, and its bytes |
//! | [`resource`] | where the resources lie and whether they belong here |
//! | [`logger`] | what the importer is told |
//! | [`slave`](Slave) | what an FMU computes, as a trait |
//!
//! The trait divides what the standard prescribes from what an FMU computes: on one side there are
//! strings, pointers, seconds and states of a protocol, on the other a tick number and numbers.
#![expect(
    clippy::exhaustive_structs,
    clippy::exhaustive_enums,
    reason = "FMI 2.0 settles most of these, and all are for the FMUs of this workspace"
)]

pub mod clock;
pub mod component;
mod export;
pub mod exported;
pub mod life_cycle;
pub mod logger;
pub mod memory;
pub mod resource;
mod slave;
pub mod snapshot;
pub mod types;
mod values;

pub use slave::{Readiness, Refusal, Slave, nearest_mode, require_finite, selected_mode};
pub use values::Values;
