//! The library's verdicts in the words of a design file: what to change is named by its key.
//!
//! Sentences in which nothing of a design file is named are the library's own.

mod experiment;

pub(crate) use experiment::{of_deviation, of_disturbance, of_scenario, of_waveform};

use crate::check::ValueError;
use crate::complaint::{Complaint, Key};
use crate::sentence::shorten;
use crate::values::NameOrList;
use ftc_control::estimator::hypotheses::MOST_MODES;
use ftc_design::commissioning::{CommissioningError, LONGEST_RESPONSE};
use ftc_design::spec::{LARGEST, LONGEST_LATENCY};
use ftc_design::work::{MOST_BYTES, TooLarge};
use ftc_design::{
    Advice, DecayRate, DesignError, EstimatorNumber, Infeasibility, Lyapunov, RequestError,
    SolverFailure, SpecError, Uncertified, Uncontrollable, Weight, words,
};
use ftc_plant::PlantError;
use ftc_plant::rectifier::RectifierError;

/// Why there is no design, and which keys to change.
///
/// ```
/// use design_file::wording;
/// use ftc_design::{Advice, Lyapunov};
///
/// let advice = Advice::LyapunovAndDecay(Lyapunov::Dwell, 0.98);
/// let said = wording::of_advice(&advice);
/// assert!(said.ends_with("controller.lyapunov = \"dwell\", controller.decay = 0.98"));
/// ```
pub fn of_error(error: &DesignError) -> String {
    match error {
        DesignError::Request(error) => of_request(error, None).to_string(),
        DesignError::Infeasible(error) => of_infeasibility(error),
        DesignError::Uncertified(error) => of_uncertified(error),
        DesignError::Solver(error) => match solver_remedy(*error) {
            Some(remedy) => format!("the solver gave no solution: {remedy}"),
            None => DesignError::Solver(*error).to_string(),
        },
        other => other.to_string(),
    }
}

/// A change that works, as keys with their values.
pub fn of_advice(advice: &Advice) -> String {
    match advice {
        Advice::Decay(decay) => format!("a slower decay is feasible: controller.decay = {decay}"),
        Advice::Lyapunov(kind) => {
            format!("another guarantee is feasible: controller.lyapunov = \"{kind}\"")
        }
        Advice::LyapunovAndDecay(kind, decay) => format!(
            "another guarantee with a slower decay is feasible: controller.lyapunov = \"{kind}\", \
             controller.decay = {decay}"
        ),
        Advice::Tracked(outputs) => {
            let numbers: Vec<String> = outputs.iter().map(|o| (o + 1).to_string()).collect();
            format!(
                "tracking fewer outputs is feasible: controller.tracked = [{}]",
                numbers.join(", ")
            )
        }
        Advice::ObserverDecay(decay) => {
            format!("a slower decay of the observer is feasible: observer.decay = {decay}")
        }
        // An observer has the guarantee of its controller.
        Advice::ObserverLyapunov(kind) => format!(
            "another guarantee is feasible for the observer: controller.lyapunov = \"{kind}\""
        ),
        Advice::Harmonics(0) => {
            "integral action alone is feasible: controller.internal_model = false".into()
        }
        Advice::Harmonics(count) => format!(
            "an internal model of fewer harmonics is feasible: disturbance.harmonics = {count}"
        ),
        other => other.to_string(),
    }
}

