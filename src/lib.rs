//! Sensor-fault-tolerant control of switched linear systems.
//!
//! The signal walks through four rooms: a [`plant`] is described, a controller is designed and
//! certified for it ([`design`]), the controller runs on line ([`control`]), and the loop is
//! tried before it is trusted ([`simulate`]).

pub mod control;
pub mod design;
pub mod plant;
pub mod rows;
pub mod simulate;
pub mod state;
