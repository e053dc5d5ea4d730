//! Inputs that make no sense: handled or refused by name, and the instance goes on.
//!
//! promise: finite-plant

use crate::Pair;
use fmu_host::Coupling::GaussSeidel;
use fmu_host::types::Status;
use fmu_host::{Instance, Loop};

/// A loop in its 60th second, all well.
fn running(pair: &Pair) -> Loop {
    let mut closed = pair.close(0.0);
    for k in 0..60 {
        closed.step_to(f64::from(k + 1), GaussSeidel, true);
    }
    closed
}

/// The step is refused with a message that holds all `words`; then the inputs are mended, the
/// step is repeated, and the result is that of an instance that saw only good inputs.
fn refused(it: &Instance, spoil: impl Fn(&Instance), mend: impl Fn(&Instance), words: &[&str]) {
    let (saved, before) = (it.save(), it.bytes());
    assert_eq!(it.step(60.0, 1.0), Status::Ok);
    let expected = it.bytes();
    assert_eq!(it.restore(saved), Status::Ok);
    spoil(it);
    assert_eq!(it.step(60.0, 1.0), Status::Error);
    let message = it.last_message();
    for word in words {
        assert!(message.contains(word), "{message}");
    }
    mend(it);
    let mended = it.bytes();
    assert_eq!(mended.len(), before.len());
    assert_eq!(it.step(60.0, 1.0), Status::Ok);
    assert_eq!(it.bytes(), expected);
    assert_eq!(it.restore(saved), Status::Ok);
}

#[test]
fn a_measurement_that_is_no_number_is_a_fault() {
    let pair = Pair::load();
    for lost in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut closed = running(&pair);
        let (y, flags) = (closed.controller.span("y"), closed.controller.span("fault"));
        closed.sense();
        closed.controller.set(y, &[lost]);
        assert_eq!(closed.controller.step(60.0, 1.0), Status::Ok);
        assert!(closed.controller.boolean(flags, 0));
        assert!(!closed.controller.boolean(flags, 1));
        for name in ["u", "x_hat", "f_hat", "residual"] {
            assert!(
                closed.controller.get(name).iter().all(|v| v.is_finite()),
                "{name}"
            );
        }
        closed.act();
        assert_eq!(closed.plant.step(60.0, 1.0), Status::Ok);
        closed = closed.at(61.0);
        closed.step_to(62.0, GaussSeidel, true);
        closed.step_to(63.0, GaussSeidel, true);
        assert!(!closed.controller.boolean(flags, 0), "the sensor is back");
    }
}

#[test]
fn a_reference_that_is_no_number_is_refused_by_name() {
    let pair = Pair::load();
    let closed = running(&pair);
    closed.sense();
    let it = &closed.controller;
    let good = it.get("y_ref");
    let span = it.span("y_ref");
    for bad in [f64::NAN, f64::INFINITY] {
        let spoil = |it: &Instance| assert_eq!(it.set(span, &[good[0], bad]), Status::Ok);
        let mend = |it: &Instance| assert_eq!(it.set(span, &good), Status::Ok);
        refused(
            it,
            spoil,
            mend,
            &["fmi2DoStep", "y_ref[2]", &bad.to_string()],
        );
    }
}

#[test]
fn a_command_that_is_no_number_is_refused_by_name() {
    let pair = Pair::load();
    let closed = running(&pair);
    let good = closed.plant.get("u");
    let span = closed.plant.span("u");
    let spoil = |it: &Instance| assert_eq!(it.set(span, &[f64::NAN]), Status::Ok);
    let mend = |it: &Instance| assert_eq!(it.set(span, &good), Status::Ok);
    refused(&closed.plant, spoil, mend, &["u[1]", "NaN"]);
}

#[test]
fn a_mode_that_is_none_is_refused_by_name() {
    let pair = Pair::load();
    let closed = running(&pair);
    closed.sense();
    let it = &closed.controller;
    let (mode, real) = (it.span("mode"), it.span("mode_real"));
    for bad in [0, 3, -1, i32::MAX, i32::MIN] {
        let spoil = |it: &Instance| assert_eq!(it.set_integer(mode, bad), Status::Ok);
        let mend = |it: &Instance| assert_eq!(it.set_integer(mode, 1), Status::Ok);
        let which = if bad == 0 { "not told" } else { "1 to 2" };
        refused(it, spoil, mend, &["mode is", &bad.to_string(), which]);
    }
    for bad in [1.5, 3.0, -1.0, f64::NAN, 1e300] {
        let spoil = |it: &Instance| {
            assert_eq!(it.set(real, &[bad]), Status::Ok);
            assert_eq!(it.set_integer(mode, 0), Status::Ok);
        };
        let mend = |it: &Instance| {
            assert_eq!(it.set(real, &[0.0]), Status::Ok);
            assert_eq!(it.set_integer(mode, 1), Status::Ok);
        };
        refused(
            it,
            spoil,
            mend,
            &["mode_real is", &bad.to_string(), "1 to 2"],
        );
    }
    let spoil = |it: &Instance| assert_eq!(it.set(real, &[2.0]), Status::Ok);
    let mend = |it: &Instance| assert_eq!(it.set(real, &[0.0]), Status::Ok);
    refused(it, spoil, mend, &["mode is 1", "mode_real is 2"]);
}

