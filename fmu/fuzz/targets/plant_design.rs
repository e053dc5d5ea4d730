//! Forged designs for the plant.
//!
//! promise: hostile-calls

#![no_main]

use fmu_fuzz::design::{Edit, load_edited};
use ftc_plant_fmu::PlantFmu;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|edits: Vec<Edit>| load_edited::<PlantFmu>("ftc_plant", &edits));
