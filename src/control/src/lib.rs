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
//!
//! ```
//! use ftc_control::parameters::*;
//! use ftc_control::{Controller, ControllerParameters, Matrix};
//!
//! let one = |value: f64| Matrix::from_rows(&[[value]]);
//! let gains = FeedbackGains {
//!     state_feedback: one(-0.4), integral: one(0.1), feedforward: Matrix::zeros(1, 0),
//!     previous_input: Matrix::zeros(1, 0), anti_windup: one(0.0), output_feedback: one(-0.4),
//! };
//! let controller = Controller::new(ControllerParameters {
//!     sample_time: 1.0,
//!     modes: vec![ModeModel { a: one(0.9), b: one(1.0), c: one(1.0), e: Matrix::zeros(1, 0), f: Matrix::zeros(1, 0),
//!         x0: vec![0.0], u0: vec![0.0], y0: vec![0.0] }],
//!     feedback: StateFeedback {
//!         tracked: vec![0], latency: 0, resonators: vec![], transfer: None, modes: vec![gains],
//!     },
//!     observer: Observer {
//!         kind: ObserverKind::Luenberger, note: None, gains: vec![one(0.5)], decoupling: vec![vec![one(0.0)]],
//!         lost: vec![], minimum_dwell: 0,
//!     },
//!     estimator: Estimator {
//!         method: EstimatorMethod::None, response_length: 0, window: 0, predictors: vec![], adapt: false,
//!         harmonics: None, harmonic_transfers: vec![], thresholds: vec![1.0], debounce: 1, stuck_after: 0,
//!         leverage_limit: 100.0, largest_fault: vec![10.0], hypotheses: None,
//!     },
//!     compensation: Compensation::None,
//!     input_limits: vec![Limits::default()],
//! })?;
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
