//! Directional derivatives of a tick, against central differences of the tick itself.
//!
//! Between its decisions a tick of the linear parts is affine, so the differences are exact but
//! for rounding; the rectifier's are as good as its integrator.
//!
//! promise: exact-derivatives

mod common;

use common::{Channel, controller, plant, reference, scenario, state_based};
use ftc_control::parameters::{Compensation, EstimatorMethod, Limits, Transfer};
use ftc_control::{Compensate, Controller, ControllerParameters, ControllerState, Matrix};
use ftc_plant::rectifier::Rectifier;
use ftc_plant::scenario::{FaultEvent, FaultKind, ModeInterval, Waveform};
use ftc_plant::{Scenario, TruePlant};
use ftc_simulate::plant::{Change, External};
use ftc_simulate::{PlantSimulator, PlantState};
use proptest::prelude::*;

/// Half the distance of the differences.
const STEP: f64 = 1e-4;

#[derive(Clone, Copy, Debug)]
struct Design {
    compensation: Compensation,
    method: EstimatorMethod,
    latency: usize,
    bumpless: bool,
    limited: bool,
    adapt: bool,
}

fn design() -> impl Strategy<Value = Design> {
    let compensation = prop::sample::select(vec![
        Compensation::VirtualSensor,
        Compensation::Additive,
        Compensation::None,
    ]);
    let method = prop::sample::select(vec![
        EstimatorMethod::Observer,
        EstimatorMethod::Reference,
        EstimatorMethod::Sliding,
        EstimatorMethod::None,
    ]);
    let flags = (any::<bool>(), any::<bool>(), any::<bool>());
    (compensation, method, 0..2usize, flags).prop_map(|(compensation, method, latency, flags)| {
        Design {
            compensation,
            method,
            latency,
            bumpless: flags.0,
            limited: flags.1,
            adapt: flags.2,
        }
    })
}

fn parameters(design: Design) -> ControllerParameters {
    let mut parameters = controller(Channel::State, 0.005);
    parameters.compensation = design.compensation;
    if design.method == EstimatorMethod::Observer {
        parameters = state_based(Channel::State, 0.005);
    }
    parameters.estimator.method = design.method;
    parameters.estimator.adapt = design.adapt;
    parameters.feedback.latency = design.latency;
    parameters.feedback.transfer = design.bumpless.then_some(Transfer {
        samples: 1,
        decay: 0.5,
    });
    if design.latency == 1 {
        for gains in &mut parameters.feedback.modes {
            gains.previous_input = Matrix::from_rows(&[[-0.2; 2]; 2]);
        }
    }
    if design.limited {
        parameters.input_limits = vec![
            Limits {
                min: Some(-0.1),
                max: Some(0.1),
            };
            2
        ];
    }
    parameters
}

/// Command, state estimate, residual and fault estimate, one after another.
fn outputs(state: &ControllerState) -> Vec<f64> {
    let parts = [
        &state.command,
        &state.observer.estimate,
        &state.estimator.residual,
        &state.estimator.fault,
    ];
    parts.into_iter().flatten().copied().collect()
}

/// Whether the middle of three points of the outputs is their mean: a tick is affine between its
/// decisions, so that one of them moved where it is not (a flag, a limit, another hypothesis that leads).
fn on_a_line(below: &[f64], middle: &[f64], above: &[f64], rounding: f64) -> bool {
    let mean = below
        .iter()
        .zip(above)
        .map(|(below, above)| 0.5 * (below + above));
    mean.zip(middle)
        .all(|(mean, middle)| (mean - middle).abs() < rounding)
}

