//! SIGTERM and SIGINT at any moment: one set of files, and nothing hidden beside it.
//!
//! promise: all-or-none
#![allow(missing_docs)]
#![cfg(unix)]

mod common;

use common::{Bench, FILE, damaged};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const ROUNDS: u32 = 24;

/// Every file of a directory, hidden ones too.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    entries
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, fs::read(path).unwrap_or_default())
        })
        .collect()
}

/// `simulate` into `out`, of the design that was solved before under this number.
fn command(bench: &Bench, which: usize) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ftc-fmu"));
    let design = format!("{which}.toml");
    let solved = format!("{which}.solved");
    command
        .args([
            "simulate", &design, "--solved", &solved, "--out", "out", "--quiet",
        ])
        .current_dir(bench.path("."))
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

#[test]
fn an_interrupt_leaves_one_set_of_files() {
    let designs = [
        damaged("seed = 3", "seed = 3"),
        damaged("seed = 3", "seed = 4"),
    ];
    let bench = Bench::new(&designs[0]);
    let mut sets = Vec::new();
    let mut longest = Duration::ZERO;
    for (which, text) in designs.iter().enumerate() {
        fs::write(bench.path(FILE), text).unwrap();
        fs::copy(bench.path(FILE), bench.path(&format!("{which}.toml"))).unwrap();
        let solved = format!("{which}.solved");
        let run = bench.run(&["design", &format!("{which}.toml"), "--save", &solved]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let begun = Instant::now();
        assert!(command(&bench, which).status().unwrap().success());
        longest = longest.max(begun.elapsed());
        sets.push(files(&bench.path("out")));
    }
    assert_ne!(sets[0], sets[1]);
    let mut ended = 0;
    for round in 0..ROUNDS {
        let before = files(&bench.path("out"));
        let which = round as usize % 2;
        let mut run = command(&bench, which).spawn().unwrap();
        std::thread::sleep(longest * (round + 1) / ROUNDS);
        let signal = if round % 4 < 2 { "-TERM" } else { "-INT" };
        // It may have ended already.
        let _ = Command::new("kill")
            .args([signal, &run.id().to_string()])
            .stderr(Stdio::null())
            .status();
        let status = run.wait().unwrap();
        ended += usize::from(!status.success());
        let after = files(&bench.path("out"));
        assert!(
            after == before || after == sets[which],
            "round {round}: {:?}",
            after.keys()
        );
    }
    assert!(ended > 0, "no run was interrupted");
}
