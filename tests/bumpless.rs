//! Bumpless transfer under every switching: the command is continuous where it may be, and the loop that
//! once reached 1e15 stays where it belongs.
//!
//! promise: bumpless
#![allow(missing_docs)]

use ftc_control::parameters::{Compensation, EstimatorMethod};
use ftc_control::{Compensate, Controller};
use ftc_design::assembly::{DatabaseSource, Request, assemble};
use ftc_design::{ControlSpec, Design, Lyapunov, ObserverChoice, ObserverSpec, Signals};
use ftc_plant::scenario::Waveform;
use ftc_plant::{Mode, Scenario, SwitchedPlant};
use nalgebra::{DMatrix, DVector};

fn single(value: f64) -> DMatrix<f64> {
    DMatrix::from_element(1, 1, value)
}

/// Two unstable modes of first order.
fn plant() -> SwitchedPlant {
    let mode = |a: f64| {
        Mode::new(single(a), single(1.0), single(1.0))
            .named(format!("{a}"))
            .with_disturbance(single(1.0), single(0.0))
    };
    SwitchedPlant::new(1.0, vec![mode(1.2), mode(1.25)])
}

fn request(lyapunov: Lyapunov, bumpless: bool) -> Request {
    let mut request = Request::new(
        "bump",
        plant(),
        Signals::numbered(plant().dimensions()),
        Scenario::new(200, vec![Waveform::ZERO], plant().dimensions()),
    );
    request.control = ControlSpec::unweighted(plant().dimensions());
    request.control.lyapunov = lyapunov;
    request.control.decay = 0.9;
    request.control.integral_weight = vec![0.3];
    request.control.input_weight = vec![0.1];
    request.bumpless = bumpless;
    request.feedforward = false;
    request.observer = ObserverSpec::new(ObserverChoice::Luenberger, 0.6, lyapunov);
    request.estimator.method = EstimatorMethod::None;
    request.estimator.database = DatabaseSource::Model;
    request.compensation = Compensation::None;
    request
}

/// The largest output and the largest jumps of the command at switches that may and may not be smooth,
/// when the mode changes every `period` samples.
fn run(design: &Design, period: usize) -> (f64, f64) {
    let controller = Controller::new(design.parameters()).unwrap();
    let modes = &design.plant.modes;
    let mut state = controller.initial_state(0);
    let mut x = DVector::from_element(1, 0.0);
    let (mut largest, mut jump, mut before) = (0.0_f64, 0.0_f64, 0.0);
    for k in 0..3000_usize {
        let mode = (k / period) % 2;
        let w = 0.01 * (0.314 * k as f64).sin();
        let y = [x[0]];
        let sample = controller.sample(k as u64, mode, &y, &[1.0]).unwrap();
        let sample = sample.compensating(Compensate::Nothing).unwrap();
        controller.tick(&mut state, &sample);
        let u = state.command[0];
        if k > 0 && k % period == 0 {
            jump = jump.max((u - before).abs());
        }
        before = u;
        x = &modes[mode].a * &x + &modes[mode].b * u + &modes[mode].e * w;
        largest = largest.max(x[0].abs());
    }
    (largest, jump)
}

#[test]
fn switched_at_every_sample_the_loop_stays_bounded() {
    let design = assemble(request(Lyapunov::Common, true)).unwrap();
    let transfer = design.controller.feedback.transfer.unwrap();
    assert!(transfer.samples > 1, "{transfer:?}");
    for period in [1, 2, 3, 7, transfer.samples, 40] {
        let (largest, _) = run(&design, period);
        assert!(largest < 5.0, "|y| reaches {largest} at period {period}");
    }
}

#[test]
fn switches_far_enough_apart_leave_the_command_where_it_was() {
    let samples = |design: &Design| design.controller.feedback.transfer.unwrap().samples;
    for lyapunov in [Lyapunov::Common, Lyapunov::Dwell] {
        let smooth = assemble(request(lyapunov, true)).unwrap();
        let (_, jump) = run(&smooth, samples(&smooth));
        assert!(jump < 1e-12, "{lyapunov}: the command jumps by {jump}");
    }
    let plain = assemble(request(Lyapunov::Common, false)).unwrap();
    assert!(run(&plain, 40).1 > 1e-3);
}

/// More resets than were proved, and no proof at all, are refused.
#[test]
fn resets_more_often_than_proved_are_refused() {
    let design = assemble(request(Lyapunov::Common, true)).unwrap();
    ftc_design::coverage::prove(&design).unwrap();

    let mut too_soon = design.clone();
    too_soon
        .controller
        .feedback
        .transfer
        .as_mut()
        .unwrap()
        .samples = 1;
    let sentence = ftc_design::coverage::prove(&too_soon)
        .unwrap_err()
        .to_string();
    assert!(sentence.contains("bumpless"), "{sentence}");
    let proof = &mut too_soon.proof.as_mut().unwrap().running_loop;
    proof.transfer.as_mut().unwrap().mu = 1.0;
    assert!(ftc_design::coverage::prove(&too_soon).is_err());

    // Nor does a gain across switches hold that was proved without the resets.
    let mut claimed = design.clone();
    let claim = serde_json::json!({ "gamma": 1e9, "lyapunov": [] });
    claimed.proof.as_mut().unwrap().running_loop.switching =
        Some(serde_json::from_value(claim).unwrap());
    let sentence = ftc_design::coverage::prove(&claimed)
        .unwrap_err()
        .to_string();
    assert!(sentence.contains("bumpless"), "{sentence}");

    let mut unproved = design;
    unproved.proof.as_mut().unwrap().running_loop.transfer = None;
    assert!(ftc_design::coverage::prove(&unproved).is_err());
}
