//! FMUs of a design: written from prebuilt binaries, and verified from their contents alone.
//!
//! [`export`] writes the controller FMU, the plant FMU and on request an SSP package that connects
//! them; nothing is compiled and the same design gives the same bytes. [`verify`] proves the
//! certificate of a written FMU again. [`output`] writes a set of files completely or not at all.

mod archive;
pub mod certificate;
mod error;
mod export;
pub mod output;
pub mod platform;
mod ssp;
mod verify;

pub use error::Error;
pub use export::{Exported, Options, Packed, export};
pub use verify::{Verification, verify};
