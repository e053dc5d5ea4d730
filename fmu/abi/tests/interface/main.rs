//! The C interface as an importer meets it, proved on the test slave `staircase`.
//!
//! One file per promise. The functions are called through their C names and types.

mod allocation;
mod c_host;
mod host;
mod life_cycle;
mod logging;
mod phases;
mod random_calls;
mod resources;
mod states;
mod threads;
mod time;
mod values;
