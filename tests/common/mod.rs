//! The paper's example, built by hand: plant, scenario and a controller with fixed gains.
#![allow(dead_code, missing_docs)]

use ftc_control::ControllerParameters;
use ftc_control::parameters::{
    Compensation, Estimator, EstimatorMethod, FeedbackGains, Harmonics, Observer, ObserverKind,
    StateFeedback,
};
use ftc_design::assembly::KnownDisturbance;
use ftc_design::{
    ControllerDesign, HypothesesSpec, Signal, Signals, commissioning, mode_models, plain,
};
use ftc_plant::Scenario;
use ftc_plant::scenario::{FaultKind, ModeInterval, Waveform};
use ftc_plant::{Dimensions, Mode, SwitchedPlant};
use nalgebra::{DMatrix, dmatrix};

/// A fault of each kind, for the example under `levels`.
pub const KINDS: &[(&str, FaultKind)] = &[
    ("bias", FaultKind::Bias { size: 0.5 }),
    ("drift", FaultKind::Drift { slope: 0.004 }),
    ("gain loss", FaultKind::GainLoss { loss: 0.6 }),
    ("stuck", FaultKind::Stuck),
    (
        "intermittent",
        FaultKind::Intermittent {
            size: 0.4,
            period: 30.0,
        },
    ),
    ("dropout", FaultKind::Dropout),
];

/// Where the disturbance enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Channel {
    State,
    Output,
}

pub fn plant(channel: Channel) -> SwitchedPlant {
    let (e, f) = match channel {
        Channel::State => (dmatrix![1.0; 1.0], dmatrix![0.0; 0.0]),
        Channel::Output => (dmatrix![0.0; 0.0], dmatrix![1.0; 1.0]),
    };
    let mode = |name: &str, a: DMatrix<f64>, b: DMatrix<f64>| {
        Mode::new(a, b, DMatrix::identity(2, 2))
            .named(name)
            .with_disturbance(e.clone(), f.clone())
    };
    SwitchedPlant::new(
        1.0,
        vec![
            mode(
                "first",
                dmatrix![0.6, 0.45; -0.2, 0.3],
                dmatrix![0.0, 1.0; 1.0, 0.0],
            ),
            mode(
                "second",
                dmatrix![0.4, -0.3; 0.11, 0.0],
                DMatrix::identity(2, 2),
            ),
        ],
    )
}

pub const REFERENCES: [&str; 4] = ["constant", "square", "sine", "levels"];

pub fn reference(name: &str) -> Waveform {
    match name {
        "constant" => Waveform::Constant { value: 0.6 },
        "square" => Waveform::Square {
            amplitude: 0.6,
            period: 400.0,
            offset: 0.0,
        },
        "sine" => Waveform::Sine {
            amplitude: 0.6,
            period: 400.0,
            phase: 0.0,
            offset: 0.0,
        },
        _ => Waveform::Steps {
            points: vec![[0.0, 0.4], [300.0, 0.8], [700.0, -0.2], [1200.0, 0.5]],
        },
    }
}

pub fn scenario(reference: Waveform, noise: f64, disturbances: usize) -> Scenario {
    let fault = Waveform::Steps {
        points: vec![[101.0, 0.5], [401.0, 0.0], [1001.0, 0.5]],
    };
    let mut scenario = Scenario::new(
        1600,
        vec![reference; 2],
        Dimensions {
            states: 2,
            inputs: 2,
            outputs: 2,
            disturbances,
        },
    );
    scenario.noise = vec![noise; 2];
    scenario.seed = 42;
    scenario.schedule = vec![
        ModeInterval { from: 0.0, mode: 0 },
        ModeInterval {
            from: 800.0,
            mode: 1,
        },
    ];
    scenario.fault = vec![fault; 2];
    scenario.disturbance = vec![
        Waveform::Sine {
            amplitude: 0.04,
            period: core::f64::consts::TAU / 0.02,
            phase: 0.0,
            offset: 0.0
        };
        disturbances
    ];
    scenario
}

