//! Off line: gains, observers, predictor and certificate.
//!
//! Gains are made by a conic solver; certificates are proved without one. The solver links eight symbols of a
//! BLAS and LAPACK: leave the feature `lapack` off in a program that links one, switch it on in a program that
//! does not.
//!
//! Inside a thread pool of `rayon` (`pool.install(|| ...)`) parts that are independent, such as the modes under
//! `dwell`, are worked on at the same time, with the same result to the bit.
//!
//! ```
//! use ftc_design::{ControlSpec, state_feedback};
//! use ftc_plant::{Mode, SwitchedPlant, scaling::Scaling};
//! use nalgebra::dmatrix;
//!
//! let mode = |pole: f64| {
//!     Mode::new(dmatrix![pole, 0.1; 0.0, 0.5], dmatrix![0.0; 1.0], dmatrix![1.0, 0.0])
//!         .with_disturbance(dmatrix![0.1; 0.0], dmatrix![0.0])
//! };
//! let plant = SwitchedPlant::new(1.0, vec![mode(0.9), mode(0.8)]);
//! let scaling = Scaling::automatic(&plant);
//! let mut spec = ControlSpec::new(&scaling);
//! spec.decay = 0.98;
//! let control = state_feedback::synthesise(&plant, &spec, &scaling)?;
//! control.verify(&plant)?; // from the very doubles, without the solver
//! assert!(control.spectral_radius.iter().all(|&radius| radius < 0.98));
//! # Ok::<(), ftc_design::DesignError>(())
//! ```

pub mod apart;
pub mod as_printed;
pub mod assembly;
pub mod augmented;
mod blocks;
pub mod certificate;
pub mod commissioning;
mod controllability;
pub mod coverage;
mod defaults;
pub mod derived;
mod estimator_spec;
mod feedforward;
mod finished;
mod grey_box;
pub mod harmonics;
mod hypotheses;
mod interior_point;
pub mod lmi;
mod lyapunov;
pub mod observer;
mod parallel;
mod proof;
mod pseudo_inverse;
pub mod quadratic;
mod request;
pub mod riccati;
pub mod running_loop;
mod solver;
pub mod spec;
pub mod state_feedback;
mod steady_state;
mod synthesis;
mod units;
mod verdict;
pub mod warnings;
pub mod weights;
pub mod words;
pub mod work;

pub use blocks::{BlockKind, BlockName};
pub use certificate::{CertificateError, ControlCertificate};
pub use controllability::{Uncontrollable, check_controllable};
pub use defaults::MODE_LENGTH;
pub use finished::Design;
pub use ftc_record::{
    ControllerDesign, DesignRecord, FORMAT, RecordError, Signal, Signals, dense, mode_models, plain,
};
pub use hypotheses::HypothesesSpec;
pub use lyapunov::{DwellTime, Lyapunov};
pub use observer::{LostCertificate, ObserverCertificate, ObserverDesign};
pub use parallel::MOST_THREADS;
pub use proof::{ControlProof, ObserverProof, Proof};
pub use request::RequestError;
pub use running_loop::{LostSensors, RunningLoop, SwitchingGain};
pub use solver::{Run, Solver, Step};
pub use spec::{
    ControlSpec, DecayRate, EstimatorNumber, Objective, ObserverChoice, ObserverSpec, SpecError,
    Weight,
};
pub use state_feedback::{ModeGains, StateFeedback};
pub use steady_state::steady_state;
pub use synthesis::{Failure, Synthesis};
pub use synthesis::{synthesise, synthesise_with};
pub use units::Units;
pub use verdict::{
    Advice, ConflictingBlock, DesignError, Infeasibility, SolverFailure, Uncertified,
};
