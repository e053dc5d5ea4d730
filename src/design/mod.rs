//! Off line: gains, observers, predictor and certificate.

pub mod commissioning;
mod record;

pub use record::{Design, FORMAT, Signal, Signals};
