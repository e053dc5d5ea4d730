//! Identified models against the plants that made the logs, on data they did not see.
//!
//! promise: identify

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use ftc_identify::{Coordinates, Error, Identified, Log, Settings, identify};
use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

/// A switched plant about operating points.
struct Plant {
    modes: Vec<(DMatrix<f64>, DMatrix<f64>, DMatrix<f64>)>,
    points: Vec<(DVector<f64>, DVector<f64>, DVector<f64>)>,
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    random.next_u32() as f64 / u32::MAX as f64
}

impl Plant {
    /// Stable modes of `n` states, `m` inputs, `p` outputs, with operating points of one state.
    fn random(random: &mut ChaCha8Rng, n: usize, m: usize, p: usize, modes: usize) -> Self {
        let mut plant = Self {
            modes: Vec::new(),
            points: Vec::new(),
        };
        let c = DMatrix::from_fn(p, n, |_, _| normal(random));
        for _ in 0..modes {
            let raw = DMatrix::from_fn(n, n, |_, _| normal(random));
            let radius = raw
                .complex_eigenvalues()
                .iter()
                .map(|v| v.norm())
                .fold(0.0, f64::max);
            let a = raw * (0.75 + 0.15 * uniform(random)) / radius;
            let b = DMatrix::from_fn(n, m, |_, _| normal(random));
            let x0 = DVector::from_fn(n, |_, _| 3.0 * normal(random));
            let u0 = DVector::from_fn(m, |_, _| 5.0 + normal(random));
            plant.points.push((x0.clone(), u0, &c * x0));
            plant.modes.push((a, b, c.clone()));
        }
        plant
    }

    /// Outputs (samples x p) for inputs and modes, from the first mode's operating point.
    fn run(&self, inputs: &DMatrix<f64>, modes: &[usize]) -> DMatrix<f64> {
        let mut x = self.points[modes[0]].0.clone();
        let p = self.modes[0].2.nrows();
        let mut outputs = DMatrix::zeros(modes.len(), p);
        for (k, &mode) in modes.iter().enumerate() {
            let (a, b, c) = &self.modes[mode];
            let (x0, u0, y0) = &self.points[mode];
            let deviation = &x - x0;
            outputs.set_row(k, &(y0 + c * &deviation).transpose());
            x = x0 + a * deviation + b * (inputs.row(k).transpose() - u0);
        }
        outputs
    }

    /// A healthy log: inputs that move about their operating points, noisy sensors.
    fn log(&self, random: &mut ChaCha8Rng, modes: Vec<usize>, noise: f64) -> Log {
        let m = self.modes[0].1.ncols();
        let mut level = DVector::zeros(m);
        let mut inputs = DMatrix::zeros(modes.len(), m);
        for (k, &mode) in modes.iter().enumerate() {
            for entry in level.iter_mut() {
                if uniform(random) < 0.3 {
                    *entry = normal(random);
                }
            }
            inputs.set_row(k, &(&self.points[mode].1 + &level).transpose());
        }
        let clean = self.run(&inputs, &modes);
        let noisy = clean.map(|value| value + noise * normal(random));
        Log::new(inputs, noisy).in_modes(modes)
    }
}

/// The identified plant as one that can be run.
fn as_plant(found: &Identified) -> Plant {
    Plant {
        modes: found
            .modes
            .iter()
            .map(|m| (m.a.clone(), m.b.clone(), m.c.clone()))
            .collect(),
        points: found
            .modes
            .iter()
            .map(|m| (m.x0.clone(), m.u0.clone(), m.y0.clone()))
            .collect(),
    }
}

/// `C A^k B` for k below `count`.
fn markov(
    (a, b, c): &(DMatrix<f64>, DMatrix<f64>, DMatrix<f64>),
    count: usize,
) -> Vec<DMatrix<f64>> {
    let mut state = b.clone();
    (0..count)
        .map(|_| {
            let response = c * &state;
            state = a * &state;
            response
        })
        .collect()
}

/// Largest difference of the responses, relative to the largest response.
fn response_error(plant: &Plant, found: &Identified) -> f64 {
    let mut worst = 0.0_f64;
    for (mode, truth) in found.modes.iter().zip(&plant.modes) {
        let found = markov(&(mode.a.clone(), mode.b.clone(), mode.c.clone()), 30);
        let truth = markov(truth, 30);
        let size = truth.iter().map(DMatrix::amax).fold(0.0, f64::max);
        for (one, other) in found.iter().zip(&truth) {
            worst = worst.max((one - other).amax() / size);
        }
    }
    worst
}

