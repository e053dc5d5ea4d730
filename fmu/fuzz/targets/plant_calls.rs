//! Random sequences of calls with random arguments on the plant.

#![no_main]

use fmu_fuzz::{Call, play};
use fmu_host::model::example;
use fmu_host::{Instance, Model};
use ftc_plant as _;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static MODEL: LazyLock<Model> = LazyLock::new(|| Model::plant(&example()));

fuzz_target!(|calls: Vec<Call>| {
    let it = Instance::new(fmu_host::linked!(), &MODEL).unwrap();
    play(&it, &calls);
});
