//! Forged designs for the controller.
//!
//! promise: hostile-calls

#![no_main]

use fmu_fuzz::design::{Edit, load_edited};
use ftc_controller_fmu::ControllerFmu;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|edits: Vec<Edit>| load_edited::<ControllerFmu>("ftc_controller", &edits));
