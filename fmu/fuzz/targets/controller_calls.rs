//! Random sequences of calls with random arguments on the controller.

#![no_main]

use fmu_fuzz::{Call, play};
use fmu_host::model::example;
use fmu_host::{Instance, Model};
use ftc_controller as _;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static MODEL: LazyLock<Model> = LazyLock::new(|| Model::controller(&example()));

fuzz_target!(|calls: Vec<Call>| {
    let it = Instance::new(fmu_host::linked!(), &MODEL).unwrap();
    play(&it, &calls);
});
