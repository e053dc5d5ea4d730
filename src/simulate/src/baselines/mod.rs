//! What the proposed controller is compared with.

#[cfg(feature = "solver")]
mod additive;
#[cfg(feature = "solver")]
pub mod comparison;
mod deadbeat;
#[cfg(feature = "solver")]
pub mod predictive;

#[cfg(feature = "solver")]
pub use additive::additive;
pub use deadbeat::{DeadbeatSum, deadbeat_bound, response_delay};
