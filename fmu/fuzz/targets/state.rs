//! Forged saved states of the controller: edited bytes under a checksum that holds.
//!
//! promise: hostile-calls

#![no_main]

use fmu_host::model::example;
use fmu_host::random_calls::{Call, fresh, play};
use fmu_host::types::Status;
use fmu_host::{Instance, Model};
use ftc_controller_fmu as _;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

thread_local! {
    static INSTANCE: Instance =
        Instance::new(fmu_host::linked!(), &Model::controller(&example())).unwrap();
}

/// The bytes of a state as it was saved after some ticks.
static UNCHANGED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let model = Model::controller(&example());
    let it = Instance::new(fmu_host::linked!(), &model).unwrap();
    it.initialize(0.0, |_| ());
    for k in 0..50 {
        assert_eq!(it.step(f64::from(k), 1.0), Status::Ok);
    }
    it.bytes()
});

fuzz_target!(|input: (Vec<(u16, u8)>, Option<u16>, Vec<Call>)| {
    let (edits, length, calls) = input;
    let mut bytes = UNCHANGED[..UNCHANGED.len() - 4].to_vec();
    for (at, value) in edits {
        let at = usize::from(at) % bytes.len();
        bytes[at] = value;
    }
    bytes.truncate(length.map_or(usize::MAX, usize::from));
    let checksum = crc32fast::hash(&bytes);
    bytes.extend(checksum.to_le_bytes());
    INSTANCE.with(|it| {
        fresh(it);
        let mut state = it.read_bytes(&bytes);
        if !state.is_null() {
            assert_eq!(it.restore(state), Status::Ok);
            play(it, &calls);
            // SAFETY: a good place for the state, which is known.
            unsafe { (it.functions().free_fmu_state)(it.c, &mut state) };
        }
    });
});
