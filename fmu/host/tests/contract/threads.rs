//! Many instances, many threads, and a library that comes and goes.
//!
//! promise: independent-instances

use crate::Pair;
use fmu_host::Coupling::GaussSeidel;
use fmu_host::Loop;
use std::thread;

fn run(closed: &mut Loop) -> Vec<Vec<u64>> {
    let step = |k| {
        closed.step_to(f64::from(k + 1), GaussSeidel, true);
        closed.bits()
    };
    (0..300).map(step).collect()
}

/// 100 instances, half of them controllers, in 8 threads, their steps interleaved.
#[test]
fn a_hundred_instances_in_eight_threads_do_not_know_of_each_other() {
    let pair = Pair::load();
    let expected = run(&mut pair.close(0.0));
    thread::scope(|scope| {
        for number in 0..8 {
            let (pair, expected) = (&pair, &expected);
            scope.spawn(move || {
                let count = if number < 2 { 7 } else { 6 };
                let mut loops: Vec<Loop> = (0..count).map(|_| pair.close(0.0)).collect();
                for (k, expected) in (0..300).zip(expected) {
                    for closed in &mut loops {
                        closed.step_to(f64::from(k + 1), GaussSeidel, true);
                        assert_eq!(&closed.bits(), expected);
                    }
                }
            });
        }
    });
}

#[test]
fn an_instance_may_change_its_thread() {
    let pair = Pair::load();
    let expected = run(&mut pair.close(0.0));
    let mut closed = pair.close(0.0);
    for (k, expected) in (0..300).zip(expected) {
        let step = || {
            closed.step_to(f64::from(k + 1), GaussSeidel, true);
            closed.bits()
        };
        let bits = thread::scope(|scope| scope.spawn(step).join().unwrap());
        assert_eq!(bits, expected);
    }
}

#[test]
fn a_library_is_unloaded_and_loaded_again() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    let first = run(&mut closed);
    drop(closed);
    let Pair { libraries, models } = pair;
    libraries.into_iter().for_each(fmu_host::Library::unload);
    let again = Pair {
        models,
        ..Pair::load()
    };
    assert_eq!(run(&mut again.close(0.0)), first);
}
