//! Whatever is wrong with a design file: the error holds key and line, and its sentence begins with the key.
#![allow(missing_docs)]

use design_file::values::NameOrList;
use design_file::{Error, parse, wording};
use ftc_design::commissioning::CommissioningError;
use ftc_design::{RequestError, SpecError, Weight};
use std::path::Path;

const TEXT: &str = r#"name = "two"
sample_time = 1.0
[[mode]]
A = [[0.9, 0.1], [0.0, 0.8]]
B = [[1.0], [0.5]]
C = [[1.0, 0.0], [0.0, 1.0]]
[signals]
outputs = [{ name = "a" },
           { name = "b" }]
[controller]
tracked = [1]
input_weight = 0.1
[scenario]
noise = 0.01
events = [{ kind = "bias", sensor = 1, from = 1, size = 1 },
          { kind = "bias", sensor = 2, from = 1, size = 1 }]
"#;

fn refused(from: &str, to: &str) -> Error {
    assert!(TEXT.contains(from), "{from}");
    parse(&TEXT.replacen(from, to, 1), Path::new("")).unwrap_err()
}

#[test]
fn the_key_is_part_of_the_error_and_begins_the_sentence() {
    parse(TEXT, Path::new("")).unwrap();
    let cases = [
        ("sample_time = 1.0", "sample_time = -1.0", "sample_time", 2),
        ("[[0.9, 0.1], [0.0, 0.8]]", "[[0.9, 0.1]]", "mode 1: A", 4),
        ("[[1.0], [0.5]]", "[[1.0], [0.5, 1]]", "mode 1: B", 5),
        ("name = \"b\"", "name = \"a\"", "signals.outputs[2].name", 9),
        (
            "name = \"b\"",
            "nominal = -1",
            "signals.outputs[2].nominal",
            9,
        ),
        (
            "tracked = [1]",
            "tracked = [1, 2]",
            "controller.tracked",
            11,
        ),
        (
            "tracked = [1]",
            "tracked = [3]",
            "controller.tracked[1]",
            11,
        ),
        ("tracked = [1]", "latency = 2", "controller.latency", 11),
        ("tracked = [1]", "decay = 0", "controller.decay", 11),
        (
            "input_weight = 0.1",
            "input_weight = -1",
            "controller.input_weight",
            12,
        ),
        ("noise = 0.01", "noise = [1]", "scenario.noise", 14),
        ("noise = 0.01", "seed = -1", "scenario.seed", 14),
        (
            "sensor = 2",
            "sensor = \"c\"",
            "scenario.events[2].sensor",
            16,
        ),
        (
            "from = 1, size = 1 }]",
            "from = 1 }]",
            "scenario.events[2].size",
            16,
        ),
    ];
    for (from, to, key, line) in cases {
        let error = refused(from, to);
        assert_eq!(error.key.as_deref(), Some(key), "{error}");
        assert_eq!(error.line, Some(line), "{error}");
        assert!(error.sentence.starts_with(key), "{error}");
    }
}

#[test]
fn what_is_about_two_tables_has_no_key() {
    let error = refused(
        "[signals]",
        "[plant]\nmodel = \"rectifier\"\ninductance = 1\nresistance = 1\ncapacitance = 1\nphase_voltage = 1\ncurrent_loop = 1\ndc_voltage = 1\nloads = [1]\n[signals]",
    );
    assert_eq!((error.key, error.line), (None, None));
    assert!(error.sentence.contains("leave one of them out"));
}

/// What the library refuses of a log is told with the key that names it and the file.
#[test]
fn a_log_is_named_by_its_key_and_its_file() {
    let logs = NameOrList::List(vec!["shut.csv".into(), "open.csv".into()]);
    let short = CommissioningError::TooFewSamples {
        samples: 40,
        stretches: 1,
        response_length: 20,
        unknowns: 42,
        needed: 63,
    };
    let errors = [
        RequestError::Database {
            mode: 2,
            error: short,
        },
        RequestError::Database {
            mode: 2,
            error: CommissioningError::NoExcitation,
        },
        RequestError::ShortLog {
            mode: 2,
            needed: 40,
        },
        RequestError::LateLog { mode: 2 },
        RequestError::LongLog {
            mode: 2,
            samples: 9,
            most: 8,
        },
        RequestError::Excitation {
            mode: 2,
            input: 1,
            name: "pump".into(),
            lag: 1,
            ratio: 1e-9,
        },
    ];
    for error in errors {
        let complaint = wording::of_request(&error, Some(&logs));
        let said = complaint.to_string();
        assert!(
            said.starts_with("estimator.database: open.csv: mode 2: "),
            "{said}"
        );
        let key = complaint.key().map(ToString::to_string);
        assert_eq!(key.as_deref(), Some("estimator.database"));
        let advised = ["record", "move them", "shorten"];
        assert!(advised.iter().any(|word| said.contains(word)), "{said}");
    }
}

#[test]
fn one_is_not_told_in_the_plural() {
    let of = |error: SpecError| wording::of_request(&error.into(), None).to_string();
    let weights = of(SpecError::WeightCount {
        weight: Weight::Input,
        found: 1,
        needed: 2,
    });
    assert!(weights.contains("has 1 entry:"), "{weights}");
    let inputs = of(SpecError::TooFewInputs {
        tracked: 2,
        inputs: 1,
    });
    assert!(
        inputs.contains("2 outputs, but the plant has 1 input:"),
        "{inputs}"
    );
}
