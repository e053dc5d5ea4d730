//! Whether every part of a controller has the size that the others ask for, and finite numbers.

use crate::error::ControllerError;
use crate::estimator::hypotheses::{MOST_MODES, Sensors};
use crate::kernel::LARGEST;
use crate::matrix::{Matrix, all_finite};
use crate::parameters::{
    ControllerParameters, Estimator, EstimatorMethod, Harmonics, Hypotheses, LONGEST_LATENCY,
    Limits, MOST_HARMONICS, Observer, Predictor, StateFeedback,
};
use alloc::format;
use alloc::string::{String, ToString};

type Checked = Result<(), ControllerError>;

/// Numbers of states `n`, inputs `m`, outputs `p` and modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sizes {
    pub states: usize,
    pub inputs: usize,
    pub outputs: usize,
    pub disturbances: usize,
    pub modes: usize,
}

fn length(field: impl Into<String>, found: usize, needed: usize) -> Checked {
    match found == needed {
        true => Ok(()),
        false => Err(ControllerError::Length {
            field: field.into(),
            found,
            needed,
        }),
    }
}

fn finite(field: impl Into<String>, values: &[f64]) -> Checked {
    match all_finite(values) {
        true => Ok(()),
        false => Err(ControllerError::NotFinite {
            field: field.into(),
        }),
    }
}

fn vector(field: &str, values: &[f64], needed: usize) -> Checked {
    length(field, values.len(), needed)?;
    finite(field, values)
}

fn shape(field: String, matrix: &Matrix, needed: (usize, usize)) -> Checked {
    if matrix.shape() != needed {
        return Err(ControllerError::Shape {
            field,
            found: matrix.shape(),
            needed,
        });
    }
    finite(field, matrix.as_slice())
}

fn range(holds: bool, field: impl Into<String>, rule: impl ToString) -> Checked {
    match holds {
        true => Ok(()),
        false => Err(ControllerError::Range {
            field: field.into(),
            rule: rule.to_string(),
        }),
    }
}

/// Checks everything, and returns the sizes that all parts agree on.
pub(crate) fn check(parameters: &ControllerParameters) -> Result<Sizes, ControllerError> {
    let sizes = modes(parameters)?;
    feedback(&parameters.feedback, sizes)?;
    observer(&parameters.observer, sizes)?;
    estimator(&parameters.estimator, sizes)?;
    length("input_limits", parameters.input_limits.len(), sizes.inputs)?;
    for (index, limit) in parameters.input_limits.iter().enumerate() {
        range(
            ordered(limit),
            format!("input_limits[{index}]"),
            "must have numbers, min not above max",
        )?;
    }
    Ok(sizes)
}

fn ordered(limit: &Limits) -> bool {
    let (min, max) = (
        limit.min.unwrap_or(f64::NEG_INFINITY),
        limit.max.unwrap_or(f64::INFINITY),
    );
    min <= max
}

/// The plant's modes: all of the sizes of the first.
fn modes(parameters: &ControllerParameters) -> Result<Sizes, ControllerError> {
    let te = parameters.sample_time;
    range(
        te.is_finite() && te > 0.0,
        "sample_time",
        "must be a positive number of seconds",
    )?;
    let Some(first) = parameters.modes.first() else {
        return Err(ControllerError::Range {
            field: "modes".into(),
            rule: "must hold at least one mode".into(),
        });
    };
    let (n, m, p) = (first.a.nrows(), first.b.ncols(), first.c.nrows());
    let s = first.e.ncols();
    range(
        n > 0 && m > 0 && p > 0,
        "modes[0]",
        "must have at least one state, input and output",
    )?;
    for (index, mode) in parameters.modes.iter().enumerate() {
        let field = |name: &str| format!("modes[{index}].{name}");
        shape(field("a"), &mode.a, (n, n))?;
        shape(field("b"), &mode.b, (n, m))?;
        shape(field("c"), &mode.c, (p, n))?;
        shape(field("e"), &mode.e, (n, s))?;
        shape(field("f"), &mode.f, (p, s))?;
        vector(&field("x0"), &mode.x0, n)?;
        vector(&field("u0"), &mode.u0, m)?;
        vector(&field("y0"), &mode.y0, p)?;
    }
    Ok(Sizes {
        states: n,
        inputs: m,
        outputs: p,
        disturbances: s,
        modes: parameters.modes.len(),
    })
}

