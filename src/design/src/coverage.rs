//! Whether everything that decides what the controller does follows from what is proved.
//!
//! What the inequalities say nothing about is derived again from the plant and the certified gains, or
//! held against a relation that it must satisfy. [`UNCOVERED`] names what is left.

use crate::augmented::scaled;
use crate::derived;
use crate::harmonics::{self, KnownDisturbance};
use crate::hypotheses::{self, FAULT_RATES, LENGTHS, MODEL_ERRORS};
use crate::observer::{check_decoupling, lost_gains_fit};
use crate::spec::LARGEST;
use crate::{
    CertificateError, Design, HypothesesSpec, ObserverDesign, RecordError, StateFeedback, Synthesis,
};
use ftc_control::Matrix;
use ftc_control::parameters::{
    Estimator, EstimatorMethod, FeedbackGains, MOST_HARMONICS, ObserverKind, Predictor,
};
use ftc_control::tuning::{LEVERAGE_LIMIT, Tuning};
use ftc_plant::scaling::Scaling;
use ftc_record::dense;
use nalgebra::DMatrix;

/// How far a number may lie from what it is derived to be, relative to the largest of its kind:
/// rounding on another machine, and no more.
const TOLERANCE: f64 = 1e-9;

/// Numbers of a design that `verify` holds against bounds only, in words for its report.
pub const UNCOVERED: [&str; 7] = [
    "what the user, or a log, tells the state-based estimator: the plant's matrices as the log has them, model error, fault rate and length, largest correction, loads, the disturbance's size and period",
    "that the mode, told or found from the readings, is the plant's (the claims hold while it is)",
    "the values of the operating points (any are admissible: the claims are about deviations from them)",
    "the ranges of the inputs (the claims hold while no input is at a limit)",
    "the coefficients of the fault estimator's predictors and its thresholds, debounce and learning (the claims hold \
     while no estimate is taken out of the loop)",
    "whether gamma is the least possible",
    "the machine code of the binaries, beyond the ticks for which the one of this machine is run",
];

/// What of a design does not follow from what is proved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoverageError {
    /// The design was not made by synthesis.
    #[error("the design holds no proof: export it again")]
    NoProof,
    /// Parts of the design do not fit together.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// An inequality is not proved.
    #[error("{0}: export the design again")]
    Unproved(#[from] CertificateError),
    /// A part of the controller differs from what is derived of it; its name.
    #[error("{0} of the controller does not follow from what is proved: export the design again")]
    Differs(String),
    /// The observer passes the disturbance on. Modes count from 1.
    #[error(
        "the observer does not decouple the disturbance from mode {mode} to mode {successor}: export the design again"
    )]
    Coupled {
        /// The mode.
        mode: usize,
        /// The mode that follows.
        successor: usize,
    },
}

/// Proves the design's claims, and that everything that decides what its controller does follows from
/// them. Nothing is solved.
///
/// # Errors
/// The first part that does not fit, is not proved or does not follow.
pub fn prove(design: &Design) -> Result<(), CoverageError> {
    design.check()?;
    let synthesis = design.synthesis().ok_or(CoverageError::NoProof)?;
    synthesis.verify(&design.plant)?;
    follows(design, &synthesis)
}

/// Derives again what can be, and checks the rest against its relations. The sizes are those that
/// [`prove`] has checked.
///
/// # Errors
/// The first part that does not follow.
pub fn check(design: &Design) -> Result<(), CoverageError> {
    follows(design, &design.synthesis().ok_or(CoverageError::NoProof)?)
}

fn follows(design: &Design, synthesis: &Synthesis) -> Result<(), CoverageError> {
    check_feedback(design, synthesis)?;
    check_observer(design, synthesis)?;
    check_operating_points(design)?;
    check_limits(design)?;
    check_estimator(design)?;
    check_report(&synthesis.state_feedback, &synthesis.observer)
}

fn differs(what: &str) -> CoverageError {
    CoverageError::Differs(what.into())
}