/// What is wrong with a request, and which keys to change. `logs` are those that the design file names.
pub fn of_request(error: &RequestError, logs: Option<&NameOrList>) -> Complaint {
    let of_log = |mode: usize, what: &str| {
        let log = logs.map_or("", |logs| logs.of_mode(mode - 1));
        Complaint::of(
            "estimator.database",
            format!(": {}: mode {mode}: {what}", shorten(log)),
        )
    };
    match error {
        RequestError::Plant(error) => of_plant(error),
        RequestError::Spec(error) => of_spec(error),
        RequestError::Disturbance(error) => of_disturbance(error),
        RequestError::Scenario(error) => of_scenario(error),
        RequestError::Deviation(error) => of_deviation(error),
        RequestError::Uncontrollable(error) => of_uncontrollable(error),
        RequestError::TooLarge(error) => of_too_large(error),
        RequestError::Commissioning(error) => of_commissioning(error),
        RequestError::Database { mode, error } => match logs {
            Some(_) => of_log(*mode, &of_database(error)),
            None => of_commissioning(error).inside(in_mode(*mode)),
        },
        RequestError::ResponseLength {
            length,
            inputs,
            most,
        } => Complaint::of(
            "estimator.response_length",
            format!(
                "is {length} samples, but with {} it must lie between 1 and {most}: set another, or choose a longer \
                 sample_time",
                words::counted(*inputs, "input", "inputs")
            ),
        ),
        RequestError::ShortLog { mode, needed } => of_log(
            *mode,
            &format!(
                "there are fewer than {} samples of this mode in stretches of at least {needed} without a gap: record \
                 more of it",
                4 * needed
            ),
        ),
        RequestError::LateLog { mode } => of_log(
            *mode,
            "the inputs act one sample after the row they stand in: move them down by one row, or log what the plant is \
             given, not the command",
        ),
        RequestError::LongLog {
            mode,
            samples,
            most,
        } => of_log(
            *mode,
            &format!(
                "there are {samples} samples, more than are needed: shorten it to at most {most}"
            ),
        ),
        RequestError::Excitation {
            mode,
            input,
            name,
            lag,
            ratio,
        } => of_log(
            *mode,
            &format!(
                "input {input} ({name}) is excited too little {} back (1 : {:.0e} of the strongest direction): record a \
                 run in which every input moves on its own",
                words::counted(*lag, "sample", "samples"),
                1.0 / ratio.max(f64::MIN_POSITIVE)
            ),
        ),
        RequestError::OperatingInput {
            mode,
            input,
            value,
            min,
            max,
        } => Complaint::of(
            in_mode(*mode).then("operating_point.u"),
            format!(
                "has {value} at input {input}, which signals.inputs[{input}] limits to {}: give a point within the \
                 limits, or other limits",
                words::interval(*min, *max)
            ),
        ),
        RequestError::Bumpless => Complaint::of(
            "controller.bumpless",
            "= true cannot be proved for this design: set it to false, set another controller.decay, or \
             controller.lyapunov = \"dwell\"",
        ),
        RequestError::HiddenDisturbance {
            mode,
            successor,
            seen,
            wanted,
        } => Complaint::of(
            "observer.kind",
            format!(
                "= \"uio\" has no solution for mode {mode}{}: rank(C E) = {seen}, but rank(E) = {wanted}, so part of the \
                 disturbance does not show in the outputs at once: set observer.kind = \"luenberger\" or \"auto\", or use more \
                 sensors",
                words::entering(*mode, *successor)
            ),
        ),
        RequestError::NoDisturbance => Complaint::of(
            "observer.kind",
            "= \"uio\" needs a disturbance on the state (E), but there is none: set it to \"luenberger\" or \"auto\"",
        ),
        RequestError::Undetectable {
            mode,
            decay,
            magnitude,
            decoupled,
        } => of_undetectable(*mode, *decay, *magnitude, *decoupled),
        other => Complaint::general(other.to_string()),
    }
}

/// The key of a mode that counts from 1.
fn in_mode(number: usize) -> Key {
    Key::mode(number.saturating_sub(1))
}

