//! A changed number of a design is refused, or it is harmless: what it decides was proved again.
//!
//! Every numeric leaf of every example's record is changed by a thousandth, in sign, to 0 and to 1e18.
//! Long lists of the fault estimator are sampled.
//!
//! promise: changed-numbers
#![allow(missing_docs)]

mod common;

use common::design;
use ftc_control::Matrix;
use ftc_control::parameters::EstimatorMethod;
use ftc_design::{Design, Proof, coverage};
use serde_json::{Number, Value};

/// Lists with more entries than this are sampled.
const MOST_OF_A_LIST: usize = 12;

/// What `verify` asks of the numbers in an FMU.
fn proves(design: &Design) -> Result<(), String> {
    coverage::prove(design).map_err(|error| error.to_string())
}

/// The paths (JSON pointers) of the numbers below a value.
fn leaves(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(path.to_owned()),
        Value::Array(list) => {
            let stride = list.len().div_ceil(MOST_OF_A_LIST).max(1);
            for (index, item) in list.iter().enumerate().step_by(stride) {
                leaves(item, &format!("{path}/{index}"), found);
            }
        }
        Value::Object(fields) => {
            for (key, item) in fields {
                leaves(item, &format!("{path}/{key}"), found);
            }
        }
        _ => {}
    }
}

/// The four changes of a number; those that change nothing are left out.
fn changes(number: &Number) -> Vec<Value> {
    let value = number.as_f64().unwrap();
    let changed = [value * 1.001, -value, 0.0, 1e18];
    let different = changed.into_iter().filter(|&new| new != value);
    let as_number = |new: f64| match number.is_f64() {
        true => Number::from_f64(new).map(Value::Number),
        false => Some(Value::from(new as i64)),
    };
    different
        .filter_map(as_number)
        .filter(|new| new != &Value::Number(number.clone()))
        .collect()
}

/// Where an accepted change does no harm, and why.
fn harmless(path: &str, design: &Design, original: &Design) -> bool {
    let begins = |prefix: &str| path.starts_with(prefix);
    // Plant, gains, observer, and what is proved of them: the proof went through for the changed numbers.
    let parts = ["/proof/", "/plant/modes/", "/controller/observer/"];
    let proved_again = parts.into_iter().any(begins) || is_certified_gain(path);
    // Named as not proved by `verify`, and without a part in the linear loop.
    let named = begins("/controller/estimator/");
    // The experiment of the plant FMU, and what signals are called: no part of the controller. The ranges of the
    // inputs, to which it clamps, are named by `verify`; in an FMU they stand in the description, too.
    let elsewhere = begins("/scenario/") || begins("/true_plant/") || begins("/signals/");
    let same_loop = design.controller.feedback == original.controller.feedback
        && design.controller.observer == original.controller.observer;
    proved_again
        || (named || elsewhere || begins("/plant/sample_time")) && same_loop
        || rounding(design, original)
}

/// Whether a number is one of the gains that the certificate is about.
fn is_certified_gain(path: &str) -> bool {
    let Some(rest) = path.strip_prefix("/controller/feedback/modes/") else {
        return false;
    };
    let gain = rest.split('/').nth(1);
    gain.is_some_and(|gain| ["state_feedback", "integral", "previous_input"].contains(&gain))
}

/// Whether gains outside the proved loop differ by less than their own rounding, and nothing else does.
fn rounding(design: &Design, original: &Design) -> bool {
    let units = original.signals.scaling();
    let feedback = &original.controller.feedback;
    let tracked: Vec<f64> = feedback.tracked.iter().map(|&k| units.outputs[k]).collect();
    let pairs = tracked.iter().flat_map(|&unit| [unit; 2]);
    let turning = feedback.resonators.iter().flat_map(|_| pairs.clone());
    let integrals: Vec<f64> = tracked.iter().copied().chain(turning).collect();
    // In units of the signals, or an entry in a large unit would hide one in a small unit.
    let near = |found: &Matrix, derived: &Matrix, rows: &[f64], columns: &[f64]| {
        let entries = |matrix: &Matrix| -> Vec<f64> {
            let at = (0..matrix.nrows()).flat_map(|r| (0..matrix.ncols()).map(move |c| (r, c)));
            at.map(|(r, c)| matrix.get(r, c).unwrap() * columns[c] / rows[r])
                .collect()
        };
        let (shapes, found) = (found.shape() == derived.shape(), entries(found));
        let derived = entries(derived);
        let largest = derived
            .iter()
            .fold(0.0_f64, |most, value| most.max(value.abs()));
        let mut pairs = found.iter().zip(&derived);
        shapes && pairs.all(|(f, d)| (f - d).abs() <= 5e-9 * largest)
    };
    let mut same = design.clone();
    let modes = same.controller.feedback.modes.iter_mut();
    for (gains, known) in modes.zip(&original.controller.feedback.modes) {
        let (inputs, outputs) = (&units.inputs, &units.outputs);
        for (found, derived, rows, columns) in [
            (&mut gains.feedforward, &known.feedforward, inputs, &tracked),
            (
                &mut gains.anti_windup,
                &known.anti_windup,
                &integrals,
                inputs,
            ),
            (
                &mut gains.output_feedback,
                &known.output_feedback,
                inputs,
                outputs,
            ),
        ] {
            if near(found, derived, rows, columns) {
                *found = derived.clone();
            }
        }
    }
    same == *original
}

/// Whether everything that the proofs read is that of the original.
fn same_claims(design: &Design, original: &Design) -> bool {
    design.synthesis() == original.synthesis() && design.plant == original.plant
}

fn every_leaf_of(example: &str) {
    every_leaf(example, &design(example), "");
}