proptest! {
    // A decision moves between the points of a difference in few cases.
    #![proptest_config(ProptestConfig { max_global_rejects: 15, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn the_controller_follows_its_measurement_and_reference(
        design in design(),
        ticks in 1..120u64,
        switch in 0..120u64,
        fault in prop::sample::select(vec![0.0, 0.4, f64::NAN]),
        direction in prop::array::uniform2(-1.0..1.0f64),
        steering in prop::array::uniform2(-1.0..1.0f64),
        reference in prop::array::uniform2(-1.0..1.0f64),
        as_read in prop::array::uniform2(any::<bool>()),
    ) {
        let controller = Controller::new(parameters(design)).unwrap();
        let mut state = controller.initial_state(0);
        let mut x = [0.0; 2];
        let mut last = None;
        for tick in 0..=ticks {
            let u = &state.command;
            x = if tick < switch {
                [0.6 * x[0] + 0.45 * x[1] + u[1], -0.2 * x[0] + 0.3 * x[1] + u[0]]
            } else {
                [0.4 * x[0] - 0.3 * x[1] + u[0], 0.11 * x[0] + u[1]]
            };
            let fault = if tick + 20 > ticks { fault } else { 0.0 };
            let y = [x[0] + fault, x[1] + 0.01 * (tick as f64).sin()];
            let mode = usize::from(tick >= switch);
            // Compensation may be switched off or on just before the last tick.
            let uses_readings = as_read[usize::from(tick == ticks)];
            let compensate = if uses_readings { Compensate::Nothing } else { Compensate::Estimate };
            let sample = |y: &[f64; 2], reference: &[f64; 2], state: &mut ControllerState, derive: Option<ftc_control::Change<'_>>| {
                let sample = controller.sample(tick, mode, y, reference).unwrap().compensating(compensate).unwrap();
                match derive {
                    Some(change) => controller.differentiate(state, &sample, change),
                    None => controller.tick(state, &sample),
                }
            };
            if tick == ticks {
                let [below, middle, above] = [-STEP, 0.0, STEP].map(|step| {
                    let along = |at: [f64; 2], way: [f64; 2]| [at[0] + step * way[0], at[1] + step * way[1]];
                    let mut trial = state.clone();
                    sample(&along(y, direction), &along(reference, steering), &mut trial, None);
                    outputs(&trial)
                });
                let largest = below.iter().fold(1.0, |most: f64, v| most.max(v.abs()));
                let rounding = 100.0 * f64::EPSILON * largest;
                let unmoved = on_a_line(&below, &middle, &above, rounding);
                let expected: Vec<f64> = below.iter().zip(&above)
                    .map(|(below, above)| (above - below) / (2.0 * STEP)).collect();
                let mut trial = state.clone();
                let change = ftc_control::Change { measurement: &direction, reference: &steering };
                sample(&y, &reference, &mut trial, Some(change));
                last = Some((unmoved, expected, outputs(&trial), rounding / STEP));
            }
            sample(&y, &reference, &mut state, None);
        }
        let (unmoved, expected, found, rounding) = last.unwrap();
        prop_assume!(unmoved);
        for (found, expected) in found.iter().zip(&expected) {
            prop_assert!((found - expected).abs() < rounding, "{found} against {expected}");
        }
    }
}

/// Faults of every kind, overlapping, around tick 5.
fn eventful() -> Scenario {
    let event = |sensor, from, until, kind| FaultEvent {
        sensor,
        from,
        until,
        kind,
    };
    let mut scenario = scenario(reference("square"), 0.005, 1);
    scenario.schedule = vec![
        ModeInterval { from: 0.0, mode: 0 },
        ModeInterval { from: 6.0, mode: 1 },
    ];
    scenario.events = vec![
        event(0, 3.0, 5.0, FaultKind::GainLoss { loss: 0.3 }),
        event(0, 4.0, 6.0, FaultKind::Bias { size: 0.2 }),
        event(1, 4.0, 7.0, FaultKind::Stuck),
        event(0, 8.0, 10.0, FaultKind::Dropout),
        event(1, 8.0, 10.0, FaultKind::Drift { slope: 0.1 }),
        event(1, 9.0, 10.0, FaultKind::GainLoss { loss: 0.5 }),
    ];
    scenario
}