/// What is wrong with a plant.
pub(crate) fn of_plant(error: &PlantError) -> Complaint {
    match error {
        PlantError::SampleTime(error) => Complaint::of("sample_time", error),
        PlantError::Empty(what) => Complaint::of(
            in_mode(1),
            format!(": there are no {what}: give at least one"),
        ),
        PlantError::Shape { matrix, .. } => {
            Complaint::of(in_mode(1).then(*matrix), error.misfit().unwrap_or_default())
        }
        PlantError::OtherShape { mode, matrix, .. } => Complaint::of(
            in_mode(*mode).then(*matrix),
            error.misfit().unwrap_or_default(),
        ),
        PlantError::OperatingPointLength {
            mode,
            part,
            found,
            needed,
        } => Complaint::of(
            in_mode(*mode).then("operating_point").then(*part),
            format!(
                "has {}: give the {needed} that the plant needs",
                words::counted(*found, "entry", "entries")
            ),
        ),
        PlantError::OperatingPointNotFinite { mode, part } => Complaint::of(
            in_mode(*mode).then("operating_point").then(*part),
            "is not finite: give numbers",
        ),
        other => Complaint::general(other.to_string()),
    }
}

/// Why a rectifier has no operating point.
pub(crate) fn of_rectifier(error: &RectifierError) -> Complaint {
    match error {
        RectifierError::DcVoltage { given, diodes } => Complaint::of(
            "plant.dc_voltage",
            format!(
                "is {given} V, but the diodes hold the link at sqrt(3) times plant.phase_voltage, {diodes:.1} V: give a \
                 dc_voltage above it"
            ),
        ),
        RectifierError::Overload {
            mode,
            power,
            resistance,
        } => Complaint::of(
            Key::from("plant.loads").entry(mode - 1),
            format!(
                "is too small: in mode {mode} the grid cannot supply {power:.0} W through plant.resistance = \
                 {resistance} ohm: raise the load resistance"
            ),
        ),
        other => Complaint::of("plant", format!(": {other}")),
    }
}

fn of_infeasibility(error: &Infeasibility) -> String {
    let help = match error.advice.is_empty() {
        true => "none of the usual changes (controller.decay nearer to 1, controller.lyapunov = \"dwell\", fewer \
                 outputs in controller.tracked) helps"
            .into(),
        false => all(&error.advice),
    };
    format!("{}; {help}", error.conflict())
}

fn of_uncertified(error: &Uncertified) -> String {
    let help = match error.advice.is_empty() {
        true => "give nominal values in [signals], or set another controller.decay".into(),
        false => all(&error.advice),
    };
    format!(
        "the design could not be certified: {}; {help}",
        error.reason
    )
}

fn all(advice: &[Advice]) -> String {
    let advice: Vec<String> = advice.iter().map(of_advice).collect();
    advice.join("; ")
}

fn solver_remedy(error: SolverFailure) -> Option<&'static str> {
    Some(match error {
        SolverFailure::Unbounded => {
            "it found the objective unbounded: give every input a weight above 0 in controller.input_weight"
        }
        SolverFailure::TooManyIterations => {
            "it did not finish within its iteration limit: give nominal values in [signals]"
        }
        SolverFailure::NumericalTrouble => {
            "its numbers broke down: give nominal values in [signals]"
        }
        _ => return None,
    })
}

