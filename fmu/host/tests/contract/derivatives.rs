//! Directional derivatives through the C interface, against central differences of whole steps.
//!
//! promise: exact-derivatives

use crate::Pair;
use fmu_host::Coupling::GaussSeidel;
use fmu_host::Instance;
use fmu_host::types::Status;

const STEP: f64 = 1e-4;

/// What `outputs` are after the step from `time`, less what they are now, per unit of `changes`.
fn difference(
    it: &Instance,
    input: &str,
    changes: &[f64],
    outputs: &[&str],
    time: f64,
) -> Vec<f64> {
    let (span, saved, base) = (it.span(input), it.save(), it.get(input));
    let points = [-STEP, STEP].map(|step| {
        let moved: Vec<f64> = base
            .iter()
            .zip(changes)
            .map(|(v, d)| v + step * d)
            .collect();
        assert_eq!(it.set(span, &moved), Status::Ok);
        assert_eq!(it.step(time, time.floor() + 1.0 - time), Status::Ok);
        let values: Vec<f64> = outputs.iter().flat_map(|name| it.get(name)).collect();
        assert_eq!(it.restore(saved), Status::Ok);
        values
    });
    let pairs = points[0].iter().zip(&points[1]);
    pairs
        .map(|(below, above)| (above - below) / (2.0 * STEP))
        .collect()
}

fn agree(it: &Instance, input: &str, changes: &[f64], outputs: &[&str], time: f64) {
    let before = it.bytes();
    let expected = difference(it, input, changes, outputs, time);
    let mut found = Vec::new();
    for name in outputs {
        let mut out = vec![f64::NAN; it.span(name).len as usize];
        let status = it.derivative(it.span(name), it.span(input), changes, &mut out);
        assert_eq!(status, Status::Ok, "{}", it.last_message());
        found.extend(out);
    }
    assert_eq!(it.bytes(), before, "asking changes nothing");
    for (found, expected) in found.iter().zip(&expected) {
        assert!(
            (found - expected).abs() < 1e-8,
            "{input} at {time}: {found} against {expected}"
        );
    }
}

#[test]
fn derivatives_are_those_of_the_next_tick() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    for k in 0..420 {
        let time = f64::from(k);
        // Well, faulty, and just released.
        if [0, 50, 99, 150, 399, 410].contains(&k) {
            closed.sense();
            let seen = ["u", "x_hat", "f_hat", "residual"];
            agree(&closed.controller, "y", &[1.0, -0.5], &seen, time);
            agree(&closed.controller, "y_ref", &[1.0, -0.5], &seen, time);
            let seen = ["y", "y_true", "x", "f", "w", "y_ref"];
            agree(&closed.plant, "u", &[0.3, 1.0], &seen, time);
            agree(&closed.plant, "f_ext", &[0.3, 1.0], &seen, time);
            agree(&closed.plant, "w_ext", &[1.0], &seen, time);
        }
        if k == 60 {
            let half = time + 0.5;
            closed.step_to(half, GaussSeidel, true);
            for (input, changes) in [
                ("u", &[0.3, 1.0][..]),
                ("f_ext", &[0.3, 1.0]),
                ("w_ext", &[1.0]),
            ] {
                agree(
                    &closed.plant,
                    input,
                    changes,
                    &["y", "y_true", "x", "f", "w"],
                    half,
                );
            }
        }
        closed.step_to(time + 1.0, GaussSeidel, k != 60);
    }
}

#[test]
fn derivatives_in_initialization_mode_are_those_of_the_first_outputs() {
    let pair = Pair::load();
    let plant = pair.fresh(1);
    plant.enter(0.0);
    let mut out = [f64::NAN; 2];
    let mut ask = |unknown: &str, known: &str, changes: &[f64]| {
        let status = plant.derivative(plant.span(unknown), plant.span(known), changes, &mut out);
        assert_eq!(status, Status::Ok, "{}", plant.last_message());
        out
    };
    assert_eq!(ask("y", "f_ext", &[1.0, -2.0]), [1.0, -2.0]);
    assert_eq!(ask("y_true", "f_ext", &[1.0, -2.0]), [0.0, 0.0]);
    assert_eq!(ask("x", "u", &[1.0, 1.0]), [0.0, 0.0]);
    let controller = pair.fresh(0);
    controller.enter(0.0);
    let (u, y) = (controller.span("u"), controller.span("y"));
    assert_eq!(
        controller.derivative(u, y, &[1.0, 1.0], &mut out),
        Status::Ok
    );
    assert_eq!(out, [0.0, 0.0]);
}
