//! The walls between the crates: which may need which, and that each stands alone.

mod common;

use common::{Channel, controller};
use serde_json::Value;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// What each library crate and each FMU may need of this project; dependencies of tests do not count.
const ARROWS: [(&str, &[&str]); 12] = [
    ("ftc-control", &[]),
    ("ftc-lapack", &[]),
    ("ftc-plant", &[]),
    ("ftc-record", &["ftc-control", "ftc-plant"]),
    (
        "ftc-design",
        &["ftc-control", "ftc-lapack", "ftc-plant", "ftc-record"],
    ),
    ("ftc-simulate", &["ftc-control", "ftc-plant", "ftc-record"]),
    (
        "ftc-baselines",
        &["ftc-control", "ftc-design", "ftc-plant", "ftc-simulate"],
    ),
    ("ftc-identify", &[]),
    // What runs in an FMU: neither synthesis nor certificates.
    ("model-description", &["ftc-plant", "ftc-record"]),
    ("fmu-abi", &["model-description"]),
    (
        "ftc-controller-fmu",
        &["ftc-control", "fmu-abi", "model-description"],
    ),
    (
        "ftc-plant-fmu",
        &["ftc-simulate", "fmu-abi", "model-description"],
    ),
];

fn packages() -> Vec<Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps"])
        .current_dir(root())
        .output()
        .unwrap();
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// The normal dependencies of a package.
fn needed(package: &Value) -> BTreeSet<String> {
    let all = package["dependencies"].as_array().unwrap().iter();
    all.filter(|dependency| dependency["kind"].is_null())
        .map(|dependency| dependency["name"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn the_arrows_between_the_library_crates_go_one_way() {
    let packages = packages();
    let own: BTreeSet<&str> = packages
        .iter()
        .map(|p| p["name"].as_str().unwrap())
        .collect();
    for (name, allowed) in ARROWS {
        let package = packages.iter().find(|p| p["name"] == name).unwrap();
        for dependency in needed(package) {
            assert!(
                !own.contains(dependency.as_str()) || allowed.contains(&dependency.as_str()),
                "{name} must not need {dependency}"
            );
        }
    }
}

#[test]
fn the_controller_needs_plain_data_only() {
    let packages = packages();
    let control = packages
        .iter()
        .find(|p| p["name"] == "ftc-control")
        .unwrap();
    let allowed = BTreeSet::from(["libm", "serde", "thiserror"].map(String::from));
    assert_eq!(needed(control), allowed);
}

/// Builds a program outside the workspace and runs it.
fn outside(name: &str, input: &str) -> String {
    let target: PathBuf = root().join("target/outside");
    let mut child = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--manifest-path"])
        .arg(root().join(format!("tests/outside/{name}/Cargo.toml")))
        .env("CARGO_TARGET_DIR", target)
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(input.as_bytes())
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{name} does not build and run");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_program_runs_the_controller_alone() {
    let parameters = controller(Channel::State, 0.005);
    let text = outside("control", &serde_json::to_string(&parameters).unwrap());
    let y: Vec<f64> = serde_json::from_str(&text).unwrap();
    assert!(y.iter().all(|y| (y - 0.3).abs() < 1e-3), "{y:?}");
}

#[test]
fn a_program_with_a_blas_of_its_own_designs_with_it() {
    assert!(outside("blas", "").ends_with("calls\n"));
}
