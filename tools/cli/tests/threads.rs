//! Any number of threads makes the same design, to the byte.
//!
//! promise: any-threads

mod common;

use common::{Bench, FILE, SOUND, damaged};
use std::fs;

/// `SOUND` with a third mode, so that there is more than one part for each of two threads.
fn three_modes(design: &str) -> String {
    let third = r#"
[[mode]]
name = "third"
A = [[0.5, 0.1], [0.0, 0.2]]
B = [[1.0, 0.2], [0.0, 1.0]]
C = [[1.0, 0.0], [0.0, 1.0]]
E = [[1.0], [1.0]]

[signals]"#;
    design.replacen("\n[signals]", third, 1)
}

fn dwell() -> String {
    three_modes(&damaged("lyapunov = \"common\"", "lyapunov = \"dwell\""))
}

#[test]
fn the_design_is_the_same_for_any_number_of_threads() {
    let general = dwell().replace("kind = \"uio\"", "kind = \"auto\"");
    for (design, more) in [
        (dwell(), vec![]),
        (general, vec![]),
        (dwell(), vec!["--solver", "clarabel"]),
        (three_modes(SOUND), vec![]),
    ] {
        let bench = Bench::new(&design);
        let made: Vec<(Vec<u8>, String)> = ["1", "2", "3", "8"]
            .iter()
            .map(|threads| {
                let arguments = [
                    "design",
                    FILE,
                    "--json",
                    "--save",
                    "kept",
                    "--threads",
                    threads,
                ];
                let run = bench.run(&[&arguments[..], &more].concat());
                assert_eq!(run.code(), 0, "{}", run.stderr());
                (fs::read(bench.path("kept")).unwrap(), run.stdout())
            })
            .collect();
        assert!(made.iter().all(|other| *other == made[0]));
    }
}

#[test]
fn a_verdict_is_the_same_for_any_number_of_threads() {
    let bench = Bench::new(dwell().replacen("decay = 0.7", "decay = 0.001", 1));
    let said = |threads| bench.run(&["design", FILE, "--json", "--threads", threads]);
    let (one, four) = (said("1"), said("4"));
    assert_eq!((one.code(), four.code()), (1, 1), "{}", one.stderr());
    assert_eq!((one.stdout(), one.stderr()), (four.stdout(), four.stderr()));
    assert_eq!(bench.run(&["design", FILE, "--threads", "0"]).code(), 2);
}
