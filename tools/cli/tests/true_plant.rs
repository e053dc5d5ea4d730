//! `[scenario.plant]`, and what `simulate` tries on plants that are not quite the model's.
//!
//! promise: true-plant
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, SOUND};
use std::fs;

const DESIGN: &str = r#"
name = "two"
sample_time = 1.0

[[mode]]
A = [[0.6, 0.1], [0.0, 0.5]]
B = [[1.0, 0.0], [0.0, 1.0]]
C = [[1.0, 0.0], [0.0, 1.0]]
E = [[0.1], [0.1]]

[controller]
decay = 0.9

[scenario]
steps = 200
noise = 0.001
reference = [1.0, -1.0]
fault = [{ kind = "steps", points = [[100, 0.5]] }, 0]
"#;

/// The columns of `trajectories.csv` under this `[scenario.plant]`.
fn trajectories(plant: &str) -> Vec<Vec<String>> {
    let bench = Bench::new(format!("{DESIGN}\n[scenario.plant]\n{plant}\n"));
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 0, "{plant}: {}", run.stderr());
    let mut reader = csv::Reader::from_path(bench.path("out/trajectories.csv")).unwrap();
    let header = reader.headers().unwrap().iter().map(String::from).collect();
    let rows = reader
        .records()
        .map(|row| row.unwrap().iter().map(String::from).collect());
    std::iter::once(header).chain(rows).collect()
}

fn column(table: &[Vec<String>], name: &str) -> Vec<f64> {
    let at = table[0].iter().position(|found| found == name).unwrap();
    table[1..]
        .iter()
        .map(|row| row[at].parse().unwrap())
        .collect()
}

#[test]
fn the_true_plant_is_another_one() {
    let nominal = trajectories("");
    let seeded = |seed: u32| trajectories(&format!("relative_error = 0.1\nseed = {seed}"));
    assert_eq!(seeded(3), seeded(3));
    assert_ne!(seeded(3), seeded(4));
    assert_ne!(seeded(3), nominal);
    assert_eq!(trajectories("mode = [{}]"), nominal);
    let other = trajectories(
        "mode = [{ B = [[0.8, 0.0], [0.0, 1.2]] }]\ninput_gain = [1.25, 0.8333333333333334]",
    );
    // A gain and its inverse in B cancel.
    for (found, wanted) in column(&other, "ftc.y_true[1]")
        .iter()
        .zip(column(&nominal, "ftc.y_true[1]"))
    {
        assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
    }
    // Integral action makes up for weak actuators and a load: the true output still settles.
    for plant in [
        "input_gain = 0.8",
        "loads = [{ input = 1, from = 20, size = 0.4 }]",
        "loads = [{ state = 2, from = 20, size = 0.4 }]",
    ] {
        let settled = column(&trajectories(plant), "told_the_fault.y_true[1]");
        assert!(
            (settled[199] - 1.0).abs() < 0.02,
            "{plant}: {}",
            settled[199]
        );
    }
    let loaded = trajectories("loads = [{ disturbance = 1, from = 20, until = 30, size = 0.4 }]");
    let w = column(&loaded, "w[1]");
    assert_eq!((w[19], w[20], w[29], w[30]), (0.0, 0.4, 0.4, 0.0));
    let late = trajectories("sensor_delay = 2");
    let (y, truth, noise, fault) = (
        column(&late, "ftc.y[2]"),
        column(&late, "ftc.y_true[2]"),
        column(&late, "noise[2]"),
        column(&late, "f[2]"),
    );
    for k in 2..200 {
        assert!(
            (y[k] - truth[k - 2] - noise[k] - fault[k]).abs() < 1e-12,
            "{k}"
        );
    }
}

#[test]
fn a_wrong_true_plant_is_refused_by_key() {
    for (plant, words) in [
        (
            "relative_error = 2.0",
            vec!["scenario.plant.relative_error", "fraction"],
        ),
        ("gain = 2.0", vec!["scenario.plant.gain", "not a known key"]),
        (
            "input_gain = [1.0]",
            vec!["scenario.plant.input_gain", "list of 2"],
        ),
        (
            "sensor_delay = -1",
            vec!["scenario.plant.sensor_delay", "whole number"],
        ),
        ("mode_delay = 100000", vec!["scenario.plant.mode_delay"]),
        (
            "mode = [{}, {}]",
            vec!["scenario.plant.mode has 2 entries", "1 mode:"],
        ),
        (
            "mode = [{ A = [[1.0]] }]",
            vec!["scenario.plant: mode 1: A is 1 x 1", "give it that size"],
        ),
        (
            "told = [{ from = 0, mode = 2 }]",
            vec!["scenario.plant.told[1]", "mode is 2"],
        ),
        (
            "loads = [{ from = 0, size = 1.0 }]",
            vec!["scenario.plant.loads[1]", "input, disturbance and state"],
        ),
        (
            "loads = [{ input = 3, from = 0, size = 1.0 }]",
            vec!["scenario.plant.loads[1]", "input is 3", "1 to 2"],
        ),
        (
            "loads = [{ state = 1, from = 5, until = 2, size = 1.0 }]",
            vec!["scenario.plant.loads[1]", "until is 2"],
        ),
        (
            "actuator = [{ kind = \"stuck\", input = 9, from = 5 }]",
            vec!["scenario.plant.actuator[1]", "input is 9"],
        ),
    ] {
        let bench = Bench::new(format!("{DESIGN}\n[scenario.plant]\n{plant}\n"));
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 2, "{plant}: {}", run.stdout());
        for word in words {
            assert!(
                run.stderr().contains(word),
                "{plant}: no '{word}' in {}",
                run.stderr()
            );
        }
    }
}

