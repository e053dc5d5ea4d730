//! Saved states: rollback, bytes, reset.
//!
//! promise: saved-states

use crate::host::*;
use crate::phases::*;
use fmu_abi::types::*;
use std::ptr::null_mut;

/// Steps `k` in `from..to`, with inputs that differ at each.
fn run(it: &Instance, from: i32, to: i32) {
    for k in from..to {
        it.set(INPUT[0], f64::from(k).sin());
        it.set(INPUT[1], 1.0 / f64::from(k + 1));
        it.set_mode(1 + k % 3);
        let status = it.step(f64::from(k) * 0.07, 0.07);
        assert_eq!(status, Status::Ok, "{}", it.last_message());
    }
}

#[test]
fn restoring_brings_back_the_same_bits() {
    let it = Instance::started(&Resources::new(0.1), 0.0);
    run(&it, 0, 10);
    let saved = it.save();
    let at_save = it.bits();
    run(&it, 10, 25);
    let later = it.bits();
    assert_ne!(at_save, later);
    for _ in 0..2 {
        assert_eq!(unsafe { fmi2SetFMUstate(it.c, saved) }, Status::Ok);
        assert_eq!(it.bits(), at_save);
        run(&it, 10, 25);
        assert_eq!(it.bits(), later);
    }
}

#[test]
fn saving_again_overwrites() {
    let it = Instance::started(&Resources::new(0.1), 0.0);
    let mut state = it.save();
    let first = state;
    run(&it, 0, 5);
    let expected = it.bits();
    assert_eq!(unsafe { fmi2GetFMUstate(it.c, &mut state) }, Status::Ok);
    assert_eq!(state, first);
    run(&it, 5, 9);
    unsafe { fmi2SetFMUstate(it.c, state) };
    assert_eq!(it.bits(), expected);
}

#[test]
fn a_state_holds_the_phase_but_not_the_loggers_switch() {
    let it = Instance::started(&Resources::new(0.1), 0.0);
    let saved = it.save();
    unsafe {
        assert_eq!(fmi2SetDebugLogging(it.c, 0, 0, null_mut()), Status::Ok);
        assert_eq!(fmi2Terminate(it.c), Status::Ok);
        assert_eq!(fmi2SetFMUstate(it.c, saved), Status::Ok);
    }
    let logged = it.messages.lock().unwrap().len();
    assert_eq!(it.step(0.0, 0.1), Status::Ok);
    assert_eq!(unsafe { fmi2Terminate(it.c) }, Status::Ok);
    assert_eq!(it.messages.lock().unwrap().len(), logged, "still off");
}

#[test]
fn a_freed_or_foreign_handle_is_refused() {
    let resources = Resources::new(0.1);
    let it = Instance::started(&resources, 0.0);
    let other = Instance::started(&resources, 0.0);
    let mut state = it.save();
    let kept = state;
    unsafe {
        assert_eq!(fmi2FreeFMUstate(it.c, &mut state), Status::Ok);
        assert!(state.is_null());
        assert_eq!(
            fmi2FreeFMUstate(it.c, &mut state),
            Status::Ok,
            "null is ignored"
        );
        assert_eq!(
            fmi2FreeFMUstate(it.c, null_mut()),
            Status::Ok,
            "null is ignored"
        );
        for mut handle in [kept, other.save(), 8 as Pointer] {
            assert_eq!(fmi2SetFMUstate(it.c, handle), Status::Error);
            assert_eq!(fmi2FreeFMUstate(it.c, &mut handle), Status::Error);
            assert_eq!(fmi2GetFMUstate(it.c, &mut handle), Status::Error);
            assert_eq!(
                fmi2SerializedFMUstateSize(it.c, handle, &mut 0),
                Status::Error
            );
        }
        assert_eq!(fmi2SetFMUstate(it.c, null_mut()), Status::Error);
    }
}

#[test]
fn bytes_carry_a_state_to_another_instance() {
    let resources = Resources::new(0.1);
    let it = Instance::started(&resources, 0.0);
    it.set(REFERENCE, -0.0);
    run(&it, 0, 12);
    it.set(INPUT[0], f64::from_bits(0x7ff8_dead_beef_0001));
    let bytes = it.serialize(it.save());
    let expected = it.bits();
    let other = Instance::new(&resources);
    let (status, state) = other.deserialize(&bytes);
    assert_eq!(status, Status::Ok);
    assert_eq!(unsafe { fmi2SetFMUstate(other.c, state) }, Status::Ok);
    assert_eq!(other.bits(), expected);
    run(&it, 12, 20);
    run(&other, 12, 20);
    assert_eq!(other.bits(), it.bits());
    assert_eq!(other.serialize(other.save()), it.serialize(it.save()));
}

#[test]
fn damaged_truncated_and_foreign_bytes_are_refused() {
    let resources = Resources::new(0.1);
    let it = Instance::started(&resources, 0.0);
    run(&it, 0, 3);
    let bytes = it.serialize(it.save());
    let refused = |bytes: &[Byte]| {
        let (status, state) = it.deserialize(bytes);
        assert_eq!(status, Status::Error);
        assert!(state.is_null());
        assert!(
            it.last_message()
                .starts_with("fmi2DeSerializeFMUstate: the bytes")
        );
    };
    for at in 0..bytes.len() * 8 {
        let mut damaged = bytes.clone();
        damaged[at / 8] ^= 1 << (at % 8);
        refused(&damaged);
    }
    for length in 1..bytes.len() {
        refused(&bytes[..length]);
    }
    refused(&[&bytes[..], &[0]].concat());
    let foreign = Resources::new(0.2);
    let other = Instance::new(&foreign);
    refused(&other.serialize(other.save()));
    assert!(it.last_message().contains(foreign.guid.to_str().unwrap()));
    assert_eq!(it.deserialize(&bytes).0, Status::Ok);
}

#[test]
fn the_size_of_the_bytes_is_checked() {
    let it = Instance::started(&Resources::new(0.1), 0.0);
    let state = it.save();
    let size = it.serialize(state).len();
    let mut bytes = vec![0; size + 1];
    for wrong in [0, size - 1, size + 1, usize::MAX] {
        let status = unsafe { fmi2SerializeFMUstate(it.c, state, bytes.as_mut_ptr(), wrong) };
        assert_eq!(status, Status::Error);
        assert!(
            it.last_message()
                .contains(&format!("the state has {size} bytes"))
        );
    }
    let status = unsafe { fmi2SerializeFMUstate(it.c, state, null_mut(), size) };
    assert_eq!(status, Status::Error);
}

#[test]
fn reset_equals_a_fresh_instance_bit_for_bit() {
    let resources = Resources::new(0.1);
    let it = Instance::started(&resources, -4.0);
    it.set(GAIN, 3.0);
    it.set(INPUT[1], f64::NAN);
    assert_eq!(it.step(-4.0, 0.35), Status::Ok);
    assert_eq!(unsafe { fmi2Reset(it.c) }, Status::Ok);
    assert_eq!(it.serialize(it.save()), fresh_bytes(&resources));
    let fresh = Instance::started(&resources, 0.0);
    it.start(0.0);
    for it in [&it, &fresh] {
        run(it, 0, 20);
    }
    assert_eq!(it.bits(), fresh.bits());
}
