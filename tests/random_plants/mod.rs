//! Random switched plants with certified designs, for benches and property tests.
#![allow(dead_code, missing_docs)]

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use ftc_control::parameters::EstimatorMethod;
use ftc_design::assembly::{KnownDisturbance, Request, assemble};
use ftc_design::{ControlSpec, Design, Lyapunov, ObserverChoice, ObserverSpec, Signals};
use ftc_plant::Scenario;
use ftc_plant::scenario::{ModeInterval, Waveform};
use ftc_plant::{Mode, SwitchedPlant, spectral_radius};
use nalgebra::DMatrix;

/// Samples of the scenario a design comes with.
pub const STEPS: u64 = 50_000;
/// Standard deviation of every sensor's noise.
pub const NOISE: f64 = 0.003;

/// Seeded randomness.
pub struct RandomNumbers(ChaCha8Rng);

impl RandomNumbers {
    pub fn seeded(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        low + (self.unit() * (high - low + 1) as f64) as usize
    }
    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.between(-1.0, 1.0))
    }
}

fn mode(random: &mut RandomNumbers, n: usize, m: usize, p: usize, output: &DMatrix<f64>) -> Mode {
    let a = random.matrix(n, n);
    let radius = spectral_radius(&a).max(1e-3);
    Mode::new(
        a * (random.between(0.3, 0.85) / radius),
        random.matrix(n, m),
        output.clone(),
    )
    .named("random")
    .with_disturbance(random.matrix(n, 1) * 0.3, DMatrix::zeros(p, 1))
}

/// Alternating modes, so that switches happen with and without a fault.
pub fn schedule(te: f64, steps: u64, every: u64) -> Vec<ModeInterval> {
    (0..steps / every)
        .map(|k| ModeInterval {
            from: (k * every) as f64 * te,
            mode: (k % 2) as usize,
        })
        .collect()
}

/// A random plant with a certified design; draws until one exists.
pub fn design(random: &mut RandomNumbers) -> Design {
    design_with(random, EstimatorMethod::Reference)
}

/// The same with the state-based estimator and at least two sensors.
pub fn with_several_sensors(random: &mut RandomNumbers) -> Design {
    loop {
        let design = design_with(random, EstimatorMethod::Observer);
        if design.plant.dimensions().outputs > 1 {
            return design;
        }
    }
}

/// The same with an estimator of one's choice.
pub fn design_with(random: &mut RandomNumbers, method: EstimatorMethod) -> Design {
    loop {
        if let Ok(design) = assemble(request_with(random, method)) {
            return design;
        }
    }
}

/// What is asked for a random plant; there may be no such design.
pub fn request_with(random: &mut RandomNumbers, method: EstimatorMethod) -> Request {
    let (n, m, p) = (random.count(1, 5), random.count(1, 3), random.count(1, 3));
    let output = random.matrix(p, n);
    let plant = SwitchedPlant::new(
        random.between(0.01, 1.0),
        (0..2).map(|_| mode(random, n, m, p, &output)).collect(),
    );
    let dims = plant.dimensions();
    let r = p.min(m).min(n);
    let mut control = ControlSpec::unweighted(dims);
    control.tracked = (0..r).collect();
    control.lyapunov = Lyapunov::Dwell;
    control.decay = 0.95;
    control.output_weight = vec![1.0; r];
    control.integral_weight = vec![0.3 / plant.sample_time; r];
    control.input_weight = vec![0.3; m];
    let period = random.between(40.0, 300.0) * plant.sample_time;
    let seed = random.0.next_u64();
    let reference = (0..r).map(|_| Waveform::Square {
        amplitude: random.between(0.2, 0.8),
        period: 400.0 * plant.sample_time,
        offset: 0.0,
    });
    let mut scenario = Scenario::new(STEPS, reference.collect(), dims);
    scenario.noise = vec![NOISE; p];
    scenario.seed = seed;
    scenario.disturbance = vec![Waveform::Sine {
        amplitude: 0.05,
        period,
        phase: 0.0,
        offset: 0.0,
    }];
    let mut request = Request::new("random", plant, Signals::numbered(dims), scenario);
    request.control = control;
    request.observer = ObserverSpec::new(ObserverChoice::Auto, 0.9, Lyapunov::Dwell);
    request.estimator.method = method;
    let mut disturbance = KnownDisturbance::new(period);
    disturbance.amplitude = Some(vec![0.05]);
    request.estimator.disturbance = Some(disturbance);
    request
}