#[test]
fn the_mode_may_come_as_a_real() {
    let pair = Pair::load();
    let (mut closed, mut other) = (pair.close(0.0), pair.close(0.0));
    let [from, to] = [
        other.plant.span("mode_real"),
        other.controller.span("mode_real"),
    ];
    let integer = other.controller.span("mode");
    for k in 0..900 {
        closed.step_to(f64::from(k + 1), GaussSeidel, true);
        let mut mode = [0.0];
        other.sense();
        assert_eq!(other.plant.get_into(from, &mut mode), Status::Ok);
        assert_eq!(other.controller.set(to, &mode), Status::Ok);
        assert_eq!(
            other.controller.set_integer(integer, 0),
            Status::Ok,
            "not connected"
        );
        assert_eq!(other.controller.step(f64::from(k), 1.0), Status::Ok);
        other.act();
        assert_eq!(other.plant.step(f64::from(k), 1.0), Status::Ok);
        other = other.at(f64::from(k + 1));
        assert_eq!(other.bits(), closed.bits());
    }
}

/// What the plant reads when a tick ends is looked at then.
#[test]
fn the_plant_publishes_nothing_that_is_not_finite() {
    let pair = Pair::load();
    let closed = running(&pair);
    let it = &closed.plant;
    let outputs = || -> Vec<f64> {
        let names = ["y", "y_true", "x", "y_ref", "mode_real", "f", "w"];
        names.iter().flat_map(|name| it.get(name)).collect()
    };
    let (disturbance, fault) = (it.span("w_ext"), it.span("f_ext"));
    for bad in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
        let saved = it.save();
        assert_eq!(it.step(60.0, 0.5), Status::Ok);
        let before = outputs();
        assert_eq!(it.set(disturbance, &[bad]), Status::Ok);
        assert_eq!(it.step(60.5, 0.5), Status::Error);
        let message = it.last_message();
        assert!(message.contains(&format!("w_ext[1] is {bad}")), "{message}");
        assert_eq!(outputs(), before);
        assert_eq!(it.set(disturbance, &[0.0]), Status::Ok);
        assert_eq!(it.step(60.5, 0.5), Status::Ok);
        // A fault that is no number is a sensor that says none: y alone shows it.
        assert_eq!(it.set(fault, &[bad]), Status::Ok);
        assert_eq!(it.step(61.0, 1.0), Status::Ok);
        assert!(!it.get("y")[0].is_finite() && it.get("y")[1].is_finite());
        for name in ["y_true", "x", "y_ref", "mode_real", "f", "w"] {
            assert!(it.get(name).iter().all(|value| value.is_finite()), "{name}");
        }
        assert_eq!(it.set(fault, &[0.0]), Status::Ok);
        assert_eq!(it.restore(saved), Status::Ok);
    }
    // Numbers that are finite, and whose sums and products are not.
    for (span, name) in [
        (disturbance, "w_ext"),
        (fault, "f_ext"),
        (it.span("u"), "u"),
    ] {
        let saved = it.save();
        for (k, huge) in [f64::MAX, f64::MIN, 1e200, f64::MAX]
            .into_iter()
            .enumerate()
        {
            assert_eq!(it.set(span, &[huge]), Status::Ok);
            assert_eq!(it.step(60.0 + k as f64, 1.0), Status::Ok);
            assert!(
                outputs().iter().all(|value| value.is_finite()),
                "{name} {huge}: {:?}",
                outputs()
            );
        }
        assert_eq!(it.set(span, &[0.0]), Status::Ok);
        assert_eq!(it.restore(saved), Status::Ok);
    }
}

/// Readings that are held within a step are not repeated by the sensor.
#[test]
fn held_readings_flag_no_sensor() {
    let mut design = fmu_host::model::example();
    design.controller.estimator.stuck_after = 3;
    let model = fmu_host::Model::controller(&design);
    let library = fmu_host::Library::load("ftc_controller");
    for (step, set_anew, stuck) in [(1.0, true, true), (25.0, true, false), (1.0, false, false)] {
        let it = Instance::new(library.functions, &model).unwrap();
        it.initialize(0.0, |it| {
            assert_eq!(it.set_integer(it.span("mode"), 1), Status::Ok)
        });
        let (y, flags) = (it.span("y"), it.span("fault"));
        for k in 0..8 {
            let reading = if step > 1.0 {
                1e-3 * f64::from(k)
            } else {
                1e-3
            };
            if k == 0 || set_anew {
                assert_eq!(it.set(y, &[reading, -reading]), Status::Ok);
            }
            assert_eq!(it.step(f64::from(k) * step, step), Status::Ok);
        }
        let flagged = [0, 1].map(|sensor| it.boolean(flags, sensor));
        assert_eq!(flagged, [stuck; 2], "step {step}, set anew {set_anew}");
        let twins: Vec<f64> = flagged
            .iter()
            .map(|&raised| f64::from(u8::from(raised)))
            .collect();
        assert_eq!(it.get("fault_real"), twins);
    }
}
