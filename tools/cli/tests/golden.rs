//! Every example, to the bit: the bytes of its exported `design.msgpack` and of its `trajectories.csv`
//! (each number written so that it reads back to the same bits) against the hashes in
//! `golden/hashes.json`.
//!
//! The solver's linear algebra picks its instructions by processor, so bits are compared only where
//! the same ones are present as at recording; everywhere the figures of merit agree to 1e-4.
//! `FTC_RENEW_GOLDEN=1 cargo test --package ftc-fmu --test golden` records anew; say why in the commit.
//!
//! promise: pinned-examples

mod common;

use common::{Bench, installed, unzip};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Golden {
    /// Instructions of the processor on which the hashes were recorded.
    processor: Vec<String>,
    /// By name of the example.
    examples: BTreeMap<String, Example>,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Example {
    design: String,
    trajectories: String,
    metrics: Value,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn recorded_in() -> PathBuf {
    root().join("tests/golden/hashes.json")
}

fn processor() -> Vec<String> {
    let mut found = vec![std::env::consts::ARCH.to_owned()];
    #[cfg(target_arch = "x86_64")]
    for (name, present) in [
        ("fma", std::arch::is_x86_feature_detected!("fma")),
        ("avx2", std::arch::is_x86_feature_detected!("avx2")),
        ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
    ] {
        if present {
            found.push(name.to_owned());
        }
    }
    found
}

fn hash(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Exports and simulates one example.
fn example(path: &Path) -> Example {
    let bench = Bench::empty();
    let program = installed(
        &bench,
        &[
            "fmu-binaries/linux64/ftc_controller.so",
            "fmu-binaries/linux64/ftc_plant.so",
        ],
    );
    let run = |command: &str| {
        let status = Command::new(&program)
            .args(["--quiet", command])
            .arg(path)
            .arg("--out")
            .arg(bench.path(command))
            .status()
            .unwrap();
        assert!(status.success(), "{command} {}", path.display());
        bench.path(command)
    };
    let exported = run("export");
    let controller = fs::read_dir(exported)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| path.to_string_lossy().ends_with("_controller.fmu"))
        .unwrap();
    let simulated = run("simulate");
    let read = |name: &str| fs::read(simulated.join(name)).unwrap();
    Example {
        design: hash(&unzip(&controller)["resources/design.msgpack"]),
        trajectories: hash(&read("trajectories.csv")),
        metrics: serde_json::from_slice(&read("metrics.json")).unwrap(),
    }
}

/// Whether every number of `found` is within 1e-4 of `wanted`, relative to it.
fn close(found: &Value, wanted: &Value) -> bool {
    match (found, wanted) {
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && b.iter().all(|(key, wanted)| close(&a[key], wanted))
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| close(a, b))
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            (a - b).abs() <= 1e-4 * b.abs().max(1e-6)
        }
        // Sentences hold rounded numbers.
        (Value::String(_), Value::String(_)) => true,
        (a, b) => a == b,
    }
}

#[test]
fn examples_give_the_same_bits() {
    let mut examples = BTreeMap::new();
    for entry in fs::read_dir(root().join("../../examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "toml") {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            examples.insert(name, example(&path));
        }
    }
    let found = Golden {
        processor: processor(),
        examples,
    };
    if std::env::var_os("FTC_RENEW_GOLDEN").is_some() {
        let text = serde_json::to_string_pretty(&found).unwrap() + "\n";
        fs::write(recorded_in(), text).unwrap();
        return;
    }
    let golden: Golden = serde_json::from_slice(&fs::read(recorded_in()).unwrap()).unwrap();
    assert!(found.examples.keys().eq(golden.examples.keys()));
    let same_processor = found.processor == golden.processor;
    for (name, wanted) in &golden.examples {
        let found = &found.examples[name];
        if same_processor {
            assert_eq!(
                (&found.design, &found.trajectories),
                (&wanted.design, &wanted.trajectories),
                "{name}: other bits in design.msgpack or in trajectories.csv"
            );
        }
        assert!(
            close(&found.metrics, &wanted.metrics),
            "{name}: {found:?} is far from {wanted:?}"
        );
    }
}