/// The first condition that fails.
fn all(conditions: &[(bool, &str)]) -> Result<(), CoverageError> {
    match conditions.iter().find(|(holds, _)| !holds) {
        Some((_, what)) => Err(differs(what)),
        None => Ok(()),
    }
}

/// Whether two matrices agree up to rounding, where rows and columns are in these units: what is small
/// because of its unit alone counts as much as the rest.
fn close(found: &Matrix, derived: &Matrix, rows: &[f64], columns: &[f64], tolerance: f64) -> bool {
    if found.shape() != derived.shape() || found.shape() != (rows.len(), columns.len()) {
        return false;
    }
    let [found, derived] = [found, derived].map(|matrix| scaled(&dense(matrix), rows, columns));
    let mut pairs = found.iter().zip(derived.iter());
    pairs.all(|(f, d)| (f - d).abs() <= tolerance * derived.amax())
}

fn check_feedback(design: &Design, synthesis: &Synthesis) -> Result<(), CoverageError> {
    let (running, proved) = (&design.controller.feedback, &synthesis.state_feedback);
    let derived = derived::feedback(
        proved,
        &design.plant,
        synthesis.running_loop.transfer.as_ref(),
        running.has_feedforward(),
        &design.signals.input_limits(),
    );
    all(&[(running.transfer == derived.transfer, "bumpless transfer")])?;
    let units = GainUnits::new(proved);
    for (mode, (runs, gains)) in running.modes.iter().zip(&derived.modes).enumerate() {
        check_gains(mode, runs, gains, &units)?;
    }
    Ok(())
}

/// The units of what the gains outside the proved loop connect, as the certificate has them.
struct GainUnits {
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    tracked: Vec<f64>,
    integrals: Vec<f64>,
}

impl GainUnits {
    fn new(proved: &StateFeedback) -> Self {
        let (units, spec) = (&proved.certificate.units, &proved.spec);
        Self {
            inputs: units.inputs.clone(),
            outputs: units.outputs.clone(),
            tracked: spec.tracked.iter().map(|&k| units.outputs[k]).collect(),
            integrals: units.integral_part(spec),
        }
    }
}

fn check_gains(
    mode: usize,
    runs: &FeedbackGains,
    derived: &FeedbackGains,
    units: &GainUnits,
) -> Result<(), CoverageError> {
    let GainUnits {
        inputs,
        outputs,
        tracked,
        integrals,
    } = units;
    let same = |found: &Matrix, derived: &Matrix, rows: &[f64], columns: &[f64]| {
        let none = derived.shape().1 == 0 && found.shape() == derived.shape();
        none || close(found, derived, rows, columns, TOLERANCE)
    };
    let rounded = [
        (
            same(&runs.feedforward, &derived.feedforward, inputs, tracked),
            "the feedforward",
        ),
        (
            same(&runs.anti_windup, &derived.anti_windup, integrals, inputs),
            "the anti-windup gain",
        ),
        (
            same(
                &runs.output_feedback,
                &derived.output_feedback,
                inputs,
                outputs,
            ),
            "the gain of the additive control",
        ),
    ];
    match rounded.iter().find(|(same, _)| !same) {
        Some((_, what)) => Err(differs(&format!("mode {}: {what}", mode + 1))),
        None => Ok(()),
    }
}

fn check_observer(design: &Design, synthesis: &Synthesis) -> Result<(), CoverageError> {
    let observer = &design.controller.observer;
    all(&[(lost_gains_fit(observer), "the gains for lost sensors")])?;
    match observer.kind {
        ObserverKind::Uio => {
            check_decoupling(&design.plant, &synthesis.observer).map_err(|[mode, successor]| {
                CoverageError::Coupled {
                    mode: mode + 1,
                    successor: successor + 1,
                }
            })
        }
        ObserverKind::Luenberger | ObserverKind::Kalman => Ok(()),
    }
}