fn alternating(rows: usize, dwell: usize, modes: usize) -> Vec<usize> {
    (0..rows).map(|k| k / dwell % modes).collect()
}

#[test]
fn without_noise_the_plant_is_found_and_so_is_its_order() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (n, m, p) in [(1, 1, 1), (2, 1, 2), (3, 2, 2), (4, 2, 2)] {
        let plant = Plant::random(&mut random, n, m, p, 2);
        let log = plant.log(&mut random, alternating(4000, 50, 2), 0.0);
        let found = identify(&[log], &Settings::default()).unwrap();
        assert_eq!(found.order, n, "{:?}", found.tried);
        let error = response_error(&plant, &found);
        assert!(error < 1e-5, "n = {n}: responses off by {error:e}");
        for mode in &found.modes {
            assert!(mode.fit.iter().all(|&fit| fit > 99.99), "{:?}", mode.fit);
        }
    }
}

/// A run that neither estimation nor fit has seen, with switches: only a state that is continuous
/// across them follows it.
#[test]
fn modes_share_one_state_where_switches_were_logged() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut worst = 100.0_f64;
    for _ in 0..6 {
        let plant = Plant::random(&mut random, 4, 2, 2, 3);
        let log = plant.log(&mut random, alternating(9000, 60, 3), 0.02);
        let found = identify(&[log], &Settings::default()).unwrap();
        assert!(
            matches!(found.coordinates, Coordinates::Switches { .. }),
            "{:?}",
            found.coordinates
        );
        let fresh = plant.log(&mut random, alternating(600, 13, 3), 0.0);
        let mut model = as_plant(&found);
        // Both start at rest in the first mode, at the same input.
        model.points[0].1.clone_from(&found.modes[0].u0);
        let simulated = model.run(&fresh.inputs, &fresh.modes);
        for output in 0..2 {
            let (truth, guess) = (
                fresh.outputs.column(output).rows(100, 500).into_owned(),
                simulated.column(output).rows(100, 500).into_owned(),
            );
            let spread = truth.add_scalar(-truth.mean()).norm();
            worst = worst.min(100.0 * (1.0 - (truth - guess).norm() / spread));
        }
    }
    assert!(worst > 90.0, "fit of a switching run: {worst:.1} %");
}

#[test]
fn with_separate_logs_outputs_are_the_states() {
    const NOISE: f64 = 0.02;
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let plant = Plant::random(&mut random, 2, 2, 2, 2);
    let logs: Vec<Log> = (0..2)
        .map(|mode| plant.log(&mut random, vec![mode; 800], NOISE))
        .collect();
    let found = identify(&logs, &Settings::default()).unwrap();
    assert_eq!(found.order, 2, "{:?}", found.tried);
    assert_eq!(found.coordinates, Coordinates::Outputs);
    for (mode, point) in found.modes.iter().zip(&plant.points) {
        assert!(
            (&mode.c - DMatrix::identity(2, 2)).amax() < 1e-9,
            "{}",
            mode.c
        );
        assert!((&mode.x0 - &mode.y0).amax() < 1e-9);
        // The operating point is a steady state of the plant: y0 as the plant's own at u0.
        assert!((&mode.u0 - &point.1).amax() < 0.5);
    }
    for (mode, log) in found.modes.iter().zip(&logs) {
        for (output, fit) in mode.fit.iter().enumerate() {
            // The last fifth was held out; the plant itself cannot follow the noise either.
            let held_out = log.outputs.column(output).rows(640, 160).into_owned();
            let spread = held_out.variance().sqrt();
            let best = 100.0 * (1.0 - NOISE / spread);
            assert!(
                (best - 1.5..best + 1.5).contains(fit),
                "fit {fit} %, the plant itself {best} %"
            );
        }
    }
    assert!(response_error(&plant, &found) < 0.05);
}

#[test]
fn an_order_that_is_asked_for_is_kept() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let plant = Plant::random(&mut random, 3, 1, 1, 1);
    let log = plant.log(&mut random, vec![0; 2000], 0.01);
    let mut settings = Settings::default();
    settings.order = Some(2);
    let found = identify(&[log], &settings).unwrap();
    assert_eq!((found.order, found.modes[0].a.nrows()), (2, 2));
    assert_eq!(found.coordinates, Coordinates::Single);
}

