//! The printed results one by one, computed on the paper's own plant.

use super::CHANNELS;
use crate::{Error, experiment};
use ftc_control::estimator::SlidingWindow;
use ftc_control::parameters::FeedbackGains;
use ftc_control::tuning::DatabaseTuning;
use ftc_design::as_printed::{PrintedVerdict, theorem_1, theorem_2};
use ftc_design::assembly::Request;
use ftc_design::{ControlSpec, DesignError, Lyapunov, StateFeedback, dense, state_feedback};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Mode, SwitchedPlant, spectral_radius};
use nalgebra::DMatrix;
use serde::Serialize;

/// Both printed theorems on the paper's plant.
pub fn theorems() -> Result<[PrintedVerdict; 2], Error> {
    let request = request()?;
    let in_case = experiment::in_case("paper, theorems as printed");
    Ok([
        theorem_1(&request.plant).map_err(&in_case)?,
        theorem_2(&request.plant, &request.control).map_err(&in_case)?,
    ])
}

/// The example with the disturbance on the state, as in section VII-A.
fn request() -> Result<Request, Error> {
    experiment::request(CHANNELS[0].1)
}

fn synthesise(plant: &SwitchedPlant, spec: &ControlSpec) -> Result<StateFeedback, DesignError> {
    let dims = plant.dimensions();
    let scaling = Scaling::unit(dims.states, dims.inputs, dims.outputs);
    state_feedback::synthesise(plant, spec, &scaling)
}

/// What the sliding window says of a step of the fault under constant input.
#[derive(Clone, Debug, Serialize)]
pub struct Absorption {
    /// Height of the step.
    pub fault: f64,
    /// Samples in the window, `L`.
    pub window: usize,
    /// At once.
    pub first: f64,
    /// After [`later`](Self::later) samples of fault.
    pub after: f64,
    /// How many these are.
    pub later: usize,
    /// When the fault fills the window.
    pub full: f64,
}

/// A step of 0.5 under constant input, two inputs, response length 12, a window of 46 samples.
pub fn absorption() -> Absorption {
    const FAULT: f64 = 0.5;
    const REGRESSOR: usize = 2 * 12;
    const WINDOW: usize = 46;
    const LATER: usize = 20;
    let rank = DatabaseTuning::default().window_rank;
    let mut window = SlidingWindow::new(REGRESSOR, 1, WINDOW, rank);
    let mut residual = |fault: f64| {
        let mut out = [0.0];
        window.residual(&[0.3; REGRESSOR], &[1.2 + fault], &mut out);
        out[0]
    };
    for _ in 0..2 * WINDOW {
        residual(0.0);
    }
    let seen: Vec<f64> = (0..=WINDOW).map(|_| residual(FAULT)).collect();
    Absorption {
        fault: FAULT,
        window: WINDOW,
        first: seen[0],
        after: seen[LATER - 1],
        later: LATER,
        full: seen[WINDOW],
    }
}

/// What it costs to let the disturbance drive the integrator as well.
#[derive(Clone, Debug, Serialize)]
pub struct DoubledDisturbance {
    /// Attenuation with the integrator driven by `-Te S F w`, as it is.
    pub corrected: f64,
    /// Attenuation with `diag(E, E)` as in (24); absent when infeasible.
    pub printed: Option<f64>,
}

