//! The internal model: resonators at the disturbance's harmonics make the tracking error vanish there.

mod common;

use common::{Channel, plant, reference, scenario};
use core::f64::consts::TAU;
use ftc_control::Controller;
use ftc_control::parameters::EstimatorMethod;
use ftc_design::assembly::{KnownDisturbance, Request, assemble};
use ftc_design::{
    ControlSpec, Design, DesignError, Lyapunov, ObserverChoice, ObserverSpec, Signals,
    check_controllable, state_feedback,
};
use ftc_plant::scaling::Scaling;
use ftc_plant::scenario::{ModeInterval, Waveform};
use ftc_plant::{Mode, SwitchedPlant};
use ftc_simulate::{PlantSimulator, Variant, run};
use nalgebra::{DMatrix, dmatrix};

/// The paper's disturbance turns by this angle each sample.
const ANGLE: f64 = 0.02;

/// The weights of the reference table, with the first `harmonics` in the internal model.
fn spec(latency: usize, lyapunov: Lyapunov, decay: f64, harmonics: usize) -> ControlSpec {
    let mut spec = ControlSpec::unweighted(plant(Channel::State).dimensions());
    spec.latency = latency;
    spec.lyapunov = lyapunov;
    spec.decay = decay;
    spec.resonators = disturbance(harmonics).angles(1.0);
    spec.integral_weight = vec![0.3; 2];
    spec.input_weight = vec![0.1; 2];
    spec
}

fn disturbance(harmonics: usize) -> KnownDisturbance {
    let mut disturbance = KnownDisturbance::new(TAU / ANGLE);
    disturbance.harmonics = harmonics;
    disturbance.amplitude = Some(vec![0.04]);
    disturbance
}

fn design(channel: Channel, control: ControlSpec) -> Design {
    let mut experiment = scenario(reference("sine"), 0.0, 1);
    experiment.reference.truncate(control.tracked.len());
    let mut request = Request::new(
        "resonant",
        plant(channel),
        Signals::numbered(plant(channel).dimensions()),
        experiment,
    );
    request.observer = ObserverSpec::new(ObserverChoice::Auto, 0.7, control.lyapunov);
    request.estimator.method = EstimatorMethod::Reference;
    request.estimator.disturbance = Some(disturbance(1));
    request.control = control;
    assemble(request).unwrap()
}

#[test]
fn a_sine_is_followed_to_99_7_percent_and_with_the_internal_model_to_99_95() {
    for channel in [Channel::State, Channel::Output] {
        for (harmonics, least) in [(0, 99.7), (1, 99.95)] {
            let design = design(channel, spec(0, Lyapunov::Common, 0.7, harmonics));
            let simulator = PlantSimulator::new(plant(channel), design.scenario.clone());
            let merits = run(
                &simulator,
                &Controller::new(design.parameters()).unwrap(),
                Variant::Ftc,
            )
            .merits(&[0, 1]);
            for merit in merits {
                let vaf = merit.true_output.vaf;
                println!("{channel:?}, {harmonics} harmonics: {vaf:.4} %");
                assert!(vaf >= least, "{channel:?}, {harmonics} harmonics: {vaf}");
            }
        }
    }
}

/// The amplitude of the first tracked output's error at an angle, long after the start, while a
/// disturbance of that angle shakes the state in the second mode.
fn residual(control: &ControlSpec, angle: f64) -> f64 {
    const STEPS: u64 = 6000;
    let design = design(Channel::State, control.clone());
    let mut experiment = scenario(Waveform::Constant { value: 0.6 }, 0.0, 1);
    experiment.steps = STEPS as _;
    experiment.schedule = vec![ModeInterval { from: 0.0, mode: 1 }];
    experiment.reference.truncate(control.tracked.len());
    experiment.fault = vec![Waveform::Constant { value: 0.0 }; 2];
    experiment.disturbance = vec![Waveform::Sine {
        amplitude: 0.04,
        period: TAU / angle,
        phase: 0.3,
        offset: 0.0,
    }];
    let simulator = PlantSimulator::new(plant(Channel::State), experiment);
    let trajectory = run(
        &simulator,
        &Controller::new(design.parameters()).unwrap(),
        Variant::NoFtc,
    );
    let window = (10.0 * TAU / angle).round() as usize;
    let last = &trajectory.records[trajectory.records.len() - window..];
    let (mut sine, mut cosine) = (0.0, 0.0);
    for record in last {
        let error = record.reference[0] - record.y[control.tracked[0]];
        let (s, c) = (angle * record.tick as f64).sin_cos();
        sine += error * s;
        cosine += error * c;
    }
    2.0 * f64::hypot(sine, cosine) / window as f64
}

