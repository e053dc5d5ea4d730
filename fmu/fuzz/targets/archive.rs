//! Archives that `verify` reads, damaged in any way.
//!
//! promise: hostile-calls

#![no_main]

use fmu_fuzz::archive::{Damage, read};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|damage: Damage| read(&damage));
