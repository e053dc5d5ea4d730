//! Forged designs for the plant.
//!
//! promise: hostile-calls

#![no_main]

use fmu_fuzz::design::{Edit, forge};
use ftc_plant_fmu::PlantFmu;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|edits: Vec<Edit>| forge::<PlantFmu>("ftc_plant", &edits));
