//! The rectifier's energy balance, its diodes and its linearisation, by integration of its equations.

use core::f64::consts::PI;
use ftc_plant::rectifier::Rectifier;
use ftc_simulate::integrate::{self, Tolerance};

fn rectifier() -> Rectifier {
    Rectifier {
        inductance: 0.01,
        resistance: 0.3,
        capacitance: 2e-3,
        phase_voltage: 311.0,
        current_loop: 2e-3,
        dc_voltage: 600.0,
        loads: vec![80.0, 40.0],
    }
}

#[test]
fn the_operating_point_is_a_steady_state() {
    let plant = rectifier();
    for mode in 0..2 {
        let point = plant.operating_point(mode).unwrap();
        let x = [point.x[0], point.x[1], point.x[2]];
        let rates = plant.derivative(mode, &x, [point.u[0], point.u[1]], 0.0);
        assert!(rates.iter().all(|r| r.abs() < 1e-6), "{rates:?}");
    }
}

/// What goes in, less what the loads take, is what is stored.
#[test]
fn energy_is_conserved() {
    let plant = rectifier();
    let tolerance = Tolerance::new(1e-10, 1e-10);
    let u = [25.0, -8.0];
    let balance = |z: &[f64; 4]| {
        let x = [z[0], z[1], z[2]];
        let [d, q, v] = plant.derivative(0, &x, u, 1.5);
        let supplied = plant.drawn_power(&x) - x[2] * x[2] / 80.0 - 1.5 * x[2];
        [d, q, v, supplied]
    };
    let start = [9.7, 0.0, 600.0];
    let mut z = [start[0], start[1], start[2], 0.0];
    for _ in 0..40 {
        integrate::advance(&mut z, 5e-3, tolerance, balance).unwrap();
        let gained = plant.stored_energy(&[z[0], z[1], z[2]]) - plant.stored_energy(&start);
        assert!(
            (gained - z[3]).abs() < 1e-6 * plant.stored_energy(&start),
            "{gained} J against {} J",
            z[3]
        );
    }
    assert!(
        (z[2] - 600.0).abs() > 10.0,
        "the trajectory must move: {}",
        z[2]
    );
}

/// However hard the link is emptied into the grid, the diodes hold it up, and the energy that
/// they bring is accounted for.
#[test]
fn the_diodes_hold_the_link_up() {
    let plant = rectifier();
    let tolerance = Tolerance::new(1e-10, 1e-10);
    let u = [-40.0, 40.0];
    let load = plant.loads[1];
    let balance = |z: &[f64; 4]| {
        let x = [z[0], z[1], z[2]];
        let [d, q, v] = plant.derivative(1, &x, u, 1.5);
        [
            d,
            q,
            v,
            plant.supplied_power(&x, u) - x[2] * x[2] / load - 1.5 * x[2],
        ]
    };
    let start = [20.0, 0.0, 600.0];
    let mut z = [start[0], start[1], start[2], 0.0];
    for _ in 0..100 {
        integrate::advance(&mut z, 5e-3, tolerance, balance).unwrap();
        let gained = plant.stored_energy(&[z[0], z[1], z[2]]) - plant.stored_energy(&start);
        assert!((gained - z[3]).abs() < 1e-6 * plant.stored_energy(&start));
    }
    let floor = plant.diode_voltage();
    assert!((0.85 * floor..floor).contains(&z[2]), "{} V", z[2]);
    let fed = z[2] * plant.diode_current(z[2]);
    let taken = -plant.drawn_power(&[z[0], z[1], z[2]]) * z[2] / floor;
    assert!((fed - taken - z[2] * (z[2] / load + 1.5)).abs() < 1e-6 * fed);
}

/// Far below the peak the diodes are the textbook's bridge: the average of six pulses behind
/// two lines.
#[test]
fn a_loaded_bridge_gives_the_average_of_six_pulses() {
    let plant = rectifier();
    let average = 3.0 * 3f64.sqrt() / PI * plant.phase_voltage;
    let (v, two_lines) = (0.3 * average, 2.0 * plant.resistance);
    let current = plant.diode_current(v);
    assert!((current * two_lines / (average - v) - 1.0).abs() < 0.01);
    assert_eq!(plant.diode_current(plant.diode_voltage()), 0.0);
}

#[test]
fn a_link_below_the_peak_is_no_boost_rectifier() {
    let plant = Rectifier {
        dc_voltage: 500.0,
        ..rectifier()
    };
    let message = plant.linearise(5e-3).unwrap_err().to_string();
    assert!(message.contains("538.7"), "{message}");
}

/// A small deviation evolves as the linearisation says.
#[test]
fn the_linearisation_predicts_a_small_step() {
    let plant = rectifier();
    let linear = plant.linearise(5e-3).unwrap();
    let mode = &linear.modes[1];
    let point = &mode.operating_point;
    let mut x = [point.x[0], point.x[1], point.x[2]];
    let tolerance = Tolerance::new(1e-11, 1e-11);
    let small = 1e-3;
    let u = [point.u[0] + small, point.u[1] + small];
    integrate::advance(&mut x, 5e-3, tolerance, |x| {
        plant.derivative(1, x, u, small)
    })
    .unwrap();
    let step = &mode.b * nalgebra::DVector::from_element(2, small)
        + &mode.e * nalgebra::DVector::from_element(1, small);
    for row in 0..3 {
        assert!(
            (x[row] - point.x[row] - step[row]).abs() < 1e-3 * small,
            "{} {}",
            x[row] - point.x[row],
            step[row]
        );
    }
}
