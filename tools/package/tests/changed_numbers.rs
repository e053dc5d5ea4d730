//! A changed number of a design is refused, or it is harmless: what it decides was proved again.
//!
//! Every numeric leaf of every example's record is changed by a thousandth, in sign, to 0 and to 1e18.
//! Long lists of the fault estimator are sampled.
//!
//! promise: changed-numbers
#![allow(missing_docs)]

use ftc_design::{Design, coverage};
use serde_json::{Number, Value};
use std::path::Path;

/// Lists with more entries than this are sampled.
const MOST_OF_A_LIST: usize = 12;

fn design(example: &str) -> Design {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples")
        .join(example);
    let request = design_file::read(&path).unwrap().request;
    ftc_design::assembly::assemble(request).unwrap()
}

/// What `verify` asks of the numbers in an FMU.
fn proves(design: &Design) -> Result<(), String> {
    design.check()?;
    coverage::check(design)?;
    let synthesis = design.synthesis.as_ref().ok_or("no proof")?;
    let proved = synthesis.verify(&design.controller.plant);
    proved.map_err(|error| error.to_string())
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
    // The plant and what is proved of it: the proof went through for the changed numbers.
    let proved_again = begins("/synthesis/") || begins("/controller/plant/modes/");
    // Named as not proved by `verify`, and without a part in the linear loop.
    let named = begins("/controller/estimator/");
    // What the plant FMU plays, and what signals are called: no part of the controller.
    let elsewhere = begins("/scenario/") || begins("/truth/") || begins("/signals/");
    let same_loop = design.controller.feedback == original.controller.feedback
        && design.controller.observer == original.controller.observer
        && design.controller.input_limits == original.controller.input_limits;
    (proved_again || named || elsewhere || begins("/controller/plant/sample_time")) && same_loop
}

/// Whether everything the proofs and relations read is that of the original.
fn same_claims(design: &Design, original: &Design) -> bool {
    design.synthesis == original.synthesis
}

fn every_leaf_of(example: &str) {
    let original = design(example);
    proves(&original).unwrap();
    let record = serde_json::to_value(&original).unwrap();
    let mut paths = Vec::new();
    leaves(&record, "", &mut paths);
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
            // The proofs do not read the estimator, nor what is played: they hold as before.
            let untouched = same_claims(&design, &original)
                && design.controller.plant == original.controller.plant;
            let verdict = match untouched {
                true => design.check().and_then(|()| coverage::check(&design)),
                false => proves(&design),
            };
            match verdict {
                Err(_) => refused += 1,
                Ok(()) => {
                    accepted += 1;
                    assert!(
                        harmless(path, &design, &original),
                        "{example}: {path} = {change} was accepted"
                    );
                    if !path.starts_with("/synthesis/") {
                        assert!(same_claims(&design, &original), "{example}: {path}");
                    }
                }
            }
        }
    }
    assert!(refused > accepted, "{refused} refused, {accepted} accepted");
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
        d.controller.feedback.modes[0].feedforward[(0, 0)] *= 1.001;
    });
    refused("anti-windup", &|d| {
        d.controller.feedback.modes[1].anti_windup[(0, 0)] += 1e-3;
    });
    refused("operating state", &|d| {
        d.controller.plant.modes[0].operating_point.x[0] = 1e18;
    });
    refused("limit", &|d| d.controller.input_limits[0].max = Some(1e9));
    refused("additive control", &|d| {
        d.controller.feedback.modes[0].output_feedback[(0, 0)] += 1.0;
    });
    refused("largest fault", &|d| {
        d.controller.estimator.largest_fault[0] = 0.0
    });
    refused("leverage", &|d| d.controller.estimator.leverage_limit = 0.0);
    refused("observer", &|d| d.controller.observer.minimum_dwell = 1);
}

/// Units so large that a gain vanishes in them hide nothing.
#[test]
fn a_unit_that_underflows_is_refused() {
    for exponent in [1023, -1022, 300] {
        let mut design = design("paper.toml");
        let synthesis = design.synthesis.as_mut().unwrap();
        synthesis.state_feedback.certificate.units.inputs[0] = 2f64.powi(exponent);
        let sentence = proves(&design).unwrap_err();
        assert!(sentence.contains("units"), "{sentence}");
        let mut design = self::design("paper.toml");
        let synthesis = design.synthesis.as_mut().unwrap();
        synthesis.observer.certificate.states[0] = 2f64.powi(exponent);
        let sentence = proves(&design).unwrap_err();
        assert!(sentence.contains("units"), "{sentence}");
    }
}