/// Every case is there, and where fault tolerance does worse than none a warning says so.
#[test]
fn simulate_tries_other_plants() {
    let cases = |design: &str| {
        let bench = Bench::new(design);
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let json = fs::read(bench.path("out/robustness.json")).unwrap();
        let page = fs::read_to_string(bench.path("out/report.html")).unwrap();
        assert!(page.contains("On a plant that is not quite the model"));
        (
            serde_json::from_slice::<serde_json::Value>(&json).unwrap()["cases"].take(),
            run.stdout(),
        )
    };
    let (found, text) = cases(DESIGN);
    let names: Vec<&str> = found
        .as_array()
        .unwrap()
        .iter()
        .map(|case| case["case"].as_str().unwrap())
        .collect();
    assert_eq!(names.len(), 7, "{names:?}");
    for word in [
        "as it is",
        "too strong",
        "too weak",
        "on u[1]",
        "on u[2]",
        "on disturbance 1",
        "one sample later",
    ] {
        assert!(
            names.iter().any(|name| name.contains(word)),
            "{word}: {names:?}"
        );
        assert!(text.contains(word), "{word}: {text}");
    }
    let of = |case: &serde_json::Value, who: &str| case["mse"][who][0].as_f64().unwrap();
    // A fault of half the reference: fault tolerance helps on the first output in the scenario itself.
    assert!(of(&found[0], "ftc") < 0.2 * of(&found[0], "no_ftc"));
    // Every case in which fault tolerance does worse than none is said, and no other.
    let healthy = DESIGN.replace(
        "fault = [{ kind = \"steps\", points = [[100, 0.5]] }, 0]",
        "",
    ) + "[scenario.plant]\nloads = [{ input = 1, from = 50, size = 0.5 }]\n";
    for design in [DESIGN, &healthy] {
        let (found, text) = cases(design);
        for case in found.as_array().unwrap() {
            let (with, without) = (of(case, "ftc"), of(case, "no_ftc"));
            let sentence = format!(
                "warning: {}: y[1] follows its reference worse",
                case["case"].as_str().unwrap()
            );
            let expected = with > 1.01 * without && with.sqrt() > 1e-3;
            assert_eq!(
                text.contains(&sentence),
                expected,
                "{sentence}: {with} {without}"
            );
        }
    }
}

/// The matrices of the true plant are in samples or continuous, as the file's or as they say themselves.
#[test]
fn the_true_plant_s_matrices_may_be_of_the_other_kind() {
    // dx/dt = -0.5 x + u, held for one second.
    let decay = (-0.5f64).exp();
    let gain = (1.0 - decay) / 0.5;
    let continuous = "A = [[-0.5, 0.0], [0.0, -0.5]]\nB = [[1.0, 0.0], [0.0, 1.0]]";
    let sampled =
        format!("A = [[{decay:?}, 0.0], [0.0, {decay:?}]], B = [[{gain:?}, 0.0], [0.0, {gain:?}]]");
    let of = |plant: &str| column(&trajectories(plant), "ftc.y_true[1]");
    let e = "E = [[0.1], [0.1]]";
    let same =
        |one: &[f64], other: &[f64]| one.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-9);
    let (inline, disturbed) = (continuous.replace('\n', ", "), e);
    assert!(same(
        &of(&format!("mode = [{{ {sampled} }}]")),
        &of(&format!(
            "continuous = true\nmode = [{{ {inline}, {disturbed} }}]"
        )),
    ));
    // The same in a file that is continuous itself.
    let other = DESIGN
        .replace("sample_time = 1.0", "sample_time = 1.0\ncontinuous = true")
        .replace(
            "A = [[0.6, 0.1], [0.0, 0.5]]\nB = [[1.0, 0.0], [0.0, 1.0]]",
            continuous,
        );
    let run = |plant: &str| {
        let bench = Bench::new(format!("{other}\n[scenario.plant]\n{plant}\n"));
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        (
            run.code(),
            run.stderr(),
            fs::read(bench.path("out/trajectories.csv")).ok(),
        )
    };
    let (code, message, _) = run(&format!("continuous = false\nmode = [{{ {sampled} }}]"));
    assert_eq!(code, 2);
    assert!(
        message.contains("scenario.plant: mode 1: E is missing"),
        "{message}"
    );
    let (code, message, _) = run(&format!(
        "continuous = false\nmode = [{{ {sampled}, {e} }}]"
    ));
    assert_eq!(code, 0, "{message}");
    let (code, message, _) = run("continuous = false");
    assert_eq!(code, 2);
    assert!(
        message.contains("scenario.plant.continuous is about scenario.plant.mode"),
        "{message}"
    );
}

