//! On line: what runs at every tick, and nothing else.
//!
//! A measurement enters the [`estimator`], which decides sensor by sensor whether to believe it;
//! [`compensation`] makes the corrected measurement; the [`observer`] and the [`integrator`]
//! turn that into the state estimate and the tracking-error integral; the [`controller`]
//! composes them into the command.
//!
//! Between two ticks nothing here allocates, panics, locks, reads a clock or a file. Whatever
//! finite numbers come in, finite numbers go out, and the same inputs give the same bits: every
//! transcendental function comes from `libm`, never from the platform.

pub mod compensation;
pub mod controller;
pub mod estimator;
pub mod integrator;
pub mod kernel;
pub mod observer;
pub mod open_loop;
pub mod parameters;
pub mod repetition;
pub mod state;

pub use controller::{Change, Compensate, Controller, ControllerState, Sample};
pub use parameters::ControllerParameters;
