//! What `reproduce` shows, and that it is readable.
#![allow(missing_docs)]

mod common;

use common::Bench;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;

/// Runs an experiment once and returns page, numbers and table.
fn reproduce(name: &str) -> (String, Value, Vec<BTreeMap<String, String>>) {
    let bench = Bench::empty();
    let run = bench.run(&["reproduce", name, "--out", "out"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let read = |ending: &str| {
        let path = bench.path(&format!("out/{name}.{ending}"));
        fs::read_to_string(path).unwrap()
    };
    let table = csv::Reader::from_reader(read("csv").as_bytes())
        .deserialize()
        .map(Result::unwrap)
        .collect();
    let again = bench.run(&["reproduce", name, "--out", "again"]);
    assert_eq!(again.code(), 0, "{}", again.stderr());
    for ending in ["html", "json", "csv"] {
        let second = fs::read_to_string(bench.path(&format!("again/{name}.{ending}"))).unwrap();
        assert!(
            second == read(ending),
            "{name}.{ending} differs from run to run"
        );
    }
    (
        read("html"),
        serde_json::from_str(&read("json")).unwrap(),
        table,
    )
}

/// Self-contained and well-formed but for the void elements of HTML.
fn assert_readable(page: &str, words: &[&str]) {
    let body = &page[page.find("<body>").unwrap()..page.find("</html>").unwrap()];
    roxmltree::Document::parse(body).unwrap();
    for reference in ["src=", "href=\"http", "url(h", "@import", "<script"] {
        assert!(!page.contains(reference), "the page needs {reference}");
    }
    for word in words {
        assert!(page.contains(word), "no “{word}” on the page");
    }
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap()
}

#[test]
fn the_papers_example_in_every_variant() {
    let (page, numbers, table) = reproduce("paper");
    assert_readable(
        &page,
        &[
            "Figure 2",
            "Figure 3",
            "Figure 4",
            "Figure 5",
            "Figure 6",
            "Theorem 1",
            "0.489",
            "0.283",
            "0.0028",
            "98.39",
            "0.174",
        ],
    );
    let runs = numbers["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 2 * 4 * 2 * 6);
    assert_eq!(table.len(), 2 * runs.len());
    let of = |controller: &'static str| {
        runs.iter()
            .filter(move |run| run["controller"] == controller)
            .map(|run| run["over_told"].as_f64().unwrap())
    };
    for ratio in of("proposed") {
        assert!(ratio <= 1.05, "{ratio}");
    }
    for ratio in of("additive_sliding").chain(of("no_ftc")) {
        assert!(ratio > 5.0, "{ratio}");
    }
    let sine = table
        .iter()
        .filter(|row| row["reference"] == "sine" && row["controller"] == "proposed");
    for row in sine.filter(|row| row["noise"] == "0.0") {
        assert!(number(row, "true_vaf") >= 99.7, "{row:?}");
    }
    // The sine can be run ahead of; what jumps cannot.
    for run in runs.iter().filter(|run| run["reference"] != "sine") {
        let error: f64 = run["outputs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|output| output["true"]["mse"].as_f64().unwrap())
            .sum();
        assert!(error >= run["deadbeat_bound"].as_f64().unwrap(), "{run}");
    }
}

#[test]
fn the_papers_claims_are_put_to_the_test() {
    let (_, numbers, _) = reproduce("paper");
    let claims = &numbers["claims"];
    for theorem in claims["theorems"].as_array().unwrap() {
        assert_eq!(theorem["feasible"], false);
        assert!(theorem["margin"].as_f64().unwrap() < 1e-8);
    }
    let near = |value: &Value, wanted: f64, tolerance: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - wanted).abs() < tolerance, "{value} for {wanted}");
    };
    let window = &claims["sliding_window"];
    near(&window["first"], 0.489, 5e-4);
    near(&window["after"], 0.283, 5e-4);
    near(&window["full"], 0.0, 1e-9);
    near(&claims["largest_variance"], 0.174, 5e-4);
    near(&claims["doubled_disturbance"]["corrected"], 2.1146, 1e-3);
    let latency = &claims["latency"];
    assert_eq!(latency["common"], false);
    assert_eq!(latency["switched"], false);
    near(&latency["gamma"], 2.6119, 1e-3);
    let radii = latency["ignored"].as_array().unwrap();
    assert!(radii.iter().any(|radius| radius.as_f64().unwrap() > 1.0));
    assert!(claims["words"].as_array().unwrap().len() >= 8);
}

/// With a faulty sensor the proposed controller is ahead, whatever the kind of fault.
#[test]
fn the_converter_under_every_fault() {
    let (page, _, table) = reproduce("converter");
    assert_readable(
        &page,
        &["98.39", "96.00", "DC voltage", "predictive control"],
    );
    let find = |fault: &str, controller: &str, output: &str| {
        let row = table
            .iter()
            .find(|row| {
                row["fault"] == fault && row["controller"] == controller && row["output"] == output
            })
            .unwrap();
        number(row, "true_vaf")
    };
    let sensors = [("v", "DC voltage"), ("i", "reactive current")];
    let kinds = [
        "bias",
        "gain_loss",
        "drift",
        "stuck",
        "intermittent",
        "dropout",
    ];
    for (_, output) in sensors {
        let (ftc, mpc) = (find("none", "ftc", output), find("none", "mpc", output));
        assert!(ftc >= mpc - 1.0, "{output}: {ftc} against {mpc}");
    }
    for kind in kinds {
        let mut means = [0.0; 2];
        for (letter, output) in sensors {
            let fault = format!("{letter}_{kind}");
            let rivals = ["ftc", "mpc"].map(|controller| find(&fault, controller, output));
            // A current sensor that gives no reading has no wrong one, and the current's model is exact: both
            // reach the deadbeat bound, and differ by less than the noise, 0.05 A, is worth beside
            // a reference of 8 A.
            let silent = fault == "i_dropout";
            let noise_worth = 100.0 * (0.05_f64 / 8.0).powi(2);
            let handicap = if silent { noise_worth } else { 0.0 };
            assert!(
                rivals[0] > rivals[1] - handicap,
                "{fault}: {} against {}",
                rivals[0],
                rivals[1]
            );
            for (mean, vaf) in means.iter_mut().zip(rivals) {
                *mean += vaf / 2.0;
            }
        }
        assert!(means[0] > means[1], "{kind}: {means:?}");
    }
}

/// Every equation of the paper has its line.
#[test]
fn every_equation_of_the_paper_is_placed() {
    let path = format!("{}/../../docs/paper.md", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(path).unwrap();
    for equation in 1..=64 {
        let begins = format!("| ({equation}) |");
        let lines: Vec<&str> = text.lines().filter(|l| l.starts_with(&begins)).collect();
        let [line] = lines[..] else {
            panic!("({equation}) has {} lines", lines.len());
        };
        let place = line.split('|').nth(3).unwrap().trim();
        assert!(place.len() >= 5, "({equation}) is placed nowhere");
    }
}