fn feedback(feedback: &StateFeedback, sizes: Sizes) -> Checked {
    let (n, m, p) = (sizes.states, sizes.inputs, sizes.outputs);
    let (r, q) = (feedback.tracked.len(), feedback.integral_size());
    range(
        feedback.tracked.iter().all(|&row| row < p),
        "feedback.tracked",
        "must name outputs of the plant",
    )?;
    range(
        feedback.latency <= LONGEST_LATENCY,
        "feedback.latency",
        format_args!("must be 0 to {LONGEST_LATENCY} samples"),
    )?;
    finite("feedback.resonators", &feedback.resonators)?;
    length("feedback.modes", feedback.modes.len(), sizes.modes)?;
    let directly = if feedback.has_feedforward() { r } else { 0 };
    for (index, gains) in feedback.modes.iter().enumerate() {
        let field = |name: &str| format!("feedback.modes[{index}].{name}");
        let acting = feedback.latency * m;
        shape(field("state_feedback"), &gains.state_feedback, (m, n))?;
        shape(field("integral"), &gains.integral, (m, q))?;
        shape(field("feedforward"), &gains.feedforward, (m, directly))?;
        shape(field("previous_input"), &gains.previous_input, (m, acting))?;
        shape(field("anti_windup"), &gains.anti_windup, (q, m))?;
        shape(field("output_feedback"), &gains.output_feedback, (m, p))?;
    }
    Ok(())
}

fn observer(observer: &Observer, sizes: Sizes) -> Checked {
    let gain = (sizes.states, sizes.outputs);
    length("observer.gains", observer.gains.len(), sizes.modes)?;
    for (index, matrix) in observer.gains.iter().enumerate() {
        shape(format!("observer.gains[{index}]"), matrix, gain)?;
    }
    length(
        "observer.decoupling",
        observer.decoupling.len(),
        sizes.modes,
    )?;
    for (from, row) in observer.decoupling.iter().enumerate() {
        length(
            format!("observer.decoupling[{from}]"),
            row.len(),
            sizes.modes,
        )?;
        for (to, matrix) in row.iter().enumerate() {
            shape(format!("observer.decoupling[{from}][{to}]"), matrix, gain)?;
        }
    }
    for (index, set) in observer.lost.iter().enumerate() {
        let field = format!("observer.lost[{index}]");
        range(
            set.sensors.iter().all(|&sensor| sensor < sizes.outputs),
            format!("{field}.sensors"),
            "must name outputs of the plant",
        )?;
        length(
            format!("{field}.correction"),
            set.correction.len(),
            sizes.modes,
        )?;
        for matrix in &set.correction {
            shape(format!("{field}.correction"), matrix, gain)?;
        }
    }
    Ok(())
}

/// Longest response and longest window, in samples.
const LONGEST: usize = 100_000;

/// Most numbers in a window: its length times inputs times response length.
const LARGEST_WINDOW: usize = 10_000_000;

/// Most states that the hypotheses of the state-based method estimate together.
const LARGEST_JOINT_STATE: usize = 1000;

impl Estimator {
    /// Whether the numbers that say how much memory a state takes are practical, so that no
    /// number alone asks for more memory than there is; for a plant with this many `inputs`.
    ///
    /// # Errors
    /// The field that is too large.
    pub fn check_memory(&self, inputs: usize) -> Result<(), ControllerError> {
        let window = self.window.saturating_mul(inputs);
        let learned = self.harmonics.as_ref().map_or(0, |known| known.count);
        let estimated = self.hypotheses.as_ref().map_or(0, Hypotheses::harmonics);
        for (field, found, most, of) in [
            (
                "estimator.response_length",
                self.response_length,
                LONGEST,
                " samples",
            ),
            ("estimator.window", self.window, LONGEST, " samples"),
            (
                "estimator.window",
                window.saturating_mul(self.response_length),
                LARGEST_WINDOW,
                " numbers: its length times inputs times response length",
            ),
            ("estimator.harmonics.count", learned, MOST_HARMONICS, ""),
            (
                "estimator.hypotheses.period.harmonics",
                estimated,
                MOST_HARMONICS,
                "",
            ),
        ] {
            range(
                found <= most,
                field,
                format_args!("must be at most {most}{of}"),
            )?;
        }
        Ok(())
    }
}

