//! A design that was solved is not solved again, and never used where it does not belong.
//!
//! promise: kept-design

mod common;

use common::{Bench, FILE, SOUND, damaged};
use std::fs;

#[test]
fn a_kept_design_gives_the_same_run() {
    let bench = Bench::new(SOUND);
    let run = bench.run(&["design", FILE, "--save", "solved.json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let kept = bench.run(&["simulate", FILE, "--solved", "solved.json", "--out", "kept"]);
    assert_eq!(kept.code(), 0, "{}", kept.stderr());
    let anew = bench.run(&["simulate", FILE, "--out", "anew"]);
    assert_eq!(anew.code(), 0, "{}", anew.stderr());
    let table = |folder: &str| fs::read(bench.path(folder).join("trajectories.csv")).unwrap();
    assert_eq!(table("kept"), table("anew"));
}

#[test]
fn a_place_or_a_key_that_cannot_serve_is_refused_before_anything_is_solved() {
    // Were it solved first, the sentence would be that of a design with no solution.
    let infeasible = damaged("decay = 0.7\noutput", "decay = 0.001\noutput");
    let bench = Bench::new(infeasible.replace("latency = 0", "latency = 1"));
    let run = bench.run(&["design", FILE, "--save", "none/solved.json"]);
    assert_eq!(run.code(), 2, "{}", run.stderr());
    let words = "--save none/solved.json: cannot be written to (No such file or directory";
    assert!(run.stderr().contains(words), "{}", run.stderr());
    assert!(!run.stderr().contains(".ftc-fmu"), "{}", run.stderr());
    let run = bench.run(&["export", FILE, "--out", "out", "--sign", FILE]);
    assert_eq!(run.code(), 2, "{}", run.stderr());
    assert!(
        run.stderr().contains("is no such key: name"),
        "{}",
        run.stderr()
    );
    assert_eq!(bench.files(), [FILE]);
}

#[test]
fn a_kept_design_is_refused_where_it_does_not_belong() {
    let bench = Bench::new(SOUND);
    let run = bench.run(&["design", FILE, "--save", "solved.json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let kept = fs::read_to_string(bench.path("solved.json")).unwrap();
    let refused = |design: &str, kept: &[u8], word: &str| {
        fs::write(bench.path("other.toml"), design).unwrap();
        fs::write(bench.path("kept.json"), kept).unwrap();
        let run = bench.run(&[
            "export",
            "other.toml",
            "--solved",
            "kept.json",
            "--out",
            "out",
        ]);
        assert_eq!(run.code(), 2, "{}", run.stdout());
        assert!(run.stderr().contains(word), "{}", run.stderr());
        assert!(run.stderr().contains("--save"), "{}", run.stderr());
        assert!(!bench.path("out").exists());
    };
    let other = SOUND.replace("decay = 0.7\noutput", "decay = 0.75\noutput");
    refused(&other, kept.as_bytes(), "another design file");
    // One digit changed inside the design's own text, then half of the file, then none of it.
    let at = kept.rfind("0.").unwrap() + 2;
    let digit = kept.as_bytes()[at];
    let mut changed = kept.clone().into_bytes();
    changed[at] = if digit == b'1' { b'2' } else { b'1' };
    refused(SOUND, &changed, "damaged");
    refused(
        SOUND,
        &kept.as_bytes()[..kept.len() / 2],
        "not a solved design",
    );
    refused(SOUND, b"", "not a solved design");
}