fn check_operating_points(design: &Design) -> Result<(), CoverageError> {
    for (mode, described) in design.plant.modes.iter().enumerate() {
        let point = &described.operating_point;
        let parts = [
            (&point.x, "state"),
            (&point.u, "input"),
            (&point.y, "output"),
        ];
        for (values, what) in parts {
            if !values.iter().all(|value| value.abs() <= LARGEST) {
                return Err(differs(&format!(
                    "the operating {what} of mode {}",
                    mode + 1
                )));
            }
        }
        let limits = design.signals.input_limits();
        let inputs = point.u.iter().zip(&limits);
        let mut inside = inputs.map(|(&u, limit)| limit.clamp(u) == u);
        if !inside.all(|inside| inside) {
            return Err(differs(&format!(
                "the operating input of mode {}, which lies beyond its limits,",
                mode + 1
            )));
        }
    }
    Ok(())
}

fn check_limits(design: &Design) -> Result<(), CoverageError> {
    let outputs = &design.signals.outputs;
    let limits = design.signals.input_limits();
    let ordered = limits.iter().all(|limit| match (limit.min, limit.max) {
        (Some(min), Some(max)) => min < max,
        _ => true,
    });
    let estimator = &design.controller.estimator;
    let faults = derived::largest_faults(outputs);
    all(&[
        (ordered, "a limit"),
        (estimator.largest_fault == faults, "the largest fault"),
    ])
}

fn check_estimator(design: &Design) -> Result<(), CoverageError> {
    let estimator = &design.controller.estimator;
    let units = design.signals.scaling();
    let threshold = |&value: &f64| value > 0.0 && value <= LARGEST;
    all(&[
        (estimator.thresholds.iter().all(threshold), "a threshold"),
        (
            estimator.leverage_limit == LEVERAGE_LIMIT,
            "the limit of the leverage",
        ),
        (
            estimator.tuning == Tuning::default(),
            "a tuning constant of the estimator",
        ),
        (
            estimator
                .predictors
                .iter()
                .all(|predictor| plausible(predictor, &units)),
            "a predictor",
        ),
        (
            transfers_fit(design, estimator, &units.outputs),
            "a transfer of harmonics",
        ),
        (hypotheses_fit(design), "a size or rate of the estimator"),
    ])
}

/// The sizes and rates of the state-based estimator follow from the plant, the signals, and what
/// the user may choose: model error, fault rate and length, authority, loads, policy, mode length, disturbance;
/// what logs say (matrices, noise) is theirs.
fn hypotheses_fit(design: &Design) -> bool {
    let estimator = &design.controller.estimator;
    let Some(found) = &estimator.hypotheses else {
        return estimator.method != EstimatorMethod::Observer;
    };
    let plant = &design.plant;
    let spec = HypothesesSpec {
        model_error: found.model_error,
        fault_rate: found.fault_rate,
        fault_length: 1.0 / found.release_rate,
        ambiguous: found.ambiguous,
        mode_length: found.mode_rate.map(f64::recip),
        authority: Some(found.authority.clone()),
        input_load: Some(found.input_load.clone()),
    };
    let known = found.period.map(|known| KnownDisturbance {
        period: known.seconds,
        harmonics: known.harmonics,
        amplitude: Some(found.disturbance_load.clone()),
    });
    let noise = derived::sensor_noise(&design.scenario.noise, &estimator.thresholds);
    let tracked = &design.controller.feedback.tracked;
    let reach = hypotheses::reach(plant, &design.signals, tracked, &design.scenario);
    let mut derived = spec.settings(plant, &design.signals, noise, &reach, known.as_ref());
    // What a reference moves at rest comes of a factorisation, which another machine rounds otherwise.
    let mut sizes = found.fault_size.iter().zip(&derived.fault_size);
    if found.fault_size.len() == derived.fault_size.len()
        && sizes.all(|(found, derived)| (found - derived).abs() <= TOLERANCE * derived)
    {
        derived.fault_size.clone_from(&found.fault_size);
    }
    derived.release_rate = found.release_rate;
    derived.mode_rate = found.mode_rate;
    if !found.fitted.is_empty() {
        derived.fitted.clone_from(&found.fitted);
        derived.noise.clone_from(&found.noise);
    }
    // As a rate, since a length that is one over it has been rounded once more.
    let [shortest, longest] = [LENGTHS.start(), LENGTHS.end()];
    let length = |rate: f64| (1.0 / longest..=1.0 / shortest).contains(&rate);
    let positive = |&noise: &f64| noise > 0.0 && noise <= LARGEST;
    let chosen = found.noise.iter().all(positive)
        && MODEL_ERRORS.contains(&found.model_error)
        && FAULT_RATES.contains(&found.fault_rate)
        && length(found.release_rate)
        && found.mode_rate.is_none_or(length);
    chosen && derived == *found
}