/// What is wrong with what is asked of controller or observer.
pub(crate) fn of_spec(error: &SpecError) -> Complaint {
    match error {
        SpecError::NothingTracked => Complaint::of(
            "controller.tracked",
            "is empty: name at least one output, by its name or its number from 1",
        ),
        SpecError::TooFewInputs { tracked, inputs } => Complaint::of(
            "controller.tracked",
            format!(
                "names {}, but the plant has {}: track at most as many outputs as there are inputs",
                words::counted(*tracked, "output", "outputs"),
                words::counted(*inputs, "input", "inputs")
            ),
        ),
        SpecError::UnknownOutput { output, outputs } => Complaint::of(
            "controller.tracked",
            format!("names output {output}, but the plant has {outputs}: name one that it has"),
        ),
        SpecError::TrackedTwice(output) => Complaint::of(
            "controller.tracked",
            format!("names output {output} twice: name each output once"),
        ),
        SpecError::Latency(latency) => Complaint::of(
            "controller.latency",
            ValueError::Count {
                value: i64::try_from(*latency).unwrap_or(i64::MAX),
                least: 0,
                most: LONGEST_LATENCY,
            },
        ),
        SpecError::Decay { of, decay } => Complaint::of(
            decay_key(*of),
            format!("is {decay}: give a number above 0 and at most 1"),
        ),
        SpecError::NoDwellTime(of) => Complaint::of(
            decay_key(*of),
            "= 1 gives no finite dwell time: give a number below 1",
        ),
        SpecError::Harmonic {
            harmonic,
            samples,
            shortest,
            longest,
        } => {
            let fewer = match harmonic - 1 {
                0 => String::new(),
                count => format!(", set disturbance.harmonics = {count}"),
            };
            Complaint::of(
                "controller.internal_model",
                format!(
                    "= true cannot hold harmonic {harmonic} of the disturbance, whose period is {samples:.6} samples: \
                     choose a sample_time at which it lies between {shortest:.4} and {longest:.0} samples{fewer}, or set controller.internal_model = false"
                ),
            )
        }
        SpecError::WeightCount {
            weight,
            found,
            needed,
        } => Complaint::of(
            weight_key(*weight),
            ValueError::Entries {
                found: *found,
                needed: *needed,
            },
        ),
        SpecError::Weight { weight, value } => Complaint::of(
            weight_key(*weight),
            format!("has the value {value}: give 0 or a positive number up to {LARGEST:e}"),
        ),
        SpecError::EstimatorSize { of, error } => Complaint::of(estimator_key(*of), error),
        SpecError::EstimatorCount { of, found, needed } => Complaint::of(
            estimator_key(*of),
            ValueError::Entries {
                found: *found,
                needed: *needed,
            },
        ),
        SpecError::TooManyModes(modes) => Complaint::of(
            "estimator.mode",
            format!(
                "= \"estimated\" finds one of at most {MOST_MODES} modes, but the plant has {modes}: tell the mode"
            ),
        ),
        SpecError::Estimator {
            of,
            value,
            least,
            most,
        } => Complaint::of(
            estimator_key(*of),
            ValueError::Range {
                value: *value,
                least: *least,
                most: *most,
            },
        ),
        other => Complaint::general(other.to_string()),
    }
}

fn estimator_key(of: EstimatorNumber) -> &'static str {
    match of {
        EstimatorNumber::ModelError => "estimator.model_error",
        EstimatorNumber::FaultRate => "estimator.fault_rate",
        EstimatorNumber::FaultLength => "estimator.fault_length",
        EstimatorNumber::ModeLength => "estimator.mode_length",
        EstimatorNumber::Authority => "estimator.authority",
        EstimatorNumber::InputLoad => "estimator.input_load",
        EstimatorNumber::Threshold => "estimator.threshold",
        EstimatorNumber::Sigmas => "estimator.sigmas",
        EstimatorNumber::Debounce => "estimator.debounce",
        EstimatorNumber::StuckAfter => "estimator.stuck_after",
        _ => "estimator",
    }
}

fn decay_key(of: DecayRate) -> &'static str {
    match of {
        DecayRate::Observer => "observer.decay",
        _ => "controller.decay",
    }
}

/// The key of a weight.
pub fn weight_key(weight: Weight) -> &'static str {
    match weight {
        Weight::Output => "controller.output_weight",
        Weight::Integral => "controller.integral_weight",
        _ => "controller.input_weight",
    }
}

