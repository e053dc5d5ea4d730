//! The on-line path: no allocation, finite in and finite out, the same bits every time.
//!
//! promise: no-allocation

mod common;

use common::{Channel, controller, reference, scenario};
use fmu_abi::memory::{Memory, allocations};
use ftc_control::parameters::Transfer;
use ftc_control::{Controller, ControllerState};
use ftc_simulate::{PlantSimulator, Variant, run};
use proptest::prelude::*;

/// The allocator of an FMU's binary, which counts.
#[global_allocator]
static MEMORY: Memory = Memory;

fn tick(
    controller: &Controller,
    state: &mut ControllerState,
    tick: u64,
    mode: usize,
    y: &[f64],
    reference: &[f64],
) {
    let sample = controller.sample(tick, mode, y, reference).unwrap();
    controller.tick(state, &sample);
}

fn outputs(state: &ControllerState) -> Vec<f64> {
    [
        &state.command,
        &state.observer.estimate,
        &state.estimator.fault,
        &state.estimator.residual,
        &state.integral,
        &state.corrected,
    ]
    .into_iter()
    .flatten()
    .copied()
    .collect()
}

#[test]
fn a_tick_allocates_nothing() {
    let controller = Controller::new(controller(Channel::State, 0.005)).unwrap();
    let mut state = controller.initial_state(0);
    let counted = allocations(|| {
        for k in 0..2000_u64 {
            let lost = if k % 97 == 0 { f64::NAN } else { 0.01 };
            tick(
                &controller,
                &mut state,
                k,
                (k / 300) as usize % 2,
                &[lost, 0.02],
                &[0.3, -0.1],
            );
        }
    });
    assert_eq!(counted, 0);
    let counted = allocations(|| drop(std::hint::black_box(Box::new(1))));
    assert_eq!(
        counted, 2,
        "one is made, one is freed: the counter must count"
    );
}

#[test]
fn the_same_inputs_give_the_same_bits_and_a_copy_is_a_snapshot() {
    let parameters = controller(Channel::State, 0.005);
    let plant = PlantSimulator::new(
        common::plant(Channel::State),
        scenario(reference("levels"), 0.005, 1),
    );
    let controller = Controller::new(parameters).unwrap();
    assert_eq!(
        run(&plant, &controller, Variant::Ftc),
        run(&plant, &controller, Variant::Ftc)
    );

    let mut state = controller.initial_state(0);
    for k in 0..50 {
        tick(
            &controller,
            &mut state,
            k,
            0,
            &[0.1 * k as f64, 0.0],
            &[1.0, 1.0],
        );
    }
    let bytes = serde_json::to_string(&state).unwrap();
    let mut copy: ControllerState = serde_json::from_str(&bytes).unwrap();
    for k in 50..100 {
        tick(&controller, &mut state, k, 1, &[1.0, 2.0], &[1.0, 1.0]);
        tick(&controller, &mut copy, k, 1, &[1.0, 2.0], &[1.0, 1.0]);
    }
    assert_eq!(state, copy);
}

