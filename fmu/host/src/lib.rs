//! An importer in Rust, for tests, measurements and fuzzing: it loads a binary (or uses the one
//! linked into the program), makes instances, and closes the loop of controller and plant.
//!
//! It fails loudly: whatever must succeed is asserted.
#![expect(
    clippy::exhaustive_structs,
    clippy::exhaustive_enums,
    reason = "for the tests of this workspace"
)]

mod closed_loop;
mod exercise;
mod functions;
mod instance;
pub mod model;
pub mod random_calls;

pub use closed_loop::{Coupling, Loop};
pub use exercise::{assert_nothing_is_allocated, exercise};
pub use fmu_abi::memory::allocations;
pub use fmu_abi::types;
pub use functions::{Functions, Library};
pub use instance::{Instance, Messages, NotInstantiated};
pub use model::Model;
