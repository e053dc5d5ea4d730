//! The resource of the binaries holds the design, all of it but the proof, in little more than its numbers.
//!
//! promise: small-resource
#![allow(missing_docs)]

mod common;

use common::design;
use ftc_design::DesignRecord;
use model_description::{Interface, read_controller, read_design, write_design};
use serde_json::Value;

/// Bytes for names of fields, units and sizes of lists.
const NAMES: usize = 5000;

/// Bytes of a number in a list; in a matrix it has 8.
const NUMBER: usize = 9;

/// Numbers in a value; zeros do not count, as those below the diagonal of a predictor are not written.
fn numbers(value: &Value) -> usize {
    match value {
        Value::Number(number) => usize::from(number.as_f64() != Some(0.0)),
        Value::Array(list) => list.iter().map(numbers).sum(),
        Value::Object(fields) => fields.values().map(numbers).sum(),
        _ => 0,
    }
}

#[test]
fn every_example_is_read_back_from_little_more_than_its_numbers() {
    for example in [
        "paper.toml",
        "paper_latency.toml",
        "paper_internal_model.toml",
        "paper_output.toml",
        "tank.toml",
        "converter.toml",
    ] {
        let design = design(example).record;
        let bytes = write_design(&design).unwrap();
        assert_eq!(read_design(&bytes).unwrap(), design, "{example}");
        let controlling = read_controller(&bytes).unwrap();
        assert_eq!(controlling.parameters(), design.parameters(), "{example}");
        let table = |design| model_description::controller(&Interface::of(design));
        assert_eq!(table(&controlling), table(&design), "{example}");
        let first = |design: &DesignRecord| design.scenario.mode(0, design.plant.sample_time);
        assert_eq!(first(&controlling), first(&design), "{example}");
        let most = NAMES + NUMBER * numbers(&serde_json::to_value(&design).unwrap());
        assert!(
            bytes.len() <= most,
            "{example}: {} bytes, at most {most}",
            bytes.len()
        );
    }
}