/// A disturbance that was not measured, of known period: the plant is found, its oscillation is not.
#[test]
fn a_periodic_disturbance_is_told_from_the_plant() {
    const PERIOD: f64 = 120.0;
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let plant = Plant::random(&mut random, 2, 2, 2, 1);
    let mut log = plant.log(&mut random, vec![0; 700], 0.01);
    // It acts on the state, so that what it does to the outputs is another sine.
    let (a, _, c) = &plant.modes[0];
    let mut x = DVector::zeros(2);
    for k in 0..700 {
        let mut row = log.outputs.row_mut(k);
        row += (c * &x).transpose();
        let w = 2.0 * (std::f64::consts::TAU * k as f64 / PERIOD).sin();
        x = a * x + DVector::from_element(2, w);
    }
    let mut settings = Settings::default();
    settings.periods = vec![PERIOD];
    let found = identify(&[log.clone()], &settings).unwrap();
    assert_eq!(found.order, 2, "{:?}", found.tried);
    let error = response_error(&plant, &found);
    assert!(error < 0.05, "responses off by {error:e}");
    let (mode, point) = (&found.modes[0], &plant.points[0]);
    assert_eq!((mode.b.ncols(), mode.u0.len()), (2, 2));
    // The operating point is that without the disturbance.
    let gain = c * (DMatrix::identity(2, 2) - a).try_inverse().unwrap() * &plant.modes[0].1;
    let expected = &point.2 + gain * (&mode.u0 - &point.1);
    assert!(
        (&mode.y0 - expected).amax() < 0.2,
        "{} {}",
        mode.y0,
        point.2
    );
    let blind = identify(&[log.clone()], &Settings::default()).unwrap();
    assert!(blind.order > 2, "{:?}", blind.tried);
    let mut wrong = Settings::default();
    wrong.periods = vec![1.5];
    assert_eq!(identify(&[log], &wrong).unwrap_err(), Error::Period(1.5));
}

#[test]
fn an_integrator_is_found() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let inputs = DMatrix::from_fn(600, 1, |_, _| normal(&mut random));
    let mut outputs = DMatrix::zeros(600, 1);
    for k in 0..599 {
        outputs[(k + 1, 0)] = outputs[(k, 0)] + 0.3 * inputs[(k, 0)];
    }
    let log = Log::new(inputs, outputs).in_modes(vec![0; 600]);
    let found = identify(&[log], &Settings::default()).unwrap();
    assert!(
        (found.modes[0].a[(0, 0)] - 1.0).abs() < 1e-6,
        "{}",
        found.modes[0].a
    );
}

#[test]
fn what_a_log_lacks_is_said() {
    let log = |rows: usize, moving: bool| {
        Log::new(
            DMatrix::from_fn(rows, 1, |k, _| if moving { (k % 7) as f64 } else { 1.0 }),
            DMatrix::from_fn(rows, 1, |k, _| (k % 5) as f64),
        )
        .in_modes(vec![0; rows])
    };
    let refused = |logs: &[Log]| identify(logs, &Settings::default()).unwrap_err();
    assert!(matches!(refused(&[]), Error::TooShort { samples: 0, .. }));
    assert!(matches!(
        refused(&[log(20, true)]),
        Error::TooShort { samples: 20, .. }
    ));
    let still = Error::Still {
        mode: 1,
        signal: "input",
        number: 1,
    };
    assert_eq!(refused(&[log(200, false)]), still);
    let mut none = Settings::default();
    none.order = Some(0);
    assert_eq!(
        identify(&[log(200, true)], &none).unwrap_err(),
        Error::NoState
    );
    let mut broken = log(200, true);
    broken.outputs[(11, 0)] = f64::NAN;
    assert_eq!(refused(&[broken]), Error::NotFinite { log: 1, row: 12 });
    let mut short = log(200, true);
    short.modes.pop();
    assert!(matches!(refused(&[short]), Error::Sizes { log: 1, .. }));
    let mut skipping = log(200, true);
    skipping.modes.fill(1);
    assert!(matches!(
        refused(&[skipping]),
        Error::TooShort {
            mode: 1,
            samples: 0,
            ..
        }
    ));
}
