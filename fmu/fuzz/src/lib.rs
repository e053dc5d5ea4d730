//! What the targets share.

pub mod archive;
pub mod certificate;
pub mod design;

// The program's own readers, compiled here alone: the rest of its crate would take minutes.
#[path = "../../../tools/package/src/description.rs"]
mod description;
#[path = "../../../tools/package/src/certificate.rs"]
mod package_certificate;
#[path = "../../../tools/package/src/reading.rs"]
mod reading;
