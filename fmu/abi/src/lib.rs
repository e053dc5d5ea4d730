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
//! What the calls of an importer do, without the C functions before them:
//!
//! ```
//! use fmu_abi::component::{Base, Component};
//! use fmu_abi::{Refusal, Slave, Values, logger::Logger};
//! use model_description::{Causality, Kind, Role, Variability, Variable, VariableTable};
//! use std::path::Path;
//!
//! /// `u` is twice `y`.
//! struct Gain(VariableTable);
//!
//! impl Slave for Gain {
//!     const RESOURCE: &'static str = "gain.txt";
//!     type State = ();
//!     fn load(_: &Path, _: &str) -> Result<Self, Refusal> {
//!         let variable = |name: &str, causality, role| Variable {
//!             name: name.into(),
//!             description: String::new(),
//!             kind: Kind::Real {
//!                 unit: None, display_unit: None, nominal: None, min: None, max: None, relative: false,
//!             },
//!             causality,
//!             variability: Variability::Discrete,
//!             start: 0.0,
//!             role,
//!             dependencies: Vec::new(),
//!             initial_dependencies: Vec::new(),
//!         };
//!         let mut table = VariableTable::new();
//!         table.push(variable("y", Causality::Input, Role::Measurement));
//!         table.push(variable("u", Causality::Output, Role::Command));
//!         Ok(Self(table))
//!     }
//!     fn variables(&self) -> &VariableTable { &self.0 }
//!     fn sample_time(&self) -> f64 { 0.1 }
//!     fn initial_state(&self) {}
//!     fn fits(&self, (): &()) -> bool { true }
//!     fn initialize(&self, _: &mut (), _: &mut Values) -> Result<(), Refusal> { Ok(()) }
//!     fn begin_tick(&self, _: &mut (), values: &mut Values, _: u64, _: bool) -> Result<(), Refusal> {
//!         let y = values.scalar(self.0.span(Role::Measurement));
//!         values.set(self.0.span(Role::Command), &[2.0 * y]);
//!         Ok(())
//!     }
//! }
//!
//! let gain = Gain::load(Path::new("resources"), "guid")?;
//! let quiet = Logger::new(None, std::ptr::null_mut(), c"gain", false);
//! let mut fmu = Component::new(gain, "guid", quiet)?;
//! fmu.set_up(0.0, None)?; // fmi2SetupExperiment
//! fmu.enter_initialization()?;
//! fmu.exit_initialization()?;
//! fmu.write(Base::Real, &[0], &[1.5], |y: f64| y)?; // fmi2SetReal of y
//! fmu.step(0.0, 0.1)?; // fmi2DoStep
//! let mut u = [0.0];
//! fmu.read(Base::Real, &[1], &mut u, Some)?; // fmi2GetReal of u
//! assert_eq!(u, [3.0]);
//! # Ok::<(), fmu_abi::component::Failure>(())
//! ```
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
