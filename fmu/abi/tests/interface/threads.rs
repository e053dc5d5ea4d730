//! Instances do not know each other.

use crate::host::*;
use fmu_abi::types::Status;
use std::thread;

/// Runs 50 steps with inputs of this instance's own; the last outputs.
fn run(it: &Instance, own: i32) -> Vec<u64> {
    for k in 0..50 {
        it.set(INPUT[0], f64::from(own * k).cos());
        it.set_mode(1 + (own + k) % 3);
        let (from, step) = (f64::from(k) * 0.1, 0.1);
        assert_eq!(it.step(from, step), Status::Ok);
    }
    it.bits()
}

#[test]
fn a_hundred_instances_in_eight_threads_are_independent() {
    let resources = Resources::new(0.1);
    let alone: Vec<_> = (0..100)
        .map(|own| run(&Instance::started(&resources, 0.0), own))
        .collect();
    let together: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (0..8)
            .map(|worker| {
                let resources = &resources;
                scope.spawn(move || {
                    let mine: Vec<i32> = (0..100).filter(|own| own % 8 == worker).collect();
                    let instances: Vec<_> = mine
                        .iter()
                        .map(|_| Instance::started(resources, 0.0))
                        .collect();
                    let pairs = mine.into_iter().zip(&instances);
                    pairs
                        .map(|(own, it)| (own, run(it, own)))
                        .collect::<Vec<_>>()
                })
            })
            .collect();
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap())
            .collect()
    });
    assert_eq!(together.len(), 100);
    for (own, bits) in together {
        assert_eq!(bits, alone[own as usize], "instance {own}");
    }
}

#[test]
fn interleaved_instances_of_one_name_are_independent() {
    let resources = Resources::new(0.1);
    let [a, b] = [0, 1].map(|_| Instance::started(&resources, 0.0));
    for k in 0..10 {
        for (it, input) in [(&a, 1.0), (&b, -2.0)] {
            it.set(INPUT[0], input);
            assert_eq!(it.step(f64::from(k) * 0.1, 0.1), Status::Ok);
        }
    }
    assert_eq!((a.real(LATE[0]), b.real(LATE[0])), (10.0, -20.0));
}