#[test]
fn a_disturbance_at_a_harmonic_vanishes() {
    let mut one_of_two = spec(0, Lyapunov::Common, 0.95, 1);
    one_of_two.tracked = vec![1];
    one_of_two.output_weight = vec![1.0];
    one_of_two.integral_weight = vec![0.3];
    for control in [
        spec(0, Lyapunov::Common, 0.95, 1),
        spec(0, Lyapunov::Switched, 0.95, 1),
        spec(1, Lyapunov::Dwell, 0.95, 1),
        spec(0, Lyapunov::Dwell, 0.95, 2),
        one_of_two,
    ] {
        let mut without = control.clone();
        without.resonators = vec![];
        for &angle in &control.resonators {
            let (plain, resonant) = (residual(&without, angle), residual(&control, angle));
            println!("{plain:.2e} -> {resonant:.2e}");
            assert!(
                resonant < plain / 100.0,
                "{control:?} at {angle}: {plain} -> {resonant}"
            );
        }
    }
}

#[test]
fn the_certificate_belongs_to_the_angle() {
    let plant = plant(Channel::State);
    let control = spec(0, Lyapunov::Common, 0.95, 1);
    let mut design =
        state_feedback::synthesise(&plant, &control, &Scaling::automatic(&plant)).unwrap();
    let text = serde_json::to_string(&design).unwrap();
    assert_eq!(design, serde_json::from_str(&text).unwrap());
    design.verify(&plant).unwrap();
    let original = design.clone();
    design.spec.resonators[0] = 2.0 * ANGLE;
    design.verify(&plant).unwrap_err();
    design = original;
    design.spec.resonators.clear();
    design.verify(&plant).unwrap_err();
}

/// What a request comes to.
fn verdict(control: &ControlSpec) -> Result<(), DesignError> {
    let plant = plant(Channel::State);
    state_feedback::synthesise(&plant, control, &Scaling::automatic(&plant)).map(|_| ())
}

#[test]
fn harmonics_too_near_the_integrator_or_each_other_are_refused_with_limits_that_work() {
    let with = |resonators: Vec<f64>| {
        let mut spec = spec(0, Lyapunov::Common, 0.95, 0);
        spec.resonators = resonators;
        spec
    };
    let pi = core::f64::consts::PI;
    for angle in [0.0, 1e-5, pi - 1e-5, pi, 4.0, -0.02, f64::NAN] {
        let error = verdict(&with(vec![angle])).unwrap_err().to_string();
        assert!(error.contains("sample time"), "{angle}: {error}");
    }
    let twice = verdict(&with(vec![0.02, 0.02])).unwrap_err().to_string();
    assert!(twice.contains("name each frequency once"), "{twice}");
    for angle in [1.001e-3, pi - 1.001e-3] {
        verdict(&with(vec![angle])).unwrap();
    }
}

#[test]
fn advice_about_a_decay_too_fast_for_two_harmonics_is_good_advice() {
    let control = spec(0, Lyapunov::Dwell, 0.7, 2);
    let Err(DesignError::Infeasible(infeasibility)) = verdict(&control) else {
        panic!("gains beyond double precision were found");
    };
    let harmonics = ftc_design::Advice::Harmonics(1);
    assert!(infeasibility.advice.contains(&harmonics));
    for advice in &infeasibility.advice {
        verdict(&advice.apply(&control)).unwrap();
    }
}

/// A plant whose output cannot move at `ANGLE`: its transmission zeros lie there.
#[test]
fn a_harmonic_the_inputs_cannot_reach_is_named() {
    let scalar = |value| DMatrix::from_element(1, 1, value);
    let blind = SwitchedPlant::new(
        1.0,
        vec![
            Mode::new(
                dmatrix![0.0, 1.0, 0.0; 0.0, 0.0, 1.0; 0.1, -0.2, 0.3],
                dmatrix![0.0; 0.0; 1.0],
                dmatrix![1.0, -2.0 * ANGLE.cos(), 1.0],
            )
            .with_disturbance(dmatrix![1.0; 0.0; 0.0], scalar(0.0)),
        ],
    );
    let mut control = ControlSpec::unweighted(blind.dimensions());
    control.resonators = vec![1.0, ANGLE];
    let error = check_controllable(&blind, &control, &Scaling::unit(3, 1, 1)).unwrap_err();
    assert!(error.to_string().contains("harmonic 2"), "{error}");
    let mut sighted = control;
    sighted.resonators = vec![1.0];
    check_controllable(&blind, &sighted, &Scaling::unit(3, 1, 1)).unwrap();
}
