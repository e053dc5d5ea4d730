//! What the proposed controller is compared with.

#[cfg(feature = "design")]
mod additive;
mod deadbeat;
#[cfg(feature = "design")]
pub mod predictive;

#[cfg(feature = "design")]
pub use additive::additive;
pub use deadbeat::{deadbeat_bound, response_delay};