fn rectifier() -> (PlantSimulator, [f64; 2]) {
    let rectifier = Rectifier {
        inductance: 0.01,
        resistance: 0.3,
        capacitance: 2e-3,
        phase_voltage: 311.0,
        current_loop: 2e-3,
        dc_voltage: 600.0,
        loads: vec![80.0, 40.0],
    };
    let plant = rectifier.linearise(5e-3).unwrap();
    let mut scenario = scenario(reference("constant"), 0.0, 1);
    scenario.schedule = vec![ModeInterval { from: 0.0, mode: 0 }];
    scenario.disturbance = vec![Waveform::Constant { value: 1.0 }];
    let simulator =
        PlantSimulator::with_true_plant(plant, TruePlant::Rectifier(rectifier), scenario);
    (simulator, [12.0, -3.0])
}

/// State, outputs, fault and disturbance, one after another; a silent sensor reads zero.
fn seen(state: &PlantState) -> Vec<f64> {
    let parts = [
        &state.x,
        &state.y_true,
        &state.y,
        &state.fault,
        &state.disturbance,
    ];
    let values = parts.into_iter().flatten();
    values.map(|v| if v.is_nan() { 0.0 } else { *v }).collect()
}

/// Changes of command, fault and disturbance.
const DIRECTIONS: [[f64; 5]; 4] = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.5, 0.0, 0.0],
    [0.3, -0.2, 0.0, 1.0, 0.4],
    [0.0, 0.0, 0.0, 0.0, 1.0],
];

/// Compares at every tick, and within each, under `u`; `mode` is the external mode.
fn compare(simulator: &PlantSimulator, u: [f64; 2], mode: Option<usize>, step: f64, accuracy: f64) {
    let mut state = simulator.initial_state();
    for _ in 0..12 {
        for direction in DIRECTIONS {
            let at = |size: f64, state: &PlantState, whole: bool, derive: bool| {
                let scaled = direction.map(|d| size * d);
                let base = if derive { [0.0; 5] } else { scaled };
                let fault = [0.1 + base[2], base[3]];
                let disturbance = [0.05 + base[4]];
                let external = External::new(&fault, &disturbance).in_mode(mode);
                let u = [u[0] + base[0], u[1] + base[1]];
                let change = Change {
                    command: &direction[..2],
                    fault: &direction[2..4],
                    disturbance: &direction[4..],
                };
                let mut trial = state.clone();
                match (derive, whole) {
                    (true, true) => {
                        simulator.differentiate_tick(&mut trial, &external, &u, &change)
                    }
                    (true, false) => {
                        simulator.differentiate_outputs(&mut trial, &external, &change)
                    }
                    (false, whole) => {
                        if whole {
                            simulator.observe(&mut trial, &external);
                            simulator.advance(&mut trial, &u).unwrap();
                        }
                        simulator.observe(&mut trial, &external);
                    }
                }
                seen(&trial)
            };
            for whole in [true, false] {
                let (below, above) = (
                    at(-step, &state, whole, false),
                    at(step, &state, whole, false),
                );
                let found = at(0.0, &state, whole, true);
                for ((below, above), found) in below.iter().zip(&above).zip(&found) {
                    let expected = (above - below) / (2.0 * step);
                    assert!(
                        (found - expected).abs() < accuracy * (1.0 + expected.abs()),
                        "tick {}, {direction:?}: {found} against {expected}",
                        state.tick
                    );
                }
            }
        }
        let external = External::new(&[0.1, 0.0], &[0.05]).in_mode(mode);
        simulator.observe(&mut state, &external);
        simulator.advance(&mut state, &u).unwrap();
    }
}

#[test]
fn the_plant_follows_its_inputs() {
    for channel in [Channel::State, Channel::Output] {
        let simulator = PlantSimulator::new(plant(channel), eventful());
        compare(&simulator, [0.3, -0.2], None, STEP, 1e-9);
        compare(&simulator, [0.3, -0.2], Some(1), STEP, 1e-9);
    }
}

#[test]
fn the_rectifier_follows_its_inputs() {
    let (simulator, u) = rectifier();
    compare(&simulator, u, None, 1e-2, 1e-5);
}

/// The link is emptied until its diodes conduct.
#[test]
fn the_rectifier_follows_its_inputs_on_its_diodes() {
    let (simulator, _) = rectifier();
    compare(&simulator, [-30.0, 5.0], None, 1e-2, 1e-5);
}
