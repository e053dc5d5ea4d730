//! What the proposed controller is compared with.

mod deadbeat;
#[cfg(feature = "design")]
pub mod predictive;

pub use deadbeat::deadbeat_bound;
