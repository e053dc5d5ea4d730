//! The examples of the repository, at hand without it.

use std::fmt::Write;

/// An example: its name, what it shows, and its files, the one to start from first.
struct Example {
    name: &'static str,
    shows: &'static str,
    files: &'static [(&'static str, &'static [u8])],
}

macro_rules! example {
    ($name:literal, $shows:literal, [$($path:literal),+]) => {
        Example {
            name: $name,
            shows: $shows,
            files: &[$(($path, include_bytes!(concat!("../../../examples/", $path)))),+],
        }
    };
}

const EXAMPLES: [Example; 11] = [
    example!(
        "paper",
        "two modes, two faulty sensors, a slow sine; explains every key",
        ["paper.toml"]
    ),
    example!(
        "paper_internal_model",
        "the same, its tracking error free of the sine",
        ["paper_internal_model.toml"]
    ),
    example!(
        "paper_latency",
        "the same for masters that step in parallel",
        ["paper_latency.toml"]
    ),
    example!(
        "paper_output",
        "the same with a disturbance of the outputs",
        ["paper_output.toml"]
    ),
    example!(
        "tank",
        "two reservoirs with a valve, in physical units",
        ["tank.toml"]
    ),
    example!(
        "converter",
        "an AC/DC converter whose plant is nonlinear",
        ["converter.toml"]
    ),
    example!(
        "logged",
        "a fault estimator that learns from logs",
        ["logged.toml", "logged_open.csv", "logged_closed.csv"]
    ),
    example!(
        "quadruple_tank",
        "Python: four tanks, from their physics to FMUs",
        [
            "python/quadruple_tank.py",
            "python/study.py",
            "python/loop.py"
        ]
    ),
    example!(
        "dc_motor",
        "Python: a motor with two loads, from its physics to FMUs",
        ["python/dc_motor.py", "python/study.py", "python/loop.py"]
    ),
    example!(
        "boost_converter",
        "Python: a boost converter, from its physics to FMUs",
        [
            "python/boost_converter.py",
            "python/study.py",
            "python/loop.py"
        ]
    ),
    example!(
        "from_a_log",
        "Python: from logs of a plant to FMUs, without a model",
        [
            "python/from_a_log.py",
            "logged.toml",
            "logged_open.csv",
            "logged_closed.csv"
        ]
    ),
];

/// Every example, one a line.
pub fn list() -> String {
    EXAMPLES.iter().fold(String::new(), |mut text, example| {
        let _ = writeln!(text, "{:<22}{}", example.name, example.shows);
        text
    })
}

/// Names of the examples.
pub fn names() -> Vec<&'static str> {
    EXAMPLES.iter().map(|example| example.name).collect()
}

/// Name and contents of an example's files, the one to start from first.
///
/// # Errors
/// There is no such example.
pub fn files(name: &str) -> Result<Vec<(String, Vec<u8>)>, UnknownExample> {
    let wanted = name.trim_end_matches(".toml").trim_end_matches(".py");
    let found = EXAMPLES.iter().find(|example| example.name == wanted);
    found
        .map(|example| {
            let files = example.files.iter();
            files
                .map(|(path, bytes)| {
                    (
                        path.trim_start_matches("python/").to_owned(),
                        bytes.to_vec(),
                    )
                })
                .collect()
        })
        .ok_or_else(|| UnknownExample(name.to_owned()))
}

/// No example has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no example \"{0}\": name one of {names}", names = names().join(", "))]
#[non_exhaustive]
pub struct UnknownExample(pub String);