/// With bumpless transfer, the first command in a mode is the last of the mode before, unless the last
/// transfer was too short a time ago.
#[test]
fn a_bumpless_switch_leaves_the_command_where_it_was() {
    for transfer in [
        None,
        Some(Transfer {
            samples: 5,
            decay: 0.5,
        }),
    ] {
        let mut parameters = controller(Channel::State, 0.0);
        parameters.feedback.transfer = transfer;
        let controller = Controller::new(parameters).unwrap();
        let mut state = controller.initial_state(0);
        let mut jump = |k: u64, mode: usize| {
            let before = state.command.clone();
            let (y, reference) = ([0.2, -0.1], [0.25, -0.15]);
            tick(&controller, &mut state, k, mode, &y, &reference);
            let moved = state.command.iter().zip(&before);
            moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        for k in 0..50 {
            jump(k, 0);
        }
        assert_eq!(transfer.is_some(), jump(50, 1) < 1e-14);
        assert!(
            jump(51, 0) > 1e-3,
            "two samples are too few for another transfer"
        );
        for k in 52..60 {
            jump(k, 0);
        }
        assert_eq!(transfer.is_some(), jump(60, 1) < 1e-14);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Any bit pattern as measurement, any finite reference, any mode: every output stays finite.
    #[test]
    fn finite_whatever_the_sensors_say(
        samples in prop::collection::vec((any::<u64>(), any::<u64>(), -1e300..1e300f64, 0usize..2), 1..120),
    ) {
        let controller = Controller::new(controller(Channel::State, 0.005)).unwrap();
        let mut state = controller.initial_state(0);
        for (k, (first, second, target, mode)) in samples.into_iter().enumerate() {
            let y = [f64::from_bits(first), f64::from_bits(second)];
            tick(&controller, &mut state, k as u64, mode, &y, &[target, -target]);
            prop_assert!(outputs(&state).iter().all(|v| v.is_finite()), "tick {k}: {:?}", outputs(&state));
        }
    }

    /// A sensor that is lost for a while does not shake the true output more than a few noise levels.
    #[test]
    fn a_lost_sensor_is_bridged(sensor in 0usize..2, from in 60u64..700, length in 1u64..60) {
        let parameters = controller(Channel::State, 0.0);
        let mut scenario = scenario(reference("constant"), 0.0, 1);
        scenario.fault = vec![ftc_plant::scenario::Waveform::ZERO; 2];
        scenario.steps = 780;
        scenario.events = vec![ftc_plant::scenario::FaultEvent {
            sensor, from: from as f64, until: (from + length) as f64,
            kind: ftc_plant::scenario::FaultKind::Dropout,
        }];
        let plant = PlantSimulator::new(common::plant(Channel::State), scenario);
        let lost = run(&plant, &Controller::new(parameters).unwrap(), Variant::Ftc);
        for record in &lost.records[60..] {
            for output in 0..2 {
                prop_assert!((record.y_true[output] - 0.6).abs() < 0.03, "tick {}: {:?}", record.tick, record.y_true);
            }
        }
    }
}

/// What does not fit is refused where it is made, by the name of the field.
#[test]
fn wrong_sizes_are_refused_by_field() {
    use ftc_control::{ControllerError, ControllerParameters, Matrix, SampleError};
    type Damage = fn(&mut ControllerParameters);
    let damage: [(&str, Damage); 14] = [
        ("modes[1].b", |p| p.modes[1].b = Matrix::zeros(2, 1)),
        ("modes[0].x0", |p| p.modes[0].x0[0] = f64::NAN),
        ("feedback.tracked", |p| p.feedback.tracked = vec![0, 2]),
        ("feedback.modes[1].anti_windup", |p| {
            p.feedback.modes[1].anti_windup = Matrix::zeros(2, 3);
        }),
        ("observer.gains", |p| p.observer.gains.clear()),
        ("estimator.thresholds", |p| p.estimator.thresholds.clear()),
        ("estimator.largest_fault", |p| {
            p.estimator.largest_fault.push(1.0)
        }),
        ("estimator.predictors[0].factor", |p| {
            p.estimator.predictors[0].factor = Matrix::identity(3);
        }),
        ("estimator.tuning.bank.kept", |p| {
            p.estimator.tuning.bank.kept = 13.0
        }),
        ("estimator.tuning.bank.quiet_beside", |p| {
            p.estimator.tuning.bank.quiet_beside = f64::NAN;
        }),
        // Below 1, more sensors at once would be likelier than fewer.
        ("estimator.tuning.bank.several", |p| {
            p.estimator.tuning.bank.several = 0.9
        }),
        ("estimator.tuning.database.learning_share", |p| {
            p.estimator.tuning.database.learning_share = -1.0;
        }),
        ("estimator.tuning.delay.squares_ratio", |p| {
            p.estimator.tuning.delay.squares_ratio = 0.0;
        }),
        ("input_limits", |p| p.input_limits.truncate(1)),
    ];
    for (field, damage) in damage {
        let mut parameters = controller(Channel::State, 0.0);
        damage(&mut parameters);
        let error = Controller::new(parameters).unwrap_err();
        let named = match &error {
            ControllerError::Length { field, .. }
            | ControllerError::Shape { field, .. }
            | ControllerError::NotFinite { field }
            | ControllerError::Bounds { field, .. }
            | ControllerError::Range { field, .. } => field,
            other => panic!("{other}"),
        };
        assert_eq!(named, field, "{error}");
    }
    let controller = Controller::new(controller(Channel::State, 0.0)).unwrap();
    let wrong = |y: &[f64], reference: &[f64], mode| {
        controller
            .sample(0, mode, y, reference)
            .map(drop)
            .unwrap_err()
    };
    let length = |signal, found| SampleError::Length {
        signal,
        found,
        needed: 2,
    };
    assert_eq!(wrong(&[1.0], &[0.0; 2], 0), length("measurement", 1));
    assert_eq!(wrong(&[1.0; 2], &[0.0; 3], 0), length("reference", 3));
    assert_eq!(
        wrong(&[1.0; 2], &[0.0; 2], 2),
        SampleError::Mode { mode: 2, modes: 2 }
    );
    let sample = controller.sample(0, 0, &[0.0; 2], &[0.0; 2]).unwrap();
    assert_eq!(
        sample.with_thresholds(&[1.0]).unwrap_err(),
        length("thresholds", 1)
    );
}