fn of_uncontrollable(error: &Uncontrollable) -> Complaint {
    match error {
        Uncontrollable::Eigenvalue {
            mode,
            eigenvalue,
            decay,
        } => {
            let magnitude = eigenvalue.norm();
            let slower = match words::least_decay(magnitude) {
                above if above < 1.0 => format!(", or set controller.decay above {above:.4}"),
                _ => String::new(),
            };
            Complaint::of(
                in_mode(*mode),
                format!(
                    ": (A, B) is uncontrollable: no input moves its eigenvalue {} of magnitude {magnitude:.4}, which \
                     decays more slowly than controller.decay = {decay}: add an input{slower}",
                    words::eigenvalue(*eigenvalue)
                ),
            )
        }
        Uncontrollable::Tracked { mode } => Complaint::of(
            in_mode(*mode),
            ": (A, B) cannot hold the tracked outputs at arbitrary values, the pair with integral action is \
             uncontrollable: track fewer outputs in controller.tracked, or outputs on which the inputs act independently",
        ),
        Uncontrollable::Harmonic { mode, harmonic } => Complaint::of(
            in_mode(*mode),
            format!(
                ": the inputs cannot move the tracked outputs at harmonic {harmonic} of the disturbance, so no internal \
                 model can reject it: set fewer disturbance.harmonics, track fewer outputs in controller.tracked, or set \
                 controller.internal_model = false"
            ),
        ),
        other => Complaint::general(other.to_string()),
    }
}

fn of_too_large(error: &TooLarge) -> Complaint {
    let one_at_a_time = match error.lyapunov {
        Lyapunov::Dwell => "",
        Lyapunov::Common | Lyapunov::Switched => {
            ", or set controller.lyapunov = \"dwell\", which solves one mode at a time"
        }
    };
    Complaint::general(format!(
        "the inequalities of this design would take about {:.0} GB of memory and {}, but at most {:.0} GB are taken: \
         reduce the number of states, inputs or modes{one_at_a_time}",
        error.work.bytes / 1e9,
        error.work.time(),
        MOST_BYTES / 1e9
    ))
}

fn of_commissioning(error: &CommissioningError) -> Complaint {
    match error {
        CommissioningError::Unstable { mode, radius } => Complaint::of(
            in_mode(*mode).then("A"),
            format!(
                "has spectral radius {radius:.4}, but the estimator needs a stable mode (below 1): set \
                 estimator.method = \"observer\""
            ),
        ),
        CommissioningError::SlowResponse { mode, radius } => Complaint::of(
            in_mode(*mode).then("A"),
            format!(
                ": the response is still felt after {LONGEST_RESPONSE} samples (spectral radius {radius:.6}): set \
                 estimator.method = \"observer\", or choose a longer sample_time for this loop"
            ),
        ),
        other => Complaint::general(other.to_string()),
    }
}

/// Why the log of a mode gives no predictor.
fn of_database(error: &CommissioningError) -> String {
    match error {
        CommissioningError::TooFewSamples {
            samples,
            stretches,
            response_length,
            unknowns,
            needed,
        } => {
            let found = words::counted(*samples, "sample", "samples");
            let split = match stretches {
                0 | 1 => String::new(),
                count => format!(
                    " in {count} stretches, each of which spends its first {response_length} on the past,"
                ),
            };
            let few = if *samples == 1 { "is" } else { "are" };
            format!(
                "{found}{split} {few} too few to identify {unknowns} response coefficients: record at least {needed}, or \
                 set a shorter estimator.response_length than {response_length}"
            )
        }
        CommissioningError::NoExcitation => {
            "every input stays at its operating point, which excites nothing: record a run in which every input moves on \
             its own"
                .into()
        }
        other => other.to_string(),
    }
}

