//! A true plant that departs from its model: each departure by itself, against its definition.
//!
//! promise: true-plant
#![allow(missing_docs)]

use ftc_plant::deviation::{Load, Port, Told};
use ftc_plant::scenario::{FaultEvent, FaultKind, ModeInterval, Scenario, Waveform};
use ftc_plant::{Deviation, Mode, OperatingPoint, SwitchedPlant, TruePlant};
use ftc_simulate::plant::{Change, External};
use ftc_simulate::{PlantSimulator, PlantState};
use nalgebra::{DVector, dmatrix};

/// Two modes, two states, one input, one output, one disturbance.
fn plant() -> SwitchedPlant {
    let mode = |gain: f64| {
        Mode::new(
            dmatrix![0.5, 0.1; 0.0, 0.4],
            dmatrix![gain; 0.5],
            dmatrix![1.0, -1.0],
        )
        .named("mode")
        .with_disturbance(dmatrix![1.0; 0.0], dmatrix![0.25])
        .about(OperatingPoint {
            x: vec![1.0, 2.0],
            u: vec![3.0],
            y: vec![4.0],
        })
    };
    SwitchedPlant::new(0.5, vec![mode(1.0), mode(2.0)])
}

fn scenario() -> Scenario {
    let mut scenario = Scenario::new(20, vec![Waveform::ZERO], plant().dimensions());
    scenario.schedule = vec![
        ModeInterval { from: 0.0, mode: 0 },
        ModeInterval { from: 4.0, mode: 1 },
    ];
    scenario.disturbance = vec![Waveform::Sine {
        amplitude: 0.3,
        period: 3.0,
        phase: 0.0,
        offset: 0.0,
    }];
    scenario
}

/// The one departure that `set` makes.
fn deviating(set: impl Fn(&mut Deviation)) -> Deviation {
    let mut deviation = Deviation::default();
    set(&mut deviation);
    deviation
}

/// One state per sample under the command `3 + k / 10`.
fn run(deviation: Deviation) -> Vec<PlantState> {
    let truth = TruePlant::AsDesigned.with_deviation(deviation);
    let simulator = PlantSimulator::with_true_plant(plant(), truth, scenario());
    let mut state = simulator.initial_state();
    let external = External::new(&[0.0], &[0.0]);
    (0..20)
        .map(|k| {
            simulator.observe(&mut state, &external);
            let seen = state.clone();
            assert!(simulator.fits(&seen));
            simulator.advance(&mut state, &[command(k)]).unwrap();
            seen
        })
        .collect()
}

fn command(k: u32) -> f64 {
    3.0 + f64::from(k) / 10.0
}

/// The states under the inputs `u(k)`, extra disturbances and state loads, by the definition.
fn expected(
    u: impl Fn(usize) -> f64,
    w: impl Fn(usize) -> f64,
    load: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let plant = plant();
    let scenario = scenario();
    let x0 = DVector::from_vec(vec![1.0, 2.0]);
    let mut x = x0.clone();
    (0..20)
        .map(|k| {
            let mode = &plant.modes[scenario.mode(k as u64, 0.5)];
            let disturbance = scenario.disturbance[0].at(k as u64, 0.5) + w(k);
            let y = 4.0 + (&mode.c * (&x - &x0))[0] + 0.25 * disturbance;
            x = &x0
                + &mode.a * (&x - &x0)
                + &mode.b * (u(k) - 3.0)
                + &mode.e * disturbance
                + DVector::from_vec(vec![0.0, load(k)]);
            y
        })
        .collect()
}

fn same(found: &[PlantState], expected: &[f64]) {
    for (k, (state, y)) in found.iter().zip(expected).enumerate() {
        assert!(
            (state.y_true[0] - y).abs() < 1e-12,
            "{k}: {} for {y}",
            state.y_true[0]
        );
    }
}

fn asked(k: usize) -> f64 {
    command(k as u32)
}

/// Whether sample `k` lies in `[2, 5)` seconds.
fn within(k: usize) -> bool {
    (4..10).contains(&k)
}

#[test]
fn without_departures_nothing_changes() {
    let (with, without) = (run(Deviation::default()), expected(asked, |_| 0.0, |_| 0.0));
    same(&with, &without);
    assert!(
        with.iter()
            .all(|state| state.y == state.y_true && state.told == state.mode)
    );
}

