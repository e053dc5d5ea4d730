//! A C program drives the binary: nothing depends on Rust or Python.

use crate::host::*;
use fmu_abi::types::Status;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The test slave's library, which `cargo test` builds beside the tests.
fn library() -> PathBuf {
    let tests = std::env::current_exe().unwrap();
    let target = tests.ancestors().nth(2).unwrap();
    let library = target.join(format!(
        "examples/{}staircase{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    ));
    assert!(
        library.exists(),
        "build it: cargo build -p fmu-abi --examples"
    );
    library
}

/// Compiles a program of tests/c with every warning an error.
fn compile(folder: &Path, name: &str) -> PathBuf {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/c");
    let source = sources.join(name).with_extension("c");
    let program = folder.join(name);
    let compiled = Command::new("cc")
        .args([
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-O1",
            "-rdynamic",
            "-o",
        ])
        .arg(&program)
        .arg(source)
        .arg("-ldl")
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{compiled:?}");
    program
}

#[test]
fn a_c_program_gets_the_same_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let resources = Resources::new(0.1);
    let (start, step, count) = (-1.5, 0.25, 40);
    let run = Command::new(compile(folder.path(), "drive"))
        .arg(library())
        .arg(resources.guid.to_str().unwrap())
        .arg(resources.uri().to_str().unwrap())
        .args([start, step].map(|value: f64| format!("{value:?}")))
        .arg(count.to_string())
        .args("i 0 0.5 i 1 -3 o 7 o 8 o 9 o 10".split(' '))
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );

    let instance = Instance::started(&resources, start);
    let printed = String::from_utf8(run.stdout).unwrap();
    let mut lines = printed.lines();
    for k in 0..count {
        let number = f64::from(k + 1);
        assert_eq!(instance.set(INPUT[0], 0.5 * number), Status::Ok);
        assert_eq!(instance.set(INPUT[1], -3.0 * number), Status::Ok);
        assert_eq!(instance.step(start + f64::from(k) * step, step), Status::Ok);
        let line = lines.next().unwrap();
        let values = line.split(' ').map(hexadecimal);
        for (value, reference) in values.zip([EARLY, LATE].concat()) {
            assert_eq!(value, instance.real(reference), "step {k}: {line}");
        }
    }
    assert_eq!(lines.next(), None);
}

/// Reads what C's `%a` prints.
fn hexadecimal(text: &str) -> f64 {
    let (sign, digits) = text
        .strip_prefix('-')
        .map_or((1.0, text), |rest| (-1.0, rest));
    let (mantissa, exponent) = digits.strip_prefix("0x").unwrap().split_once('p').unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let bits = u64::from_str_radix(&format!("{whole}{fraction}"), 16).unwrap();
    let scale = exponent.parse::<i32>().unwrap() - 4 * fraction.len() as i32;
    sign * bits as f64 * 2f64.powi(scale)
}

#[test]
fn every_allocation_that_fails_is_an_answer() {
    let folder = tempfile::tempdir().unwrap();
    let resources = Resources::new(0.1);
    let run = Command::new(compile(folder.path(), "memory"))
        .arg(library())
        .arg(resources.guid.to_str().unwrap())
        .arg(resources.uri().to_str().unwrap())
        .arg("warm")
        .output()
        .unwrap();
    let (said, erred) = (&run.stdout, String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success(), "{}: {erred}", run.status);
    let said = String::from_utf8(said.clone()).unwrap();
    let met: Vec<(&str, u32)> = said
        .lines()
        .map(|line| line.split_once(' ').unwrap())
        .map(|(operation, met)| (operation, met.parse().unwrap()))
        .collect();
    for (operation, least) in [
        ("instantiate", 20),
        ("save", 4),
        ("deserialize", 4),
        ("refused", 4),
    ] {
        let (_, met) = met.iter().find(|(name, _)| *name == operation).unwrap();
        assert!(*met >= least, "{operation} met {met} failures");
    }
}