fn of_undetectable(mode: usize, decay: f64, magnitude: f64, decoupled: bool) -> Complaint {
    let (which, whose) = match decoupled {
        true => ("observer of this kind", "(C, T A)"),
        false => ("observer", "A"),
    };
    let help = match (words::least_decay(magnitude), decoupled) {
        (above, _) if above < 1.0 => format!("set observer.decay above {above:.4}"),
        (_, true) => "set observer.kind = \"auto\", or use more sensors".into(),
        (_, false) => {
            "no observer of any kind moves it: add a sensor that shows it, or take what grows out of the model if the \
             plant does not have it"
                .into()
        }
    };
    Complaint::of(
        "observer.decay",
        format!(
            "= {decay} is reached by no {which} in mode {mode}: {whose} has an eigenvalue of magnitude {magnitude:.4} \
             that the outputs do not show: {help}"
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    fn keys(said: &str, keys: &[&str]) {
        for key in keys {
            assert!(said.contains(key), "no {key} in: {said}");
        }
    }

    #[test]
    fn every_advice_is_a_key_with_its_value() {
        for (advice, key) in [
            (Advice::Decay(0.98), "controller.decay = 0.98"),
            (
                Advice::Lyapunov(Lyapunov::Dwell),
                "controller.lyapunov = \"dwell\"",
            ),
            (Advice::Tracked(vec![0, 2]), "controller.tracked = [1, 3]"),
            (Advice::ObserverDecay(0.9), "observer.decay = 0.9"),
            (
                Advice::ObserverLyapunov(Lyapunov::Switched),
                "controller.lyapunov = \"switched\"",
            ),
            (Advice::Harmonics(0), "controller.internal_model = false"),
            (Advice::Harmonics(2), "disturbance.harmonics = 2"),
        ] {
            keys(&of_advice(&advice), &[key]);
        }
    }

    #[test]
    fn what_is_wrong_with_a_request_names_the_keys_to_change() {
        let eigenvalue = Complex::new(0.97, 0.0);
        let errors: [(RequestError, &[&str]); 15] = [
            (RequestError::Bumpless, &["controller.bumpless = true"]),
            (RequestError::NoDisturbance, &["observer.kind = \"uio\""]),
            (
                RequestError::HiddenDisturbance {
                    mode: 1,
                    successor: 2,
                    seen: 0,
                    wanted: 1,
                },
                &["when mode 2 follows", "observer.kind = \"luenberger\""],
            ),
            (
                RequestError::ResponseLength {
                    length: 1500,
                    inputs: 2,
                    most: 1000,
                },
                &["estimator.response_length", "sample_time"],
            ),
            (
                RequestError::Undetectable {
                    mode: 1,
                    decay: 0.8,
                    magnitude: 0.95,
                    decoupled: false,
                },
                &["observer.decay = 0.8", "set observer.decay above 0.95"],
            ),
            (
                RequestError::Undetectable {
                    mode: 1,
                    decay: 0.8,
                    magnitude: 1.5,
                    decoupled: true,
                },
                &["set observer.kind = \"auto\""],
            ),
            (
                Uncontrollable::Eigenvalue {
                    mode: 1,
                    eigenvalue,
                    decay: 0.9,
                }
                .into(),
                &[
                    "eigenvalue 0.9700 of",
                    "controller.decay = 0.9:",
                    "set controller.decay above 0.97",
                ],
            ),
            (
                Uncontrollable::Tracked { mode: 2 }.into(),
                &["controller.tracked"],
            ),
            (
                Uncontrollable::Harmonic {
                    mode: 2,
                    harmonic: 1,
                }
                .into(),
                &["disturbance.harmonics", "controller.internal_model = false"],
            ),
            (
                CommissioningError::Unstable {
                    mode: 1,
                    radius: 1.1,
                }
                .into(),
                &["estimator.method = \"observer\""],
            ),
            (
                RequestError::Database {
                    mode: 1,
                    error: CommissioningError::NoExcitation,
                },
                &["mode 1: the database excites nothing"],
            ),
            (
                SpecError::Decay {
                    of: DecayRate::Observer,
                    decay: 2.0,
                }
                .into(),
                &["observer.decay is 2"],
            ),
            (
                SpecError::NoDwellTime(DecayRate::Feedback).into(),
                &["controller.decay = 1"],
            ),
            (
                SpecError::Weight {
                    weight: Weight::Integral,
                    value: -1.0,
                }
                .into(),
                &["controller.integral_weight has the value -1"],
            ),
            (
                SpecError::Harmonic {
                    harmonic: 3,
                    samples: 1.5,
                    shortest: 2.0,
                    longest: 6283.0,
                }
                .into(),
                &[
                    "sample_time",
                    "disturbance.harmonics = 2",
                    "controller.internal_model = false",
                ],
            ),
        ];
        for (error, named) in errors {
            keys(&of_error(&error.into()), named);
        }
    }
}
