//! FMUs of a design: written from prebuilt binaries, and verified from their contents alone.
//!
//! [`export`] writes the controller FMU, the plant FMU and on request an SSP package that connects
//! them; nothing is compiled and the same design gives the same bytes. [`verify`] proves the
//! certificate of a written FMU again; [`solved`] keeps a solved design in a file.
//!
//! With the FMU binaries of `make build`:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let request = design_file::read("../../examples/paper.toml".as_ref())?.request;
//! let design = ftc_design::assembly::assemble(request)?;
//! let out = tempfile::tempdir()?;
//! let options = package::Options {
//!     out: out.path().into(),
//!     binaries: "../../target/release".into(),
//!     ssp: false,
//!     platforms: None,
//!     sign: None,
//! };
//! let paths = package::export(&design, &options)?.paths;
//! assert!(paths[0].ends_with("paper_controller.fmu") && paths[1].ends_with("paper_plant.fmu"));
//! println!("{}", package::verify(&paths[0])?);
//! # Ok(())
//! # }
//! ```

mod archive;
pub mod binary;
pub mod certificate;
mod description;
mod error;
mod export;
pub mod platform;
mod reading;
pub mod signature;
pub mod solved;
mod ssp;
mod verify;

pub use error::Error;
pub use export::{Exported, Options, Packed, export};
pub use verify::{Checks, Verification, verify, verify_with};