fn estimator(estimator: &Estimator, sizes: Sizes) -> Checked {
    let p = sizes.outputs;
    estimator.check_memory(sizes.inputs)?;
    if let Some((part, name, bounds)) = estimator.tuning.beyond_bounds() {
        let [least, most] = bounds;
        return Err(ControllerError::Bounds {
            field: format!("estimator.tuning.{part}.{name}"),
            least,
            most,
        });
    }
    vector("estimator.thresholds", &estimator.thresholds, p)?;
    vector("estimator.largest_fault", &estimator.largest_fault, p)?;
    range(
        estimator.largest_fault.iter().all(|&fault| fault >= 0.0),
        "estimator.largest_fault",
        "must not be negative",
    )?;
    range(
        !estimator.leverage_limit.is_nan(),
        "estimator.leverage_limit",
        "must be a number",
    )?;
    if estimator.method == EstimatorMethod::Reference {
        length(
            "estimator.predictors",
            estimator.predictors.len(),
            sizes.modes,
        )?;
    }
    for (index, predictor) in estimator.predictors.iter().enumerate() {
        let regressors = sizes.inputs.saturating_mul(estimator.response_length);
        self::predictor(predictor, index, p, regressors)?;
    }
    match (estimator.method, &estimator.hypotheses) {
        (EstimatorMethod::Observer, Some(settings)) => hypotheses(settings, sizes)?,
        (method, _) => range(
            method != EstimatorMethod::Observer,
            "estimator.hypotheses",
            "must be there for the state-based method",
        )?,
    }
    match &estimator.harmonics {
        Some(known) => harmonics(known, estimator, sizes),
        None => Ok(()),
    }
}

/// Largest size of anything physical, and largest share or logarithm.
const LARGEST_SIZE: f64 = 1e50;
const LARGEST_SHARE: f64 = 1e6;

/// Ends of the range of rates per sample: their logarithms are finite.
const SMALLEST_RATE: f64 = 1.0 / LARGEST;
const LARGEST_RATE: f64 = 0.999;

fn hypotheses(settings: &Hypotheses, sizes: Sizes) -> Checked {
    let (n, m, p) = (sizes.states, sizes.inputs, sizes.outputs);
    let s = sizes.disturbances;
    let harmonics = settings.harmonics();
    let positive = |seconds: f64| seconds.is_finite() && seconds > 0.0;
    range(
        settings.period.is_none_or(|known| positive(known.seconds)),
        "estimator.hypotheses.period.seconds",
        "must be a positive number of seconds",
    )?;
    let waves = (2 * s).saturating_mul(harmonics);
    range(
        waves.saturating_add(2 * n + m + p) <= LARGEST_JOINT_STATE,
        "estimator.hypotheses",
        format_args!(
            "must estimate at most {LARGEST_JOINT_STATE} states together: twice the plant's, inputs, outputs and waves"
        ),
    )?;
    for (what, values, needed) in [
        ("noise", &settings.noise, p),
        ("fault_size", &settings.fault_size, p),
        ("authority", &settings.authority, p),
        ("input_load", &settings.input_load, m),
        ("disturbance_load", &settings.disturbance_load, s),
        ("disturbance_walk", &settings.disturbance_walk, s),
        ("disturbance_size", &settings.disturbance_size, waves),
        ("state_load", &settings.state_load, n),
        ("state_size", &settings.state_size, n),
        ("start", &settings.start, n),
        ("start_elsewhere", &settings.start_elsewhere, n),
    ] {
        let field = format!("estimator.hypotheses.{what}");
        length(field.as_str(), values.len(), needed)?;
        let sensible = values
            .iter()
            .all(|value| (0.0..=LARGEST_SIZE).contains(value));
        range(
            sensible,
            field,
            format_args!("must hold numbers from 0 to {LARGEST_SIZE:e}"),
        )?;
    }
    range(
        p <= Sensors::BITS as usize,
        "estimator.method",
        format_args!("observes at most {} outputs", Sensors::BITS),
    )?;
    fitted_modes(settings, sizes)?;
    range(
        settings.mode_rate.is_none() || sizes.modes <= MOST_MODES,
        "estimator.hypotheses.mode_rate",
        format_args!("finds the mode of at most {MOST_MODES} modes"),
    )?;
    rates_and_shares(settings)
}

