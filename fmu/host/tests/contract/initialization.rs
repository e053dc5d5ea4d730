//! Masters initialize one FMU after the other: an input may not be ready when its turn comes.
//!
//! promise: missing-mode

use fmu_host::model::example;
use fmu_host::types::Status;
use fmu_host::{Instance, Library, Model};
use ftc_record::DesignRecord;

/// The example, its second mode at rest elsewhere.
fn two_resting_places() -> DesignRecord {
    let mut design = example();
    let point = &mut design.plant.modes[1].operating_point;
    (point.x, point.u, point.y) = (vec![0.5, 0.1], vec![0.25, -0.5], vec![0.75, 0.3]);
    design
}

/// Some instances of one FMU.
struct Side {
    /// Name of the mode's Integer.
    mode: &'static str,
    /// An output that shows the mode.
    shown: &'static str,
    made: Vec<Instance>,
    _library: Library,
}

/// The controller, and the plant with its scenario off.
fn sides(count: usize) -> [Side; 2] {
    let design = two_resting_places();
    [
        ("mode", "u", "ftc_controller", Model::controller(&design)),
        ("mode_ext", "y", "ftc_plant", Model::plant(&design)),
    ]
    .map(|(mode, shown, library, model)| {
        let library = Library::load(library);
        let make = |_| {
            let it = Instance::new(library.functions, &model).unwrap();
            if mode == "mode_ext" {
                let scenario = it.span("scenario_enabled");
                assert_eq!(it.set_boolean(scenario, false), Status::Ok);
            }
            it
        };
        Side {
            mode,
            shown,
            made: (0..count).map(make).collect(),
            _library: library,
        }
    })
}

fn initialize(it: &Instance, mode: &str, number: i32) {
    it.initialize(0.0, |it| {
        assert_eq!(it.set_integer(it.span(mode), number), Status::Ok);
    });
}

fn warnings(it: &Instance) -> Vec<String> {
    let messages = it.messages.lock().unwrap();
    let warned = messages
        .iter()
        .filter(|(status, ..)| *status == Status::Warning);
    warned.map(|(_, _, text)| text.clone()).collect()
}

#[test]
fn an_unknown_mode_starts_in_the_nearest_with_a_warning() {
    for side in sides(5) {
        let (mode, shown) = (side.mode, side.shown);
        let [low, first, high, second, negative] = &side.made[..] else {
            unreachable!()
        };
        for (it, number) in [(low, 0), (negative, -7), (first, 1), (high, 9), (second, 2)] {
            initialize(it, mode, number);
            let known = [1, 2].contains(&number);
            assert_eq!(warnings(it).len(), usize::from(!known), "{mode} = {number}");
            for text in warnings(it) {
                let why = if number == 0 { "not told" } else { "1 to 2" };
                for word in [
                    "fmi2ExitInitializationMode",
                    &format!("{mode} is {number}"),
                    why,
                ] {
                    assert!(text.contains(word), "{text}");
                }
            }
        }
        assert_eq!(low.get(shown), first.get(shown));
        assert_eq!(negative.get(shown), first.get(shown));
        assert_eq!(high.get(shown), second.get(shown));
        assert_ne!(first.get(shown), second.get(shown));
    }
}

#[test]
fn a_mode_that_comes_late_is_as_good_as_one_that_came_in_time() {
    for side in sides(3) {
        let (mode, shown) = (side.mode, side.shown);
        let [late, copy, in_time] = &side.made[..] else {
            unreachable!()
        };
        initialize(late, mode, 0);
        initialize(in_time, mode, 2);
        // That the start is provisional is part of a saved state.
        assert_eq!(copy.restore(copy.read_bytes(&late.bytes())), Status::Ok);
        for it in [late, copy] {
            assert_eq!(it.set_integer(it.span(mode), 2), Status::Ok);
        }
        let slopes = [late, copy, in_time].map(|it| {
            let known = it.span(if mode == "mode" { "y" } else { "u" });
            let mut out = [f64::NAN; 2];
            let status = it.derivative(it.span(shown), known, &[1.0, -2.0], &mut out);
            assert_eq!(status, Status::Ok, "{}", it.last_message());
            out
        });
        assert_eq!(slopes[0], slopes[2]);
        assert_eq!(slopes[1], slopes[2]);
        for (from, length) in [(0.0, 0.5), (0.5, 0.5), (1.0, 3.0)] {
            for it in [late, copy, in_time] {
                assert_eq!(it.step(from, length), Status::Ok, "{}", it.last_message());
            }
            assert_eq!(late.get(shown), in_time.get(shown));
        }
        assert!(late.bytes() == in_time.bytes());
        assert!(copy.bytes() == in_time.bytes());
    }
}

#[test]
fn what_is_no_number_is_still_refused_in_initialization_mode() {
    for side in sides(1) {
        let (mode, it) = (side.mode, &side.made[0]);
        it.enter(0.0);
        let name = if mode == "mode" { "y_ref" } else { "u" };
        assert_eq!(it.set(it.span(name), &[f64::NAN]), Status::Ok);
        // SAFETY: the instance lives.
        let status = unsafe { (it.functions().exit_initialization_mode)(it.c) };
        assert_eq!(status, Status::Error);
        assert!(it.last_message().contains(&format!("{name}[1] is NaN")));
    }
}

#[test]
fn a_mode_that_is_not_told_is_waited_for() {
    for side in sides(2) {
        let (mode, shown) = (side.mode, side.shown);
        let [waiting, at_rest] = &side.made[..] else {
            unreachable!()
        };
        initialize(waiting, mode, 0);
        initialize(at_rest, mode, 1);
        let rest = at_rest.get(shown);
        let moving = if mode == "mode" { "y" } else { "u" };
        for k in 0..5 {
            let status = waiting.set(waiting.span(moving), &[1.0 + f64::from(k), 2.0]);
            assert_eq!(status, Status::Ok);
            assert_eq!(waiting.step(f64::from(k), 1.0), Status::Ok);
            assert_eq!(waiting.get(shown), rest, "tick {k}");
        }
        let real = waiting.span(&format!("{mode}_real"));
        assert_eq!(waiting.set(real, &[2.0]), Status::Ok);
        for k in 5..8 {
            assert_eq!(waiting.step(f64::from(k), 1.0), Status::Ok);
        }
        assert_ne!(waiting.get(shown), rest);
        assert_eq!(warnings(waiting).len(), 1, "{:?}", warnings(waiting));
    }
}
