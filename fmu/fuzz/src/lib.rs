//! What the targets share.

pub mod design;
