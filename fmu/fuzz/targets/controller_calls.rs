//! Random sequences of calls with random arguments on the controller.
//!
//! promise: hostile-calls

#![no_main]

use fmu_host::model::example;
use fmu_host::random_calls::{Call, fresh, play};
use fmu_host::{Instance, Model};
use ftc_controller_fmu as _;
use libfuzzer_sys::fuzz_target;

thread_local! {
    /// Made once: loading a design takes longer than most sequences.
    static INSTANCE: Instance =
        Instance::new(fmu_host::linked!(), &Model::controller(&example())).unwrap();
}

fuzz_target!(|calls: Vec<Call>| INSTANCE.with(|it| {
    fresh(it);
    play(it, &calls);
}));