#[test]
fn actuators_have_gains_and_faults() {
    let gained = run(deviating(|deviation| deviation.input_gain = vec![1.1]));
    same(&gained, &expected(|k| 1.1 * asked(k), |_| 0.0, |_| 0.0));
    let faulty = |kind| {
        run(deviating(|deviation| {
            deviation.actuator_faults = vec![FaultEvent {
                sensor: 0,
                from: 2.0,
                until: 5.0,
                kind,
            }]
        }))
    };
    let acting = |k: usize, instead: f64| if within(k) { instead } else { asked(k) };
    same(
        &faulty(FaultKind::Stuck),
        &expected(|k| acting(k, asked(3)), |_| 0.0, |_| 0.0),
    );
    same(
        &faulty(FaultKind::Dropout),
        &expected(|k| acting(k, 0.0), |_| 0.0, |_| 0.0),
    );
    let lost = faulty(FaultKind::GainLoss { loss: 0.4 });
    same(
        &lost,
        &expected(|k| acting(k, 0.6 * asked(k)), |_| 0.0, |_| 0.0),
    );
    let biased = faulty(FaultKind::Bias { size: -0.7 });
    same(
        &biased,
        &expected(|k| acting(k, asked(k) - 0.7), |_| 0.0, |_| 0.0),
    );
}

#[test]
fn loads_act_where_they_are_put() {
    let at = |at| {
        run(deviating(|deviation| {
            deviation.loads = vec![Load {
                at,
                from: 2.0,
                until: 5.0,
                size: 0.2,
            }]
        }))
    };
    let load = |k: usize| if within(k) { 0.2 } else { 0.0 };
    same(
        &at(Port::Input(0)),
        &expected(|k| asked(k) + load(k), |_| 0.0, |_| 0.0),
    );
    same(&at(Port::Disturbance(0)), &expected(asked, load, |_| 0.0));
    same(&at(Port::State(1)), &expected(asked, |_| 0.0, load));
}

#[test]
fn readings_come_late() {
    let states = run(deviating(|deviation| deviation.sensor_delay = 3));
    same(&states, &expected(asked, |_| 0.0, |_| 0.0));
    for (k, state) in states.iter().enumerate() {
        let read = if k < 3 { 4.0 } else { states[k - 3].y_true[0] };
        assert_eq!(state.y[0], read, "{k}");
    }
}

#[test]
fn the_mode_is_told_late_or_wrong() {
    let late = run(deviating(|deviation| deviation.mode_delay = 2));
    let wrong = run(deviating(|deviation| {
        deviation.told = vec![Told {
            from: 1.0,
            until: 2.0,
            mode: 1,
        }]
    }));
    for k in 0..20 {
        assert_eq!(
            (late[k].mode, late[k].told),
            (usize::from(k >= 8), usize::from(k >= 10))
        );
        let told = if (2..4).contains(&k) {
            1
        } else {
            usize::from(k >= 8)
        };
        assert_eq!((wrong[k].mode, wrong[k].told), (usize::from(k >= 8), told));
    }
}

/// The derivative of a tick is that of the departed plant, against differences.
#[test]
fn derivatives_know_the_departures() {
    let fault = |kind| FaultEvent {
        sensor: 0,
        from: 0.0,
        until: 9.0,
        kind,
    };
    for (deviation, late) in [
        (
            deviating(|deviation| deviation.input_gain = vec![1.3]),
            false,
        ),
        (
            deviating(|deviation| {
                deviation.actuator_faults = vec![fault(FaultKind::GainLoss { loss: 0.25 })]
            }),
            false,
        ),
        (
            deviating(|deviation| deviation.actuator_faults = vec![fault(FaultKind::Stuck)]),
            false,
        ),
        (deviating(|deviation| deviation.sensor_delay = 2), true),
    ] {
        let truth = TruePlant::AsDesigned.with_deviation(deviation);
        let simulator = PlantSimulator::with_true_plant(plant(), truth, scenario());
        let external = External::new(&[0.0], &[0.0]).with_noise(false);
        let mut state = simulator.initial_state();
        simulator.observe(&mut state, &external);
        let after = |u: f64| {
            let mut trial = state.clone();
            simulator.advance(&mut trial, &[u]).unwrap();
            simulator.observe(&mut trial, &external);
            trial
        };
        let (less, more) = (after(3.2 - 0.5), after(3.2 + 0.5));
        let change = Change {
            command: &[1.0],
            fault: &[0.0],
            disturbance: &[0.0],
        };
        let mut found = state.clone();
        simulator.differentiate_tick(&mut found, &external, &[3.2], &change);
        assert!((found.y_true[0] - (more.y_true[0] - less.y_true[0])).abs() < 1e-12);
        assert!((found.y[0] - (more.y[0] - less.y[0])).abs() < 1e-12);
        assert!(!late || found.y[0] == 0.0);
    }
}