/// Of a size that its signals can have, a regular triangular factor, deviations that are none or positive.
fn plausible(predictor: &Predictor, units: &Scaling) -> bool {
    let inputs = units.inputs.iter().copied().cycle();
    let past: Vec<f64> = inputs.take(predictor.factor.shape().1).collect();
    let rows = vec![1.0; past.len()];
    let inverse: Vec<f64> = past.iter().map(|unit| 1.0 / unit).collect();
    let factor = scaled(&dense(&predictor.factor), &rows, &inverse);
    let response = scaled(&dense(&predictor.response), &units.outputs, &past);
    let deviations = predictor.deviation.iter().zip(&units.outputs);
    let regular = (0..factor.nrows()).all(|k| factor[(k, k)] != 0.0);
    let triangular =
        (0..factor.ncols()).all(|c| (c + 1..factor.nrows()).all(|r| factor[(r, c)] == 0.0));
    let finite = |value: &f64| value.is_finite() && value.abs() < 1e12;
    regular
        && triangular
        && response.iter().chain(factor.iter()).all(finite)
        && deviations
            .into_iter()
            .all(|(d, unit)| (0.0..1e12).contains(&(d / unit)))
}

/// What a response learned in one mode tells of another follows from the plant.
fn transfers_fit(design: &Design, estimator: &Estimator, outputs: &[f64]) -> bool {
    let derived = match &estimator.harmonics {
        Some(known) if known.period > 0.0 && (1..=MOST_HARMONICS).contains(&known.count) => {
            harmonics::transfers(&design.plant, outputs, known.period, known.count)
        }
        Some(_) => return false,
        None => Vec::new(),
    };
    let maps = |transfers: &[Vec<Vec<ftc_control::parameters::PhasorMap>>]| {
        transfers
            .iter()
            .flatten()
            .flatten()
            .cloned()
            .collect::<Vec<_>>()
    };
    let (found, derived) = (maps(&estimator.harmonic_transfers), maps(&derived));
    found.len() == derived.len()
        && found.iter().zip(&derived).all(|(f, d)| {
            let part = |matrix| scaled(&dense(matrix), outputs, outputs);
            let [found, derived] = [f, d].map(|map| [part(&map.real), part(&map.imaginary)]);
            let largest = derived[0].amax().max(derived[1].amax());
            let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
                a.shape() == b.shape() && (a - b).amax() <= 1e-7 * largest
            };
            near(&found[0], &derived[0]) && near(&found[1], &derived[1])
        })
}

/// Figures that are reported beside the claims agree with the gains.
fn check_report(control: &StateFeedback, observer: &ObserverDesign) -> Result<(), CoverageError> {
    let bounded = |radii: &[f64], decay: f64| {
        radii
            .iter()
            .all(|r| (0.0..=decay * (1.0 + 1e-9)).contains(r))
    };
    let optimum = match (&control.optimum, &control.gamma) {
        (Some(optimum), Some(gamma)) => {
            optimum.len() == gamma.len()
                && optimum
                    .iter()
                    .zip(gamma)
                    .all(|(o, g)| (0.0..=g * (1.0 + 1e-3)).contains(o))
        }
        (None, None) => true,
        _ => false,
    };
    all(&[
        (
            bounded(&control.spectral_radius, control.spec.decay)
                && bounded(&observer.spectral_radius, observer.spec.decay),
            "a reported spectral radius",
        ),
        (optimum, "the reported optimum of gamma"),
    ])
}
