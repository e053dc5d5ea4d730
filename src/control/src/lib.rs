//! On line: what runs at every tick, and nothing else.
//!
//! A measurement enters the [`estimator`], which decides sensor by sensor whether it is faulty;
//! [`compensation`] makes the corrected measurement; the [`observer`] and the [`integrator`]
//! turn that into the state estimate and the tracking-error integral; the [`controller`]
//! composes them into the command.
//!
//! Between two ticks nothing here allocates, panics, locks, reads a clock or a file. Whatever
//! finite numbers come in, finite numbers go out, and the same inputs give the same bits: every
//! transcendental function comes from `libm`, never from the platform.
//!
//! ```
//! use ftc_control::parameters::*;
//! use ftc_control::{Controller, ControllerParameters, Matrix};
//!
//! let one = |value: f64| Matrix::from_rows(&[[value]]);
//! let gains = FeedbackGains::new(one(-0.4), one(0.1), one(-0.4)); // K, G, K C^+
//! let controller = Controller::new(ControllerParameters::new(
//!     1.0, // sample time
//!     vec![ModeModel::new(one(0.9), one(1.0), one(1.0))], // A, B, C
//!     StateFeedback::new(vec![0], vec![gains]), // output 0 is tracked
//!     Observer::luenberger(vec![one(0.5)]),
//! ))?;
//! let (mut state, mut y) = (controller.initial_state(0), 0.0);
//! for tick in 0..100 {
//!     let (measured, reference) = ([y], [1.0]);
//!     let sample = controller.sample(tick, 0, &measured, &reference).expect("sizes fit");
//!     controller.tick(&mut state, &sample);
//!     y = 0.9 * y + state.command[0];
//! }
//! assert!((y - 1.0).abs() < 1e-3);
//! # Ok::<(), ftc_control::ControllerError>(())
//! ```

#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod check;
pub mod compensation;
pub mod controller;
pub mod delay;
mod error;
pub mod estimator;
pub mod integrator;
pub mod kernel;
mod matrix;
pub mod observer;
pub mod open_loop;
pub mod parameters;
pub mod repetition;
pub mod state;
pub mod tuning;

pub use controller::{Change, Compensate, Controller, ControllerState, Sample};
pub use delay::Delay;
pub use error::{ControllerError, SampleError};
pub use matrix::{Matrix, UnequalRows};
pub use parameters::ControllerParameters;
