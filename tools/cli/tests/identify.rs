//! From logs of healthy operation to an FMU that is proved, on the command line alone.
//!
//! promise: identify

mod common;

use common::Bench;
use std::path::Path;

fn example(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    folder.join(name).display().to_string()
}

const SIGNALS: [&str; 4] = ["--inputs", "pump 1,pump 2", "--outputs", "level 1,level 2"];

/// The logs of `examples/logged.toml`: the matrices that made them come out again, the disturbance that
/// was named is in the design file, and what the file describes is designed, exported and verified.
#[test]
fn from_two_logs_to_a_verified_fmu() {
    let bench = Bench::empty();
    let logs = [example("logged_closed.csv"), example("logged_open.csv")];
    let mut arguments = vec![
        "identify",
        &logs[0],
        &logs[1],
        "--period",
        "600",
        "--out",
        "found.toml",
    ];
    arguments.extend(SIGNALS);
    let run = bench.run(&arguments);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    assert!(run.stdout().contains("<- chosen"), "{}", run.stdout());

    let table: toml::Table = std::fs::read_to_string(bench.path("found.toml"))
        .unwrap()
        .parse()
        .unwrap();
    assert_eq!(table["disturbance"]["period"].as_float(), Some(600.0));
    let made: toml::Table = std::fs::read_to_string(example("logged.toml"))
        .unwrap()
        .parse()
        .unwrap();
    for (found, made) in modes(&table).iter().zip(modes(&made)) {
        // The outputs are the states in both, so that A and B may be compared as they are.
        for (key, tolerance) in [("A", 0.02), ("B", 0.05)] {
            for (found, made) in numbers(&found[key]).iter().zip(numbers(&made[key])) {
                assert!(
                    (found - made).abs() < tolerance,
                    "{key}: {found} for {made}"
                );
            }
        }
    }

    let exported = bench.run(&["export", "found.toml", "--out", "."]);
    assert_eq!(exported.code(), 0, "{}", exported.stderr());
    let verified = bench.run(&["verify", "found_controller.fmu"]);
    assert_eq!(verified.code(), 0, "{}", verified.stderr());
}

#[test]
fn wrong_names_are_refused_with_those_that_there_are() {
    let bench = Bench::empty();
    let log = example("logged_closed.csv");
    let plain = bench.run(&["identify", &log, "--out", "found.toml"]);
    assert_eq!(plain.code(), 2);
    assert!(
        plain.stderr().contains("has no column u[1]"),
        "{}",
        plain.stderr()
    );
    assert!(plain.stderr().contains("pump 1, pump 2, level 1, level 2"));
    let wrong = bench.run(&[
        "identify",
        &log,
        "--inputs",
        "pump",
        "--outputs",
        "level 1",
        "--out",
        "found.toml",
    ]);
    assert_eq!(wrong.code(), 2);
    assert!(
        wrong.stderr().contains("has no column \"pump\""),
        "{}",
        wrong.stderr()
    );
    let named = bench.run(&["identify", &log, "--out", "not a name.toml"]);
    assert_eq!(named.code(), 2);
    assert!(
        named.stderr().contains("--out not a name.toml"),
        "{}",
        named.stderr()
    );
}

#[test]
fn a_directory_is_not_taken_for_the_design_file() {
    let bench = Bench::empty();
    let log = example("logged_closed.csv");
    std::fs::create_dir(bench.path("found")).unwrap();
    for (out, such_as) in [(".", "./plant.toml"), ("found", "found/plant.toml")] {
        let run = bench.run(&["identify", &log, "--out", out]);
        assert_eq!(run.code(), 2);
        let wanted = format!("--out {out}: this is a directory: name the design file");
        assert!(run.stderr().contains(&wanted), "{}", run.stderr());
        assert!(run.stderr().contains(such_as), "{}", run.stderr());
    }
}

/// What contradicts itself or the log, and a log that holds too little, are told with option or log.
#[test]
fn what_does_not_fit_the_log_is_told_with_its_option_or_the_log() {
    let bench = Bench::empty();
    let log = example("logged_closed.csv");
    let text = std::fs::read_to_string(&log).unwrap();
    let short: Vec<&str> = text.lines().take(11).collect();
    std::fs::write(bench.path("short.csv"), short.join("\n")).unwrap();
    let cases: [(&str, &[&str], &[&str]); 5] = [
        (
            &log,
            &["--sample-time", "7"],
            &["rows are 5 s apart", "--sample-time is 7", "leave that out"],
        ),
        (
            &log,
            &["--period", "9"],
            &["--period", "cannot be told", "give a longer period"],
        ),
        (
            &log,
            &["--order", "900"],
            &["logged_closed.csv", "order 900", "another --order"],
        ),
        (
            "short.csv",
            &[],
            &["short.csv: mode 1: ", "there are 10", "for longer"],
        ),
        (
            &log,
            &["--outputs", "pump 1"],
            &["--outputs names the column \"pump 1\" once more"],
        ),
    ];
    for (log, given, words) in cases {
        let mut arguments = vec!["identify", log, "--out", "found.toml"];
        arguments.extend(SIGNALS.iter().filter(|_| !given.contains(&"--outputs")));
        if given.contains(&"--outputs") {
            arguments.extend(["--inputs", "pump 1"]);
        }
        arguments.extend(given);
        let run = bench.run(&arguments);
        assert_eq!(run.code(), 2, "{given:?}: {}", run.stdout());
        for word in words {
            assert!(run.stderr().contains(word), "{word}: {}", run.stderr());
        }
    }
}

fn modes(table: &toml::Table) -> Vec<toml::Table> {
    let modes = table["mode"].as_array().unwrap();
    modes
        .iter()
        .map(|mode| mode.as_table().unwrap().clone())
        .collect()
}

fn numbers(rows: &toml::Value) -> Vec<f64> {
    let number = |value: &toml::Value| {
        value
            .as_float()
            .or(value.as_integer().map(|whole| whole as f64))
    };
    let rows = rows.as_array().unwrap().iter();
    rows.flat_map(|row| row.as_array().unwrap().iter().filter_map(number))
        .collect()
}
