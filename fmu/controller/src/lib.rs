//! The controller FMU.