/// What makes the true plant unstable, or never happens, is said.
#[test]
fn an_unstable_true_plant_and_what_comes_too_late_are_warned_of() {
    let out = |plant: &str| {
        let bench = Bench::new(format!("{DESIGN}\n[scenario.plant]\n{plant}\n"));
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        run.stdout()
    };
    let text = out("mode = [{ A = [[1.05, 0.0], [0.0, 0.5]] }]");
    let words = "warning: the true plant is unstable in mode 1 (mode 1): the spectral radius of its A is 1.0500, that of the \
                 model's 0.6000";
    assert!(text.contains(words), "{text}");
    let text = out("loads = [{ input = 1, from = 200, size = 0.1 }]");
    assert!(
        text.contains(
            "warning: scenario.plant.loads[1]: it begins at 200 s, but the scenario ends at 200 s"
        ),
        "{text}"
    );
    let text = out("loads = [{ input = 1, from = 199, size = 0.1 }]");
    assert!(
        !text.contains("it never acts") && !text.contains("unstable"),
        "{text}"
    );
}

/// A campaign's model error comes on top of what the true plant departs by, or is refused.
#[test]
fn a_campaign_combines_its_model_error_with_the_true_plant() {
    let campaign = |design: &str, more: &[&str]| {
        let bench = Bench::new(design);
        let arguments = [&["campaign", FILE, "--runs", "24", "--out", "out"], more].concat();
        let run = bench.run(&arguments);
        let page = fs::read_to_string(bench.path("out/campaign.html")).unwrap_or_default();
        (run.code(), run.stdout() + &run.stderr(), page)
    };
    let weak = format!(
        "{DESIGN}\n[scenario.plant]\ninput_gain = 0.7\nmode = [{{ A = [[0.95, 0.1], [0.0, 0.5]] }}]\n"
    );
    let figures = |text: &str| text.lines().take(10).map(String::from).collect::<Vec<_>>();
    let (code, exact, page) = campaign(&weak, &["--model-error", "0"]);
    assert_eq!(code, 0, "{exact}");
    assert!(page.contains("as [scenario.plant] says") && page.contains("no model error"));
    let (code, off, page) = campaign(&weak, &["--model-error", "0.9"]);
    assert_eq!(code, 0, "{off}");
    assert!(page.contains("model error up to 90 %") && page.contains("Runs without a fault"));
    assert_ne!(figures(&exact), figures(&off));
    assert!(
        off.contains("true plant is unstable where the model is not"),
        "{off}"
    );
    assert!(!exact.contains("unstable"), "{exact}");
    // No two columns run together, whatever stands in them.
    for line in off
        .lines()
        .filter(|line| line.starts_with("with") || line.starts_with("told"))
    {
        assert_eq!(line[34..].split_whitespace().count(), 4, "{line}");
    }
}

/// What is out of its range is named as it was given.
#[test]
fn an_option_out_of_range_is_named() {
    let bench = Bench::new(SOUND);
    for (option, value) in [
        ("--model-error", "7"),
        ("--largest-fault", "0.5"),
        ("--most-faults", "99"),
    ] {
        let run = bench.run(&["campaign", FILE, "--out", "out", option, value]);
        assert_eq!(run.code(), 2);
        let said = run.stderr();
        assert!(
            said.starts_with(&format!("error: {option} is ")) && said.contains(value),
            "{said}"
        );
    }
}

/// A nonlinear plant has no matrices that a model error could change.
#[test]
fn a_model_error_of_a_nonlinear_plant_is_refused() {
    let text = include_str!("../../../examples/converter.toml");
    let bench = Bench::new(text);
    let campaign = |more: &[&str]| {
        bench.run(&[&["campaign", FILE, "--runs", "1", "--out", "out"], more].concat())
    };
    let run = campaign(&["--model-error", "0.1"]);
    assert_eq!(run.code(), 2, "{}", run.stdout());
    assert!(
        run.stderr()
            .contains("--model-error is 0.1, but it changes matrices")
    );
    assert!(!bench.path("out").exists());
    let run = campaign(&[]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let page = fs::read_to_string(bench.path("out/campaign.html")).unwrap();
    assert!(page.contains("no model error"));
}
