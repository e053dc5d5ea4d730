//! Off line: gains, observers, predictor and certificate.
//!
//! The data types and the certificate need no solver; making gains does (feature `design`).

pub mod augmented;
pub mod certificate;
pub mod commissioning;
#[cfg(feature = "design")]
pub mod lmi;
mod lyapunov;
mod record;
mod spec;
pub mod state_feedback;
mod units;
mod verdict;

pub use certificate::{CertificateError, ControlCertificate};
pub use lyapunov::{DwellTime, Lyapunov};
pub use record::{Design, FORMAT, Signal, Signals};
pub use spec::{ControlSpec, Objective, ObserverKind, ObserverSpec};
pub use state_feedback::{ModeGains, StateFeedback};
pub use units::Units;
pub use verdict::{
    Advice, BlockKind, BlockName, ConflictingBlock, DesignError, Infeasibility, SolverFailure,
};
