//! Campaigns that were cut into shards or interrupted: put together and gone on with, the same bytes.
//!
//! promise: exact-campaign
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, SOUND, damaged};
use std::fs;

/// Runs `campaign` with these arguments, which must go well; returns what it prints.
fn campaign(bench: &Bench, arguments: &[&str]) -> String {
    let run = bench.run(&[&["campaign", FILE], arguments].concat());
    assert_eq!(run.code(), 0, "{arguments:?}: {}", run.stderr());
    run.stdout()
}

fn result(bench: &Bench, folder: &str) -> String {
    fs::read_to_string(bench.path(folder).join("campaign.json")).unwrap()
}

#[test]
fn shards_are_merged_without_saying_again_how_many_runs_there_are() {
    let bench = Bench::new(SOUND);
    campaign(&bench, &["--runs", "14", "--out", "whole"]);
    for shard in ["1/3", "2/3", "3/3"] {
        let folder = &shard[..1];
        campaign(&bench, &["--runs", "14", "--shard", shard, "--out", folder]);
    }
    let parts = ["3/campaign.json", "1/campaign.json", "2/campaign.json"];
    let said = campaign(
        &bench,
        &[&["--out", "merged", "--merge"], &parts[..]].concat(),
    );
    assert!(!said.contains("runs were done"), "{said}");
    assert_eq!(result(&bench, "merged"), result(&bench, "whole"));
    let less = [
        "--runs", "14", "--out", "less", "--merge", parts[0], parts[1],
    ];
    let said = campaign(&bench, &less);
    let words = "warning: 9 of 14 runs were done: merge the other shards, too";
    assert!(said.contains(words), "{said}");
}

#[test]
fn an_earlier_result_that_cannot_be_read_is_refused_before_anything_is_solved() {
    // Were it solved first, the sentence would be that of a design with no solution.
    let infeasible = damaged("decay = 0.7\noutput", "decay = 0.001\noutput");
    let bench = Bench::new(infeasible.replace("latency = 0", "latency = 1"));
    for option in [&["--resume"][..], &["--merge", "none.json"]] {
        let run = bench.run(&[&["campaign", FILE, "--out", "part"], option].concat());
        assert_eq!(run.code(), 2, "{}", run.stderr());
        assert!(run.stderr().contains(option[0]), "{}", run.stderr());
    }
}

#[test]
fn an_interrupted_campaign_goes_on_to_as_many_runs_as_it_was_asked_for() {
    let bench = Bench::new(SOUND);
    campaign(&bench, &["--runs", "12", "--out", "whole"]);
    campaign(&bench, &["--runs", "5", "--out", "part"]);
    // As an interrupted run of twelve leaves it.
    let interrupted = result(&bench, "part").replace("\"asked\": 5", "\"asked\": 12");
    fs::write(bench.path("part/campaign.json"), interrupted).unwrap();
    campaign(&bench, &["--out", "part", "--resume"]);
    assert_eq!(result(&bench, "part"), result(&bench, "whole"));
    let run = bench.run(&[
        "campaign", FILE, "--out", "part", "--resume", "--shard", "1/2",
    ]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("give --runs of the whole campaign"),
        "{}",
        run.stderr()
    );
}
