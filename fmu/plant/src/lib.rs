//! The plant FMU.