/// The augmented disturbance matrix `diag(E, E)` is that of a plant with a second disturbance that
/// enters the output by `F = -E / Te`.
pub fn doubled_disturbance() -> Result<DoubledDisturbance, Error> {
    let Request { plant, control, .. } = request()?;
    let in_case = experiment::in_case("paper, disturbance on the integrator");
    let corrected = synthesise(&plant, &control).map_err(in_case)?;
    let te = plant.sample_time;
    let double = |mode: &Mode| {
        let (n, s) = mode.e.shape();
        let silent = DMatrix::zeros(n, s);
        let beside = |left: &DMatrix<f64>, right: &DMatrix<f64>| {
            DMatrix::from_columns(
                &left
                    .column_iter()
                    .chain(right.column_iter())
                    .collect::<Vec<_>>(),
            )
        };
        let e = beside(&mode.e, &silent);
        let f = beside(&silent, &(-&mode.e / te));
        mode.clone().with_disturbance(e, f)
    };
    let doubled = SwitchedPlant::new(te, plant.modes.iter().map(double).collect());
    Ok(DoubledDisturbance {
        corrected: largest(&corrected.gamma).unwrap_or(f64::NAN),
        printed: synthesise(&doubled, &control)
            .ok()
            .and_then(|feedback| largest(&feedback.gamma)),
    })
}

fn largest(gamma: &Option<Vec<f64>>) -> Option<f64> {
    gamma.as_ref()?.iter().copied().reduce(f64::max)
}

/// What one sample between command and action does.
#[derive(Clone, Debug, Serialize)]
pub struct Latency {
    /// Spectral radius per mode of the loop designed without the delay and run with it.
    pub ignored: Vec<f64>,
    /// Whether one Lyapunov function for all modes exists when the delay is designed for.
    pub common: bool,
    /// The same for one function per mode and arbitrary switching.
    pub switched: bool,
    /// How long modes must last when each is proved on its own, in samples.
    pub dwell: Option<f64>,
    /// Certified attenuation then.
    pub gamma: Option<f64>,
}

/// Latency 0 run with one sample of delay, and latency 1 under every certificate, decay 0.9.
pub fn latency() -> Result<Latency, Error> {
    const DECAY: f64 = 0.9;
    let Request { plant, control, .. } = request()?;
    let in_case = experiment::in_case("paper, latency");
    let prompt = synthesise(&plant, &control).map_err(&in_case)?;
    let gains = prompt.for_controller(&plant).modes;
    let ignored = plant.modes.iter().zip(&gains);
    let delayed = |lyapunov| {
        let mut spec = control.clone();
        spec.latency = 1;
        spec.decay = DECAY;
        spec.lyapunov = lyapunov;
        match synthesise(&plant, &spec) {
            Ok(feedback) => Ok(Some(feedback)),
            Err(DesignError::Infeasible(_)) => Ok(None),
            Err(error) => Err(in_case(error)),
        }
    };
    let dwell = delayed(Lyapunov::Dwell)?;
    Ok(Latency {
        ignored: ignored
            .map(|(mode, gains)| delayed_radius(mode, gains, plant.sample_time))
            .collect(),
        common: delayed(Lyapunov::Common)?.is_some(),
        switched: delayed(Lyapunov::Switched)?.is_some(),
        dwell: dwell.as_ref().and_then(|d| Some(d.dwell?.samples)),
        gamma: dwell.as_ref().and_then(|d| largest(&d.gamma)),
    })
}

/// Spectral radius of `[x; Z; u_prev]` under `u = K x + G Z` that acts one sample late.
fn delayed_radius(mode: &Mode, gains: &FeedbackGains, sample_time: f64) -> f64 {
    let (n, m) = mode.b.shape();
    let r = gains.integral.ncols();
    let mut matrix = DMatrix::zeros(n + r + m, n + r + m);
    matrix.view_mut((0, 0), (n, n)).copy_from(&mode.a);
    matrix.view_mut((0, n + r), (n, m)).copy_from(&mode.b);
    matrix
        .view_mut((n, 0), (r, n))
        .copy_from(&(-sample_time * mode.c.rows(0, r)));
    matrix.view_mut((n, n), (r, r)).fill_with_identity();
    matrix
        .view_mut((n + r, 0), (m, n))
        .copy_from(&dense(&gains.state_feedback));
    matrix
        .view_mut((n + r, n), (m, r))
        .copy_from(&dense(&gains.integral));
    spectral_radius(&matrix)
}
