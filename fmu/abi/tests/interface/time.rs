//! Ticks are counted by time: any steps give the same values at common times.
//!
//! promise: counted-time

use crate::host::*;
use fmu_abi::clock::{Clock, Event};
use fmu_abi::types::{LAST_SUCCESSFUL_TIME, Status, TERMINATED};
use proptest::prelude::*;

/// Runs the steps with input 1 from `start`.
fn run(steps: impl IntoIterator<Item = f64>, start: f64) -> Instance {
    let instance = Instance::started(&Resources::new(0.1), start);
    assert_eq!(instance.set(INPUT[0], 1.0), Status::Ok);
    let mut time = start;
    for step in steps {
        let status = instance.step(time, step);
        assert_eq!(status, Status::Ok, "at {time}: {}", instance.last_message());
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
    for start in [0.0, -7.3, 12.345, 1e6, -1e9, 1e9] {
        for (steps, length) in [(70, 0.1 / 7.0), (10, 0.1), (4, 0.35), (2, 0.7), (1, 1.4)] {
            let instance = run((0..steps).map(|_| length), start);
            let ticks = (f64::from(steps) * length / 0.1 + 1e-6).floor();
            assert_eq!(f64::from(instance.ticks()), ticks, "{length} from {start}");
            assert_eq!(instance.real(LATE[0]), ticks, "{length} from {start}");
        }
    }
}

#[test]
fn a_tick_begins_beyond_its_time_and_ends_when_the_next_is_reached() {
    let instance = Instance::started(&Resources::new(1.0), 0.0);
    let seen = |input: f64, from: f64, step: f64| {
        assert_eq!(instance.set(INPUT[0], input), Status::Ok);
        assert_eq!(instance.step(from, step), Status::Ok);
        (
            instance.real(EARLY[0]),
            instance.real(LATE[0]),
            instance.ticks(),
        )
    };
    assert_eq!(seen(1.0, 0.0, 0.25), (1.0, 0.0, 0), "begun, not ended");
    assert_eq!(
        seen(9.0, 0.25, 0.5),
        (1.0, 0.0, 0),
        "inputs between ticks are not seen"
    );
    assert_eq!(
        seen(9.0, 0.75, 0.25),
        (1.0, 1.0, 1),
        "ended; the next has not begun"
    );
    assert_eq!(
        seen(10.0, 1.0, 2.5),
        (31.0, 21.0, 3),
        "two whole ticks and a beginning"
    );
    assert_eq!(seen(99.0, 3.5, 0.5), (31.0, 31.0, 4), "its end");
}

#[test]
fn a_tiny_step_changes_nothing() {
    let instance = run([0.1, 0.1], 0.0);
    let before = instance.bits();
    for _ in 0..1000 {
        assert_eq!(instance.step(0.2, 1e-16), Status::Ok);
    }
    assert_eq!(instance.bits(), before);
    assert_eq!(instance.step(0.2, 0.1), Status::Ok);
    assert_eq!(instance.ticks(), 3);
}

#[test]
fn tiny_steps_add_up() {
    // The second: steps of two units in the last place of the importer's time.
    for (period, start, step) in [(1.0, 0.0, 2f64.powi(-20)), (0.0078125, 1e9, 2f64.powi(-22))] {
        let steps = (2.0 * period / step) as u64;
        let points = (0..steps).map(|k| (start + k as f64 * step, step));
        assert_eq!(count(period, start, points), (2, 2), "from {start}");
    }
}

/// Counts the ticks of a run without an instance: begun and ended.
fn count(period: f64, start: f64, steps: impl Iterator<Item = (f64, f64)>) -> (u64, u64) {
    count_until(None, period, start, steps)
}

/// The same with a stop time.
fn count_until(
    stop: Option<f64>,
    period: f64,
    start: f64,
    steps: impl Iterator<Item = (f64, f64)>,
) -> (u64, u64) {
    let mut clock = Clock::new(period);
    clock.set_up(start, stop).unwrap();
    let (mut begun, mut ended) = (0, 0);
    for (from, step) in steps {
        clock.advance(from, step).unwrap();
        while let Some(event) = clock.next_event() {
            match event {
                Event::Begin(k) => {
                    assert_eq!(k, begun);
                    begun += 1;
                }
                Event::End(k) => {
                    assert_eq!(k, ended);
                    ended += 1;
                }
            }
        }
    }
    (begun, ended)
}

/// How importers compute their communication points; each yields (point, step).
fn masters(count: u64, start: f64, step: f64) -> Vec<Box<dyn Iterator<Item = (f64, f64)>>> {
    let nanoseconds = (step * 1e9).round();
    let mut sum = start;
    let mut other = start;
    vec![
        // Adds up, and passes the step.
        Box::new((0..count).map(move |_| {
            let from = sum;
            sum += step;
            (from, step)
        })),
        // Adds up, and passes differences.
        Box::new((0..count).map(move |_| {
            let from = other;
            other += step;
            (from, other - from)
        })),
        // Multiplies, and passes the step.
        Box::new((0..count).map(move |k| (start + k as f64 * step, step))),
        // Multiplies, and passes differences.
        Box::new((0..count).map(move |k| {
            let [from, to] = [k, k + 1].map(|k| start + k as f64 * step);
            (from, to - from)
        })),
        // Counts whole nanoseconds.
        Box::new(
            (0..count).map(move |k| (start + k as f64 * nanoseconds * 1e-9, nanoseconds * 1e-9)),
        ),
        // Computes with single-precision steps.
        Box::new((0..count).map(move |k| {
            let step = f64::from(step as f32);
            (start + k as f64 * step, step)
        })),
    ]
}

#[test]
fn ten_million_steps_count_right_whatever_the_master_adds_up() {
    const STEPS: u64 = 10_000_000;
    // The sum of 0.1 comes out too small, that of 0.7 too great, by more than a thousandth.
    for period in [0.1, 0.7] {
        let stop = Some(STEPS as f64 * period);
        for (master, steps) in masters(STEPS, 0.0, period).into_iter().enumerate() {
            // Single precision makes another run of it, with another end.
            let stop = stop.filter(|_| master < 5);
            let counted = count_until(stop, period, 0.0, steps);
            assert_eq!(counted, (STEPS, STEPS), "{period}, master {master}");
        }
    }
}

#[test]
fn awkward_periods_and_start_times_count_right() {
    const TICKS: u64 = 30_000;
    for period in [1.0 / 3.0, 0.1, 1e-3, 0.02, 7.0, 1e-4] {
        for start in [0.0, -1.0 / 3.0, 1e9, -123_456.789_f64] {
            for split in [1, 2, 7] {
                let step = period / split as f64;
                let blur = (start.abs().next_up() - start.abs()) / step;
                for (master, steps) in masters(TICKS * split, start, step).into_iter().enumerate() {
                    let expressible = match master {
                        // Rounding errors add up to less than a tick.
                        0 | 1 => blur < 1e-5,
                        2 | 3 => true,
                        // A nanosecond or a single-precision step is nothing beside a tick.
                        _ => split == 1 && blur < 1e-5 && period >= 1e-3,
                    };
                    if expressible {
                        let what = format!("{period} from {start} by 1/{split}, master {master}");
                        assert_eq!(count(period, start, steps), (TICKS, TICKS), "{what}");
                    }
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn irregular_steps_agree_with_the_regular_run(
        lengths in prop::collection::vec(1u32..1000, 1..60),
        start in -1e4..1e4f64,
        inputs in prop::collection::vec(-9i32..10, 200),
    ) {
        // Communication points in thousandths of ten ticks; inputs change at ticks only.
        let resources = Resources::new(0.1);
        let (odd, regular) = (Instance::started(&resources, start), Instance::started(&resources, start));
        let mut points: Vec<u32> = lengths
            .iter()
            .scan(0, |at, length| { *at += length; Some(*at) })
            .collect();
        let last = points.last().copied().unwrap_or(0).div_ceil(100) * 100;
        points.extend((0..=last).step_by(100));
        points.sort_unstable();
        points.dedup();
        let time = |point: u32| start + f64::from(point) * 1e-3;
        for pair in points.windows(2) {
            let tick = (pair[0] / 100) as usize;
            prop_assert_eq!(odd.set(INPUT[0], f64::from(inputs[tick % 200])), Status::Ok);
            prop_assert_eq!(odd.step(time(pair[0]), time(pair[1]) - time(pair[0])), Status::Ok);
            if pair[1] % 100 == 0 {
                prop_assert_eq!(regular.set(INPUT[0], f64::from(inputs[tick % 200])), Status::Ok);
                let from = pair[1] - 100;
                prop_assert_eq!(regular.step(time(from), time(pair[1]) - time(from)), Status::Ok);
                prop_assert_eq!(odd.bits(), regular.bits());
            }
        }
    }
}

/// How two FMUs are stepped between communication points.
#[derive(Clone, Copy, Debug)]
enum Coupling {
    /// The controller first, then the plant.
    GaussSeidel,
    /// Both from the same old values.
    Jacobi,
}

/// Closes a loop of two staircases over six ticks of 0.1; the outputs at each tick.
///
/// The controller publishes early, the plant late. The points divide each tick in parts.
fn closed_loop(coupling: Coupling, parts: &[f64]) -> Vec<Vec<u64>> {
    let resources = Resources::new(0.1);
    let [controller, plant] = [0, 1].map(|_| {
        let it = Instance::new(&resources);
        assert_eq!(it.set(REFERENCE, 1.0), Status::Ok);
        it.start(0.0);
        it
    });
    controller.set(GAIN, -0.3);
    let feed = |to: &Instance, from: f64| assert_eq!(to.set(INPUT[0], from), Status::Ok);
    let mut history = Vec::new();
    for tick in 0..6 {
        let time = |part: f64| (f64::from(tick) + part) * 0.1;
        for pair in parts.windows(2) {
            let (from, to) = (time(pair[0]), time(pair[1]));
            feed(&controller, plant.real(LATE[0]));
            if let Coupling::Jacobi = coupling {
                feed(&plant, controller.real(EARLY[0]));
            }
            assert_eq!(controller.step(from, to - from), Status::Ok);
            if let Coupling::GaussSeidel = coupling {
                feed(&plant, controller.real(EARLY[0]));
            }
            assert_eq!(plant.step(from, to - from), Status::Ok);
        }
        let outputs = [controller.real(EARLY[0]), plant.real(LATE[0])];
        history.push(outputs.map(f64::to_bits).to_vec());
    }
    history
}

#[test]
fn a_closed_loop_does_not_depend_on_the_steps() {
    let sevenths: Vec<f64> = (0..=7).map(|part| f64::from(part) / 7.0).collect();
    for coupling in [Coupling::GaussSeidel, Coupling::Jacobi] {
        let regular = closed_loop(coupling, &[0.0, 1.0]);
        for parts in [&sevenths[..], &[0.0, 0.01, 0.9, 1.0], &[0.0, 0.5, 1.0]] {
            assert_eq!(
                closed_loop(coupling, parts),
                regular,
                "{coupling:?} {parts:?}"
            );
        }
    }
    let [direct, delayed] =
        [Coupling::GaussSeidel, Coupling::Jacobi].map(|it| closed_loop(it, &[0.0, 1.0]));
    assert_ne!(
        direct, delayed,
        "Jacobi puts a sample of delay into the loop"
    );
}

#[test]
fn impossible_steps_are_refused_and_change_nothing() {
    let instance = run([0.1, 0.1], 0.0);
    let before = instance.bits();
    let cases = [
        (0.2, -0.1, "communicationStepSize is -0.1"),
        (0.2, 0.0, "communicationStepSize is 0"),
        (0.2, f64::NAN, "communicationStepSize is NaN"),
        (0.2, f64::INFINITY, "communicationStepSize is inf"),
        (f64::NAN, 0.1, "currentCommunicationPoint is NaN"),
        (f64::INFINITY, 0.1, "currentCommunicationPoint is inf"),
        (0.3, 0.1, "currentCommunicationPoint is 0.3"),
        (0.1, 0.1, "currentCommunicationPoint is 0.1"),
    ];
    for (from, step, expected) in cases {
        assert_eq!(instance.step(from, step), Status::Error, "{from}, {step}");
        let message = instance.last_message();
        assert!(
            message.starts_with("fmi2DoStep: ") && message.contains(expected),
            "{message}"
        );
        assert_eq!(instance.bits(), before);
    }
    assert_eq!(instance.step(0.2, 0.1), Status::Ok);
    assert_eq!(instance.ticks(), 3);
}

#[test]
fn the_stop_time_is_kept_up_to_rounding() {
    let instance = Instance::new(&Resources::new(0.1));
    unsafe {
        assert_eq!(
            fmi2SetupExperiment(instance.c, 0, 0.0, 0.0, 1, 1.0),
            Status::Ok
        );
        assert_eq!(fmi2EnterInitializationMode(instance.c), Status::Ok);
        assert_eq!(fmi2ExitInitializationMode(instance.c), Status::Ok);
    }
    let mut time = 0.0;
    for _ in 0..10 {
        assert_eq!(
            instance.step(time, 0.10000000000000003),
            Status::Ok,
            "at {time}"
        );
        time += 0.10000000000000003;
    }
    assert_eq!(instance.step(time, 0.1), Status::Error);
    assert!(instance.last_message().contains("after stopTime 1"));
    assert_eq!(instance.ticks(), 10);
}

#[test]
fn an_impossible_experiment_is_refused() {
    let instance = Instance::new(&Resources::new(0.1));
    let set_up = |start, stop| unsafe { fmi2SetupExperiment(instance.c, 0, 0.0, start, 1, stop) };
    assert_eq!(set_up(f64::NAN, 1.0), Status::Error);
    assert_eq!(set_up(f64::INFINITY, 1.0), Status::Error);
    assert_eq!(set_up(2.0, 1.0), Status::Error);
    assert_eq!(set_up(2.0, f64::NAN), Status::Error);
    assert!(instance.last_message().contains("stopTime NaN"));
    assert_eq!(set_up(2.0, f64::INFINITY), Status::Ok);
}

#[test]
fn a_run_starts_at_its_start_time() {
    let instance = Instance::started(&Resources::new(0.1), 5.0);
    assert_eq!(instance.step(0.0, 0.1), Status::Error);
    assert_eq!(instance.step(5.0, 0.1), Status::Ok);
}

#[test]
fn the_last_successful_time_is_told() {
    let instance = run([0.1, 0.35], 2.0);
    let mut time = f64::NAN;
    let status = unsafe { fmi2GetRealStatus(instance.c, LAST_SUCCESSFUL_TIME, &mut time) };
    assert_eq!((status, time), (Status::Ok, 2.0 + 0.1 + 0.35));
}

#[test]
fn a_step_is_taken_as_it_was_meant() {
    let cases: [(f64, f64, u64, u64); 9] = [
        // Sample time, step, steps for one tick, ticks in one step.
        (1.0 / 60.0, 0.0166667, 1, 1),
        (1.0, 0.99999, 1, 1),
        (1.0, 1.0009, 1, 1),
        (1.0 / 3.0, 0.333, 1, 1),
        (1.0, 0.142857, 7, 1),
        (1.0, 0.333, 3, 1),
        (1.0, 0.0100001, 100, 1),
        (0.1, 0.300001, 1, 3),
        (1.0 / 60.0, 0.16667, 1, 10),
    ];
    for (at, (period, step, parts, ticks)) in cases.into_iter().enumerate() {
        let steps = if at < 2 { 10_000_000 } else { 1_000_000 };
        let mut sum = 0.0;
        let added = (0..steps).map(|_| {
            let from = sum;
            sum += step;
            (from, step)
        });
        let expected = steps / parts * ticks;
        let (begun, ended) = count(period, 0.0, added);
        let what = format!("{period} by {step}");
        assert_eq!(ended, expected, "{what}");
        assert!(begun == ended || begun == ended + 1, "{what}: {begun}");
    }
}

#[test]
fn points_rounded_to_four_digits_never_run_ahead_of_their_inputs() {
    let rounded = |k: u64| (k as f64 / 30.0 * 1e4).round() / 1e4;
    let mut clock = Clock::new(1.0 / 30.0);
    clock.set_up(0.0, None).unwrap();
    for k in 0..100_000 {
        let before = clock;
        let step = rounded(k + 1) - rounded(k);
        clock.advance(rounded(k), step).unwrap();
        let events: Vec<_> = std::iter::from_fn(|| clock.next_event()).collect();
        assert_eq!(events, [Event::Begin(k), Event::End(k)]);
        assert!(!before.begins_within(k));
    }
}

#[test]
fn a_tick_on_old_inputs_is_told_once() {
    let quiet = [
        (0.1, 0.1),
        (0.1, 0.099999),
        (0.1, 0.1 / 7.0),
        (0.1, 0.0142857),
        (1.0 / 60.0, 0.0166667),
        (0.1, 1e-5),
    ];
    for (period, step) in quiet {
        let it = Instance::started(&Resources::new(period), 0.0);
        for k in 0..300 {
            assert_eq!(it.step(f64::from(k) * step, step), Status::Ok);
        }
        assert_eq!(it.warnings(), Vec::<String>::new(), "{period} by {step}");
    }
    for (period, step) in [
        (0.1, 0.09),
        (0.1, 0.11),
        (0.1, 0.3),
        (0.1, 0.07),
        (1.0 / 60.0, 0.0167),
    ] {
        let it = Instance::started(&Resources::new(period), 0.0);
        for k in 0..300 {
            assert_eq!(it.step(f64::from(k) * step, step), Status::Ok);
        }
        let warnings = it.warnings();
        assert_eq!(warnings.len(), 1, "{period} by {step}: {warnings:?}");
        for words in [
            "old inputs",
            &format!("step of {step} s"),
            &format!("time is {period} s"),
        ] {
            assert!(warnings[0].contains(words), "{warnings:?}");
        }
    }
}

#[test]
fn a_step_of_too_many_ticks_is_done_in_part_and_discarded() {
    let resources = Resources::new(0.1);
    for length in [10_000.5, 1e9, 1e300] {
        let it = Instance::started(&resources, 5.0);
        it.set(INPUT[0], 1.0);
        let saved = it.save();
        assert_eq!(it.step(5.0, length), Status::Discard);
        let message = it.last_message();
        for words in ["100000 ticks", "up to 10005 s", "at most 10000 s"] {
            assert!(message.contains(words), "{message}");
        }
        assert_eq!(it.ticks(), 100_000);
        let (mut time, mut ends) = (0.0, -1);
        let status = unsafe { fmi2GetRealStatus(it.c, LAST_SUCCESSFUL_TIME, &mut time) };
        assert_eq!((status, time), (Status::Ok, 10_005.0));
        let status = unsafe { fmi2GetBooleanStatus(it.c, TERMINATED, &mut ends) };
        assert_eq!((status, ends), (Status::Ok, 0));
        assert_eq!(
            it.step(time, 0.1),
            Status::Error,
            "the standard's state 'step failed'"
        );
        assert_eq!(unsafe { fmi2SetFMUstate(it.c, saved) }, Status::Ok);
        assert_eq!(it.step(5.0, 10_000.0), Status::Ok);
        assert_eq!(it.step(10_005.0, 0.1), Status::Ok);
        assert_eq!(it.ticks(), 100_001);
    }
}
