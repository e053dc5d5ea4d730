//! Saved states: whatever changes is in them, and nothing else.
//!
//! promise: saved-states

use crate::Pair;
use fmu_host::Coupling::GaussSeidel;
use fmu_host::Loop;
use fmu_host::types::Status;

fn run(closed: &mut Loop, from: usize, to: usize) -> Vec<Vec<u64>> {
    let step = |k: usize| {
        closed.step_to((k + 1) as f64, GaussSeidel, true);
        closed.bits()
    };
    (from..to).map(step).collect()
}

#[test]
fn rollback_gives_the_same_bits_at_every_stage_of_the_experiment() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    // Before, within and after the first fault, and across the switch of modes.
    for (from, to) in [
        (0, 90),
        (90, 110),
        (110, 395),
        (395, 410),
        (410, 795),
        (795, 820),
    ] {
        let instances = [&closed.controller, &closed.plant];
        let saved = instances.map(|it| it.save());
        let bytes = instances.map(|it| it.bytes());
        let first = run(&mut closed, from, to);
        for (it, state) in [&closed.controller, &closed.plant].into_iter().zip(saved) {
            assert_eq!(it.restore(state), Status::Ok);
        }
        closed = closed.at(from as f64);
        assert_eq!(run(&mut closed, from, to), first);
        for (it, bytes) in [&closed.controller, &closed.plant].into_iter().zip(&bytes) {
            assert_eq!(it.restore(it.read_bytes(bytes)), Status::Ok);
            assert_eq!(&it.bytes(), bytes);
        }
        closed = closed.at(from as f64);
        assert_eq!(run(&mut closed, from, to), first);
    }
}

#[test]
fn bytes_go_on_in_another_instance() {
    let pair = Pair::load();
    let (mut closed, mut other) = (pair.close(0.0), pair.close(0.0));
    run(&mut closed, 0, 150);
    for (from, to) in [
        (&closed.controller, &other.controller),
        (&closed.plant, &other.plant),
    ] {
        assert_eq!(to.restore(to.read_bytes(&from.bytes())), Status::Ok);
    }
    other = other.at(150.0);
    assert_eq!(run(&mut other, 150, 300), run(&mut closed, 150, 300));
}

#[test]
fn reset_equals_a_fresh_instance() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    let fresh = [pair.fresh(0).bytes(), pair.fresh(1).bytes()];
    let first = run(&mut closed, 0, 500);
    for (it, fresh) in [&closed.controller, &closed.plant].into_iter().zip(&fresh) {
        assert_eq!(it.reset(), Status::Ok);
        assert_eq!(&it.bytes(), fresh);
    }
    closed.begin();
    assert_eq!(run(&mut closed, 0, 500), first);
}

#[test]
fn damaged_and_foreign_bytes_are_refused() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    run(&mut closed, 0, 5);
    let (controller, plant) = (&closed.controller, &closed.plant);
    for (it, foreign) in [(controller, plant), (plant, controller)] {
        let bytes = it.bytes();
        for bit in (0..8 * bytes.len()).step_by(97) {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(it.read_bytes(&damaged).is_null(), "bit {bit}");
        }
        assert!(it.read_bytes(&bytes[..bytes.len() - 1]).is_null());
        assert!(it.read_bytes(&foreign.bytes()).is_null());
        assert!(!it.read_bytes(&bytes).is_null());
    }
}

/// Bytes that somebody altered under a checksum that holds. Found by fuzzing: a state said to be
/// "fatal" was taken, and then nothing could be done with the instance any more.
#[test]
fn forged_phases_and_sizes_are_refused() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    run(&mut closed, 0, 5);
    for (it, model) in [&closed.controller, &closed.plant]
        .into_iter()
        .zip(&pair.models)
    {
        let bytes = it.bytes();
        let read = |at: usize, value: u8| {
            let mut altered = bytes[..bytes.len() - 4].to_vec();
            altered[at] = value;
            let checksum = crc32fast::hash(&altered);
            altered.extend(checksum.to_le_bytes());
            it.read_bytes(&altered)
        };
        // A mark of 8 bytes, the length of the guid, the guid, the phase by its number.
        let phase = 8 + 1 + model.guid.len();
        assert_eq!(bytes[phase], 2, "step complete");
        for savable in [0, 1, 2, 4, 6, 7] {
            assert!(!read(phase, savable).is_null(), "phase {savable}");
        }
        for never in [3, 5, 8, 9, 255] {
            assert!(read(phase, never).is_null(), "phase {never}");
        }
        // Whatever byte is altered: refused, or as good as any state.
        let body = &bytes[..bytes.len() - 4];
        for (at, byte) in body.iter().enumerate().skip(8) {
            let state = read(at, byte ^ 0x55);
            if !state.is_null() {
                assert_eq!(it.restore(state), Status::Ok);
                assert_eq!(it.reset(), Status::Ok, "byte {at}");
            }
        }
    }
}
