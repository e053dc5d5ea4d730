//! Certificates that `verify` proves, and the designs they are of, changed in any way.
//!
//! promise: hostile-calls

#![no_main]

use fmu_fuzz::certificate::{Forged, prove_forged};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|forged: Forged| prove_forged(&forged));
