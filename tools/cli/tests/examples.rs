//! The examples that the program brings along.

mod common;

use common::Bench;
use std::fs;
use std::path::Path;

#[test]
fn every_design_file_and_script_of_the_repository_is_an_example() {
    let bench = Bench::empty();
    let listed = bench.run(&["example"]);
    assert_eq!(listed.code(), 0, "{}", listed.stderr());
    let listed = listed.stdout();
    let names: Vec<&str> = listed
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    for name in &names {
        let run = bench.run(&["example", name, "--out", "given"]);
        assert_eq!(run.code(), 0, "{name}: {}", run.stderr());
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut compared = 0;
    for folder in [root.clone(), root.join("python")] {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap();
            if path.is_file() && name != "record.py" {
                let given = bench.path("given").join(name);
                assert_eq!(
                    fs::read(&path).unwrap(),
                    fs::read(given).unwrap(),
                    "{name:?}"
                );
                compared += 1;
            }
        }
    }
    assert!(compared >= names.len());
}

#[test]
fn an_example_can_be_designed_where_it_was_written() {
    let bench = Bench::empty();
    let run = bench.run(&["example", "logged.toml", "--out", "new/folder"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let designed = bench.run(&["design", "new/folder/logged.toml"]);
    assert_eq!(designed.code(), 0, "{}", designed.stderr());
}

#[test]
fn an_example_that_is_not_there_is_refused_with_those_that_are() {
    let bench = Bench::empty();
    let run = bench.run(&["example", "reactor"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("no example \"reactor\""),
        "{}",
        run.stderr()
    );
    assert!(run.stderr().contains("quadruple_tank"), "{}", run.stderr());
    assert_eq!(bench.files(), [] as [&str; 0]);
}
