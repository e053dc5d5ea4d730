//! Ticks are counted by time: any steps give the same values at common times.

mod common;

use common::*;
use fmu_abi::types::Status;

/// Runs to `end` by the given steps; the input is 1 + the number of ticks that have ended.
fn run(steps: impl IntoIterator<Item = f64>, start: f64) -> Instance {
    let resources = Resources::new(0.1);
    let instance = Instance::started(&resources, start);
    let mut time = start;
    for step in steps {
        assert_eq!(instance.set(INPUT[0], 1.0), Status::Ok);
        assert_eq!(instance.step(time, step), Status::Ok, "at {time}");
        time += step;
    }
    instance
}

#[test]
fn one_tick_for_each_regular_step() {
    let instance = run([0.1; 10], 0.0);
    assert_eq!(instance.ticks(), 10);
    assert_eq!(instance.real(EARLY[0]), 10.0);
}

#[test]
fn short_long_and_odd_steps_count_the_same() {
    for start in [0.0, -7.3, 12.345, 1e6] {
        for (steps, length) in [(70, 0.1 / 7.0), (10, 0.1), (4, 0.35), (2, 0.7), (1, 1.4)] {
            let instance = run((0..steps).map(|_| length), start);
            let ticks = (f64::from(steps) * length / 0.1 + 1e-6).floor();
            assert_eq!(f64::from(instance.ticks()), ticks, "{length} from {start}");
            assert_eq!(instance.real(LATE[0]), ticks, "{length} from {start}");
        }
    }
}
