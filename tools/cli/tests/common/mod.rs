//! Runs the real binary in a directory of its own.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A sound design of two states, one disturbance and two modes, to be damaged by the tests.
pub const SOUND: &str = r#"name = "sound"
sample_time = 1.0

[[mode]]
name = "first"
A = [[0.6, 0.45], [-0.2, 0.3]]
B = [[0.0, 1.0], [1.0, 0.0]]
C = [[1.0, 0.0], [0.0, 1.0]]
E = [[1.0], [1.0]]
operating_point = { x = [0, 0], u = [0, 0], y = [0, 0] }

[[mode]]
name = "second"
A = [[0.4, -0.3], [0.11, 0.0]]
B = [[1.0, 0.0], [0.0, 1.0]]
C = [[1.0, 0.0], [0.0, 1.0]]
E = [[1.0], [1.0]]

[signals]
outputs = [{ name = "a", unit = "V", nominal = 1.0, min = -5.0, max = 5.0 }, { name = "b" }]

[disturbance]
period = 314.0
harmonics = 1

[controller]
tracked = [1, 2]
latency = 0
lyapunov = "common"
decay = 0.7
output_weight = 1.0
integral_weight = 0.3
input_weight = [0.1, 0.1]

[observer]
kind = "uio"
decay = 0.7

[estimator]
method = "reference"
database = "commission"
sigmas = 6.0
debounce = 1

[compensation]
method = "virtual-sensor"

[scenario]
steps = 60
noise = 0.005
seed = 3
schedule = [{ from = 0, mode = 1 }, { from = 30, mode = 2 }]
reference = [{ kind = "steps", points = [[0, 0.6], [20, -0.3]] }, { kind = "square", amplitude = 1, period = 20 }]
fault = [0.0, { kind = "steps", points = [[28, 0.5]] }]
disturbance = [{ kind = "sine", amplitude = 0.04, period = 314 }]
events = [{ kind = "stuck", sensor = 1, from = 50 }]
"#;

/// A temporary directory with a design file in it.
pub struct Bench {
    folder: TempDir,
}

/// The name of the design file.
pub const FILE: &str = "design.toml";

impl Bench {
    /// A directory with this design file.
    pub fn new(design: impl AsRef<[u8]>) -> Self {
        let bench = Self::empty();
        fs::write(bench.path(FILE), design).unwrap();
        bench
    }

    /// A directory without a design file.
    pub fn empty() -> Self {
        Self {
            folder: TempDir::new().unwrap(),
        }
    }

    /// A path inside the directory.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The figures of merit that `simulate` left in `out`.
    pub fn metrics(&self) -> serde_json::Value {
        serde_json::from_slice(&fs::read(self.path("out/metrics.json")).unwrap()).unwrap()
    }

    /// Runs `ftc-fmu` inside the directory.
    pub fn run(&self, arguments: &[&str]) -> Outcome {
        let output = Command::new(env!("CARGO_BIN_EXE_ftc-fmu"))
            .args(arguments)
            .current_dir(self.folder.path())
            .output()
            .unwrap();
        Outcome(output)
    }

    /// Everything in the directory, hidden files included, in alphabetical order.
    pub fn files(&self) -> Vec<String> {
        let mut names = Vec::new();
        collect(self.folder.path(), Path::new(""), &mut names);
        names.sort();
        names
    }
}

fn collect(root: &Path, below: &Path, names: &mut Vec<String>) {
    for entry in fs::read_dir(root.join(below)).unwrap() {
        let path = below.join(entry.unwrap().file_name());
        names.push(path.display().to_string());
        if root.join(&path).is_dir() {
            collect(root, &path, names);
        }
    }
}

/// What a run left behind.
pub struct Outcome(Output);

impl Outcome {
    pub fn code(&self) -> i32 {
        self.0.status.code().unwrap_or(-1)
    }

    pub fn stdout(&self) -> String {
        String::from_utf8(self.0.stdout.clone()).unwrap()
    }

    pub fn stderr(&self) -> String {
        String::from_utf8(self.0.stderr.clone()).unwrap()
    }

    /// Standard output as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout()).unwrap()
    }
}

/// `SOUND` with one passage replaced; the passage must be there.
pub fn damaged(from: &str, to: &str) -> String {
    assert!(SOUND.contains(from), "the sound design has no '{from}'");
    SOUND.replacen(from, to, 1)
}

/// A copy of the program with binaries of our own making beside it.
pub fn installed(bench: &Bench, binaries: &[&str]) -> std::path::PathBuf {
    let program = bench.path("bin/ftc-fmu");
    fs::create_dir(bench.path("bin")).unwrap();
    // Another process copies: a child that another test starts meanwhile would inherit our open
    // file, and a program that is open for writing cannot be run.
    let copied = Command::new("cp")
        .arg(env!("CARGO_BIN_EXE_ftc-fmu"))
        .arg(&program)
        .status()
        .unwrap();
    assert!(copied.success());
    for binary in binaries {
        let path = bench.path("bin").join(binary);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, binary).unwrap();
    }
    program
}

/// Exports the design with this copy of the program.
pub fn export(bench: &Bench, program: &Path, out: &str) -> std::process::Output {
    Command::new(program)
        .args(["export", FILE, "--out", out])
        .current_dir(bench.path("."))
        .output()
        .unwrap()
}

/// The contents of an archive by name; they must be in alphabetical order.
pub fn unzip(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut archive = zip::ZipArchive::new(Cursor::new(fs::read(path).unwrap())).unwrap();
    let mut files = BTreeMap::new();
    let mut order = Vec::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).unwrap();
        let name = file.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        order.push(name.clone());
        files.insert(name, bytes);
    }
    assert!(order.is_sorted(), "{order:?}");
    files
}
