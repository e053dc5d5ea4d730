//! The model predictive baseline is a fair opponent: it follows without offset, keeps to the
//! input limits, and plans what the unconstrained optimum plans where no limit is near.

mod common;

use common::{Channel, plant, scenario};
use ftc_baselines::predictive::{Predictive, PredictiveSpec};
use ftc_control::parameters::Limits;
use ftc_plant::scenario::Waveform;
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run_with};

fn spec(limit: f64) -> PredictiveSpec {
    let mut spec = PredictiveSpec::new(&plant(Channel::State), vec![0, 1], vec![0.01; 2]);
    for limits in &mut spec.limits {
        *limits = Limits {
            min: Some(-limit),
            max: Some(limit),
        };
    }
    spec.disturbance = vec![0.04];
    spec
}

fn simulate(limit: f64, fault: Waveform, offset: f64) -> Trajectory {
    let plant = plant(Channel::State);
    let mut scenario = scenario(Waveform::Constant { value: 0.6 }, 0.0, 1);
    scenario.fault = vec![fault; 2];
    scenario.disturbance = vec![Waveform::Constant { value: offset }];
    let simulator = PlantSimulator::new(plant.clone(), scenario);
    let mut controller = Predictive::new(&plant, &spec(limit), 0).unwrap();
    run_with(&simulator, &mut controller, Variant::Predictive, false)
}

#[test]
fn a_constant_disturbance_leaves_no_offset() {
    let trajectory = simulate(1e3, Waveform::ZERO, 0.05);
    for tick in [790, 1599] {
        for y in &trajectory.records[tick].y_true {
            assert!((y - 0.6).abs() < 1e-6, "tick {tick}: {y}");
        }
    }
}

#[test]
fn the_limits_hold_at_every_tick_and_bind_at_some() {
    let free = simulate(1e3, Waveform::ZERO, 0.0);
    let largest = |t: &Trajectory| {
        t.records
            .iter()
            .flat_map(|r| &r.u)
            .fold(0.0_f64, |a, u| a.max(u.abs()))
    };
    let limit = 0.8 * largest(&free);
    let bound = largest(&simulate(limit, Waveform::ZERO, 0.0));
    assert!(
        bound <= limit * (1.0 + 1e-6) && bound >= limit * (1.0 - 1e-4),
        "{bound} of {limit}"
    );
}

#[test]
fn it_follows_a_faulty_sensor() {
    let trajectory = simulate(1e3, Waveform::Constant { value: 0.5 }, 0.0);
    for y in &trajectory.records[700].y_true {
        assert!((y - 0.1).abs() < 1e-3, "{y}");
    }
}