/// Changes every leaf whose path begins so.
fn every_leaf(example: &str, original: &Design, below: &str) {
    proves(original).unwrap();
    let record = serde_json::to_value(original).unwrap();
    let mut paths = Vec::new();
    leaves(&record, "", &mut paths);
    paths.retain(|path| path.starts_with(below));
    let (mut refused, mut accepted) = (0, 0);
    for path in &paths {
        let Some(Value::Number(number)) = record.pointer(path) else {
            unreachable!("{path} is a number");
        };
        for change in changes(number) {
            let mut changed = record.clone();
            *changed.pointer_mut(path).unwrap() = change.clone();
            let Ok(design) = serde_json::from_value::<Design>(changed) else {
                refused += 1;
                continue;
            };
            // The proofs do not read the estimator, nor the experiment: they hold as before.
            let untouched = same_claims(&design, original);
            let verdict = match untouched {
                true => design
                    .check()
                    .map_err(|error| error.to_string())
                    .and_then(|()| coverage::check(&design).map_err(|error| error.to_string())),
                false => proves(&design),
            };
            match verdict {
                Err(_) => refused += 1,
                Ok(()) => {
                    accepted += 1;
                    assert!(
                        harmless(path, &design, original),
                        "{example}: {path} = {change} was accepted"
                    );
                    if !path.starts_with("/proof/") {
                        assert!(design.proof == original.proof, "{example}: {path}");
                    }
                }
            }
        }
    }
    assert!(refused > 100, "{refused} refused, {accepted} accepted");
}

#[test]
fn of_the_paper() {
    every_leaf_of("paper.toml");
}

#[test]
fn of_the_paper_with_latency() {
    every_leaf_of("paper_latency.toml");
}

#[test]
fn of_the_paper_with_an_output_disturbance() {
    every_leaf_of("paper_output.toml");
}

#[test]
fn of_the_tank() {
    every_leaf_of("tank.toml");
}

#[test]
fn of_the_converter() {
    every_leaf_of("converter.toml");
}

#[test]
fn of_the_paper_with_an_internal_model() {
    every_leaf_of("paper_internal_model.toml");
}

/// Its plants and predictors come from logs.
#[test]
fn of_a_plant_from_logs() {
    every_leaf_of("logged.toml");
}

/// Inputs, outputs and states in units twelve decades apart: what is small by its unit is looked at, too.
#[test]
fn of_a_plant_in_si_units() {
    every_leaf("si_units", &common::other_design("si_units.toml"), "");
}

#[test]
fn of_a_servo_with_bumpless_transfer() {
    let design = common::other_design("bumpless_servo.toml");
    assert!(design.controller.feedback.transfer.is_some());
    every_leaf("bumpless_servo", &design, "");
}

#[test]
fn of_a_design_that_finds_its_mode() {
    every_leaf("found_mode", &common::other_design("found_mode.toml"), "");
}

/// With the default estimator, whose settings the other examples do not hold: all that the controller runs on.
fn every_leaf_with_the_default_estimator(example: &str) {
    let design = common::design_with(example, EstimatorMethod::Observer);
    assert!(design.controller.estimator.hypotheses.is_some());
    every_leaf(example, &design, "/controller/");
}

#[test]
fn of_the_paper_with_the_default_estimator() {
    every_leaf_with_the_default_estimator("paper.toml");
}

#[test]
fn of_the_tank_with_the_default_estimator() {
    every_leaf_with_the_default_estimator("tank.toml");
}

/// What made a loop of |y| 0.61 reach 1e5 once: each is refused by name.
#[test]
fn what_decides_the_command_is_derived_again() {
    let original = design("converter.toml");
    let refused = |what: &str, change: &dyn Fn(&mut Design)| {
        let mut design = original.clone();
        change(&mut design);
        let sentence = proves(&design).unwrap_err();
        assert!(sentence.contains(what), "{what}: {sentence}");
    };
    refused("feedforward", &|d| {
        d.controller.feedback.modes[0].feedforward.as_mut_slice()[0] *= 1.001;
    });
    refused("anti-windup", &|d| {
        d.controller.feedback.modes[1].anti_windup.as_mut_slice()[0] += 1e-3;
    });
    refused("operating state", &|d| {
        d.plant.modes[0].operating_point.x[0] = 1e18;
    });
    refused("limit", &|d| {
        d.signals.inputs[0].max = d.signals.inputs[0].min
    });
    refused("additive control", &|d| {
        d.controller.feedback.modes[0]
            .output_feedback
            .as_mut_slice()[0] += 1.0;
    });
    refused("largest fault", &|d| {
        d.controller.estimator.largest_fault[0] = 0.0
    });
    refused("leverage", &|d| d.controller.estimator.leverage_limit = 0.0);
    refused("tuning constant", &|d| {
        d.controller.estimator.tuning.bank.displaced *= 2.0
    });
    refused("lost sensors", &|d| {
        d.controller.observer.minimum_dwell += 1;
    });
}

/// Units so large that a gain vanishes in them hide nothing.
#[test]
fn a_unit_that_underflows_is_refused() {
    let original = design("paper.toml");
    for exponent in [1023, -1022, 300] {
        let unit = 2f64.powi(exponent);
        let refused = |change: &dyn Fn(&mut Proof)| {
            let mut design = original.clone();
            change(design.proof.as_mut().unwrap());
            let error = proves(&design).unwrap_err();
            assert!(error.contains("units"), "{error}");
        };
        refused(&|proof| proof.state_feedback.certificate.units.inputs[0] = unit);
        refused(&|proof| proof.state_feedback.certificate.units.performance = unit);
        refused(&|proof| proof.observer.certificate.states[0] = unit);
    }
}
