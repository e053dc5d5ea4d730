//! Faults of every kind, on one sensor or both, overlapping, at a mode switch, and while the
//! estimator holds: the true output stays near that of a controller told the fault.
//!
//! promise: fault-kinds

mod common;

use common::{Channel, KINDS, controller, plant, reference, scenario};
use ftc_control::Controller;
use ftc_plant::scenario::{FaultEvent, FaultKind, FaultName, Waveform};
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run};
use nalgebra::DVector;

/// `(what, from, until)`: modes switch at 800, and the estimator then holds for 25 samples.
const WINDOWS: [(&str, f64, f64); 4] = [
    ("within a mode", 200.0, 500.0),
    ("across the switch", 600.0, 1000.0),
    ("from the switch on", 800.0, 1100.0),
    ("from inside the hold on", 810.0, 1100.0),
];

/// How far a fault of `sensors` that stays undetected can move a true output. It stays below its
/// threshold beside what the disturbance does to that output, for which it can be taken, and has at
/// every tick the sign that does most harm. The sum of the magnitudes of the uncompensated loop's
/// response to a fault of one tick, times that size, is the bound.
fn undetected(sensors: &[usize]) -> f64 {
    let thresholds = controller(Channel::State, 0.005).estimator.thresholds;
    let disturbed = disturbed();
    let healthy = quietly(&[]);
    let mut reach = [0.0; 2];
    for &sensor in sensors {
        // In either mode, far from the switch.
        let worst = [200.0, 1200.0].map(|from| {
            let one_sample = FaultEvent {
                sensor,
                from,
                until: from + 1.0,
                kind: FaultKind::Bias { size: 1.0 },
            };
            let moved = quietly(&[one_sample]);
            [0, 1].map(|output| {
                let pairs = moved.records.iter().zip(&healthy.records);
                pairs
                    .map(|(a, b)| (a.y_true[output] - b.y_true[output]).abs())
                    .sum::<f64>()
            })
        });
        for (output, reach) in reach.iter_mut().enumerate() {
            *reach +=
                (thresholds[sensor] + disturbed[sensor]) * worst[0][output].max(worst[1][output]);
        }
    }
    reach[0].max(reach[1])
}

/// The largest value the disturbance alone gives each output, in either mode.
fn disturbed() -> [f64; 2] {
    let plant = plant(Channel::State);
    let mut largest = [0.0; 2];
    for mode in &plant.modes {
        let mut x = DVector::zeros(2);
        for k in 0..2000 {
            let w = DVector::from_element(1, 0.04 * (0.02 * f64::from(k)).sin());
            let y = &mode.c * &x + &mode.f * &w;
            for (most, value) in largest.iter_mut().zip(y.iter()) {
                *most = value.abs().max(*most);
            }
            x = &mode.a * x + &mode.e * w;
        }
    }
    largest
}

/// The loop without fault compensation, without noise.
fn quietly(events: &[FaultEvent]) -> Trajectory {
    run_with_noise(events, Variant::NoFtc, 0.0)
}

fn simulate(events: &[FaultEvent], variant: Variant) -> Trajectory {
    run_with_noise(events, variant, 0.005)
}

fn run_with_noise(events: &[FaultEvent], variant: Variant, noise: f64) -> Trajectory {
    let parameters = controller(Channel::State, 0.005);
    let mut scenario = scenario(reference("levels"), noise, 1);
    scenario.fault = vec![Waveform::ZERO; 2];
    scenario.events = events.to_vec();
    let plant = PlantSimulator::new(common::plant(Channel::State), scenario);
    run(&plant, &Controller::new(parameters).unwrap(), variant)
}

/// Largest distance of the true outputs of two runs over the ticks that `judged` admits.
fn distance(a: &Trajectory, b: &Trajectory, judged: impl Fn(u64) -> bool) -> f64 {
    let pairs = a
        .records
        .iter()
        .zip(&b.records)
        .filter(|(r, _)| judged(r.tick));
    pairs
        .flat_map(|(a, b)| a.y_true.iter().zip(&b.y_true))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// A fault that begins while the estimator holds can only be judged afterwards, and what it did
/// to the loop meanwhile takes some samples to fade.
fn judged(tick: u64) -> bool {
    !(800..850).contains(&tick)
}

#[test]
fn every_kind_at_every_time_on_either_sensor_or_both() {
    for sensors in [&[0][..], &[1], &[0, 1]] {
        let undetected = undetected(sensors);
        println!("undetected faults on {sensors:?} move an output by up to {undetected:.3}");
        for &(name, kind) in KINDS {
            for (when, from, until) in WINDOWS {
                let events: Vec<_> = sensors
                    .iter()
                    .map(|&sensor| FaultEvent {
                        sensor,
                        from,
                        until,
                        kind,
                    })
                    .collect();
                let healthy = simulate(&[], Variant::Ftc);
                let tolerant = simulate(&events, Variant::Ftc);
                let off = distance(&tolerant, &healthy, judged);
                let uncompensated = distance(&simulate(&events, Variant::NoFtc), &healthy, judged);
                println!(
                    "{name} {when} on {sensors:?}: off by {off:.3}, without FTC by {uncompensated:.3}"
                );
                assert!(
                    off < undetected,
                    "{name} {when} on {sensors:?}: off by {off:.3}"
                );
                let finite = tolerant.records.iter().all(|r| {
                    r.u.iter()
                        .chain(&r.f_hat)
                        .chain(&r.x_hat)
                        .all(|v| v.is_finite())
                });
                assert!(finite, "{name} {when} on {sensors:?}");
                let last = &tolerant.records[1599];
                assert_eq!(
                    last.flagged,
                    [false, false],
                    "{name} {when} on {sensors:?}: never released"
                );
            }
        }
    }
}

#[test]
fn different_faults_overlap() {
    let undetected = undetected(&[0, 1]);
    for &(first, kind) in KINDS {
        for &(second, other) in KINDS {
            let events = [
                FaultEvent {
                    sensor: 0,
                    from: 200.0,
                    until: 500.0,
                    kind,
                },
                FaultEvent {
                    sensor: 1,
                    from: 350.0,
                    until: 650.0,
                    kind: other,
                },
            ];
            let off = distance(
                &simulate(&events, Variant::Ftc),
                &simulate(&[], Variant::Ftc),
                judged,
            );
            println!("{first} under {second}: off by {off:.3}");
            assert!(off < undetected, "{first} under {second}: off by {off:.3}");
        }
    }
}

/// In a record a fault has the letters of its name, and every name is one of the kinds tested here.
#[test]
fn a_kind_is_written_by_its_name() {
    for name in FaultName::ALL {
        let of_this_name = |(_, kind): &&(&str, FaultKind)| kind.name() == name;
        let (_, kind) = KINDS.iter().find(of_this_name).unwrap();
        let written = serde_json::to_value(kind).unwrap();
        assert_eq!(written["kind"], name.letters());
    }
}
