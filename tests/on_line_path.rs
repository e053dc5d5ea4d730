//! The on-line path is sacred: no allocation, finite in and finite out, the same bits every time.
//!
//! promise: no-allocation

mod common;

use common::{Channel, controller, reference, scenario};
use ftc_control::parameters::Transfer;
use ftc_control::{Compensate, Controller, ControllerState, Sample};
use ftc_simulate::{PlantSimulator, Variant, run};
use proptest::prelude::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts this thread's allocations.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is handed on to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn tick(
    controller: &Controller,
    state: &mut ControllerState,
    tick: u64,
    mode: usize,
    y: &[f64],
    reference: &[f64],
) {
    let sample = Sample {
        tick,
        mode,
        measurement: y,
        reference,
        thresholds: &controller.parameters().estimator.thresholds,
        compensate: Compensate::Estimate,
    };
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
    let controller = Controller::new(controller(Channel::State, 0.005));
    let mut state = controller.initial_state(0);
    let before = ALLOCATIONS.with(Cell::get);
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
    assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0);
    drop(Box::new(1));
    assert_ne!(
        ALLOCATIONS.with(Cell::get),
        before,
        "the counter must count"
    );
}

#[test]
fn the_same_inputs_give_the_same_bits_and_a_copy_is_a_snapshot() {
    let parameters = controller(Channel::State, 0.005);
    let plant = PlantSimulator::new(
        parameters.plant.clone(),
        scenario(reference("levels"), 0.005, 1),
    );
    let controller = Controller::new(parameters);
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
        let controller = Controller::new(parameters);
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
        samples in prop::collection::vec((any::<u64>(), any::<u64>(), -1e300..1e300f64, 0usize..3), 1..120),
    ) {
        let controller = Controller::new(controller(Channel::State, 0.005));
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
        let plant = PlantSimulator::new(parameters.plant.clone(), scenario);
        let lost = run(&plant, &Controller::new(parameters), Variant::Ftc);
        for record in &lost.records[60..] {
            for output in 0..2 {
                prop_assert!((record.y_true[output] - 0.6).abs() < 0.03, "tick {}: {:?}", record.tick, record.y_true);
            }
        }
    }
}