/// Matrices fitted to a log, of every mode or of none.
fn fitted_modes(settings: &Hypotheses, sizes: Sizes) -> Checked {
    let (n, m, p) = (sizes.states, sizes.inputs, sizes.outputs);
    let s = sizes.disturbances;
    if !settings.fitted.is_empty() {
        length(
            "estimator.hypotheses.fitted",
            settings.fitted.len(),
            sizes.modes,
        )?;
    }
    for (index, fitted) in settings.fitted.iter().enumerate() {
        let field = |name: &str| format!("estimator.hypotheses.fitted[{index}].{name}");
        shape(field("a"), &fitted.a, (n, n))?;
        shape(field("b"), &fitted.b, (n, m))?;
        shape(field("c"), &fitted.c, (p, n))?;
        shape(field("e"), &fitted.e, (n, s))?;
        shape(field("f"), &fitted.f, (p, s))?;
    }
    Ok(())
}

fn rates_and_shares(settings: &Hypotheses) -> Checked {
    let rates = [
        settings.mode_rate.unwrap_or(settings.load_rate),
        settings.fault_rate,
        settings.stuck_rate,
        settings.release_rate,
        settings.change_rate,
        settings.load_rate,
    ];
    let sensible = |rate: &f64| (SMALLEST_RATE..=LARGEST_RATE).contains(rate);
    range(
        rates.iter().all(sensible),
        "estimator.hypotheses",
        format_args!("must have rates from {SMALLEST_RATE:e} to {LARGEST_RATE}"),
    )?;
    let shares = [
        settings.changed_error,
        settings.odds,
        settings.fault_walk,
        settings.drift_walk,
        settings.load_walk,
        settings.model_error,
        settings.gain_error,
        settings.gain_walk,
        settings.period_error,
    ];
    let sensible = shares
        .iter()
        .all(|share| (0.0..=LARGEST_SHARE).contains(share));
    range(
        sensible,
        "estimator.hypotheses",
        format_args!("must have shares from 0 to {LARGEST_SHARE:e}"),
    )
}

fn predictor(predictor: &Predictor, index: usize, outputs: usize, regressors: usize) -> Checked {
    let field = |name: &str| format!("estimator.predictors[{index}].{name}");
    shape(
        field("response"),
        &predictor.response,
        (outputs, regressors),
    )?;
    shape(field("factor"), &predictor.factor, (regressors, regressors))?;
    vector(&field("deviation"), &predictor.deviation, outputs)
}

fn harmonics(known: &Harmonics, estimator: &Estimator, sizes: Sizes) -> Checked {
    range(
        known.period.is_finite() && known.period > 0.0,
        "estimator.harmonics.period",
        "must be a positive number of samples",
    )?;
    finite(
        "estimator.harmonics",
        &[known.memory, known.initial_variance],
    )?;
    let transfers = &estimator.harmonic_transfers;
    if transfers.is_empty() {
        return Ok(());
    }
    length("estimator.harmonic_transfers", transfers.len(), sizes.modes)?;
    for (from, row) in transfers.iter().enumerate() {
        let field = format!("estimator.harmonic_transfers[{from}]");
        length(field.as_str(), row.len(), sizes.modes)?;
        for (to, maps) in row.iter().enumerate() {
            length(format!("{field}[{to}]"), maps.len(), known.count)?;
            for map in maps {
                let needed = (sizes.outputs, sizes.outputs);
                shape(format!("{field}[{to}].real"), &map.real, needed)?;
                shape(format!("{field}[{to}].imaginary"), &map.imaginary, needed)?;
            }
        }
    }
    Ok(())
}
