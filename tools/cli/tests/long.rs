//! Long scenarios: what they take is said before the design begins, and memory does not grow with them.
//!
//! promise: long-scenarios

mod common;

use common::{Bench, FILE, damaged};

fn of_length(steps: u64) -> String {
    damaged("steps = 60", &format!("steps = {steps}"))
        .replace("method = \"reference\"", "method = \"observer\"")
        .replace("database = \"commission\"\n", "")
}

#[test]
fn what_a_long_simulation_takes_is_said_before_the_design_begins() {
    // The design itself fails, so that nothing after it can have said anything.
    let bench = Bench::new(of_length(1_000_000).replacen("decay = 0.7", "decay = 0.001", 1));
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let note = run.stderr().lines().next().unwrap_or_default().to_owned();
    for word in [
        "note: the simulation will take about",
        "1000000 samples",
        "on the disk",
    ] {
        assert!(note.contains(word), "{}", run.stderr());
    }
    let short = Bench::new(of_length(60)).run(&["simulate", FILE, "--out", "out"]);
    assert!(!short.stderr().contains("note:"), "{}", short.stderr());
    let quiet = bench.run(&["simulate", FILE, "--out", "out", "--quiet"]);
    assert!(!quiet.stderr().contains("note:"), "{}", quiet.stderr());
}

/// The most memory that any child of this process has had, in bytes.
#[cfg(target_os = "linux")]
fn peak() -> u64 {
    let mut usage = std::mem::MaybeUninit::<libc::rusage>::zeroed();
    // SAFETY: the structure is large enough and written by the call.
    let usage = unsafe {
        assert_eq!(
            libc::getrusage(libc::RUSAGE_CHILDREN, usage.as_mut_ptr()),
            0
        );
        usage.assume_init()
    };
    usage.ru_maxrss as u64 * 1024
}

/// Each sample of the three runs takes some 2 kB where it is kept, 120 MB for this scenario.
#[test]
#[cfg(target_os = "linux")]
fn memory_does_not_grow_with_the_scenario() {
    let simulate = |steps| {
        let bench = Bench::new(of_length(steps));
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let table = std::fs::read_to_string(bench.path("out/trajectories.csv")).unwrap();
        assert_eq!(table.lines().count() as u64, steps + 1);
        peak()
    };
    let short = simulate(25_000);
    let long = simulate(75_000);
    assert!(long < 150 << 20, "{long} bytes");
    assert!(long - short < 20 << 20, "{short} bytes, then {long}");
}