/// Gains from a linear-quadratic design, rounded by hand; an observer whose error shrinks by 80 % a sample.
pub fn controller_design(channel: Channel, noise: f64) -> ControllerDesign {
    let plant = plant(channel);
    let gains = |state_feedback: DMatrix<f64>, integral: DMatrix<f64>| {
        let mut gains = FeedbackGains::new(
            plain(&state_feedback),
            plain(&integral),
            plain(&state_feedback), // both states are measured
        );
        gains.feedforward = plain(&(&integral * plant.sample_time));
        gains
    };
    let decoupling = match channel {
        Channel::State => DMatrix::from_element(2, 2, 0.5),
        Channel::Output => DMatrix::zeros(2, 2),
    };
    let length = commissioning::response_length(&plant.modes).unwrap();
    let samples = length + commissioning::commissioning_samples(2, length);
    let predictors: Vec<_> = plant
        .modes
        .iter()
        .zip(1..)
        .map(|(mode, seed)| {
            let database = commissioning::commission(mode, &[1.0, 1.0], &[noise; 2], samples, seed);
            commissioning::predictor(&database, length, None).unwrap()
        })
        .collect();
    let observer_gains = plant
        .modes
        .iter()
        .map(|mode| {
            let t = DMatrix::identity(2, 2) - &decoupling * &mode.c;
            plain(&(t * &mode.a * 0.8))
        })
        .collect();
    let thresholds = (0..2)
        .map(|s| {
            predictors
                .iter()
                .map(|p| 6.0 * p.deviation[s])
                .fold(1e-3, f64::max)
        })
        .collect();
    let mut estimator = Estimator::none(2);
    estimator.method = EstimatorMethod::Reference;
    estimator.response_length = length;
    estimator.window = 2 * (length + 1) + 20;
    estimator.predictors = predictors;
    estimator.harmonics = Some(Harmonics {
        period: core::f64::consts::TAU / 0.02,
        count: 1,
        memory: 3000.0,
        initial_variance: 1e6,
    });
    estimator.harmonic_transfers =
        ftc_design::harmonics::transfers(&plant, &[1.0, 1.0], core::f64::consts::TAU / 0.02, 1);
    estimator.thresholds = thresholds;
    estimator.largest_fault = vec![1e6; 2];
    ControllerDesign::new(
        StateFeedback::new(
            vec![0, 1],
            vec![
                gains(
                    dmatrix![0.199, -0.827; -1.125, -0.447],
                    dmatrix![0.0, 0.528; 0.528, -0.001],
                ),
                gains(
                    dmatrix![-0.926, 0.298; -0.109, -0.529],
                    dmatrix![0.528, 0.001; 0.0, 0.529],
                ),
            ],
        ),
        Observer::new(
            match channel {
                Channel::State => ObserverKind::Uio,
                Channel::Output => ObserverKind::Luenberger,
            },
            observer_gains,
            vec![vec![plain(&decoupling); 2]; 2],
        ),
        estimator,
        Compensation::VirtualSensor,
    )
}

/// That controller with the plant it is for.
pub fn controller(channel: Channel, noise: f64) -> ControllerParameters {
    let plant = plant(channel);
    let design = controller_design(channel, noise);
    let mut parameters = ControllerParameters::new(
        plant.sample_time,
        mode_models(&plant),
        design.feedback,
        design.observer,
    );
    parameters.estimator = design.estimator;
    parameters.compensation = design.compensation;
    parameters
}

/// The same controller with the state-based estimator.
#[allow(dead_code)]
pub fn state_based(channel: Channel, noise: f64) -> ControllerParameters {
    let mut parameters = controller(channel, noise);
    let plant = plant(channel);
    let dims = plant.dimensions();
    let mut signals = Signals::numbered(dims);
    signals.disturbances = vec![Signal::new("w"); dims.disturbances];
    let known = KnownDisturbance::new(core::f64::consts::TAU / 0.02);
    let settings = HypothesesSpec::default().settings(
        &plant,
        &signals,
        vec![noise.max(1e-3 / 6.0); dims.outputs],
        &[],
        Some(&known),
    );
    parameters.estimator.method = EstimatorMethod::Observer;
    parameters.estimator.hypotheses = Some(settings);
    parameters
}
