//! A campaign gives the same numbers however it is cut, and they are those of its runs.
//!
//! promise: exact-campaign
#![allow(missing_docs)]

mod examples;

use campaign::{MergeError, Options, Partial, draw, merge, run_one, run_shard, shard};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::TruePlant;
use proptest::prelude::*;
use std::sync::OnceLock;

/// The paper's example, shortened.
fn design() -> &'static Design {
    static DESIGN: OnceLock<Design> = OnceLock::new();
    DESIGN.get_or_init(|| examples::design("paper.toml", |request| request.scenario.steps = 300))
}

fn whole() -> &'static Partial {
    static WHOLE: OnceLock<Partial> = OnceLock::new();
    WHOLE.get_or_init(|| run_shard(design(), &Options::default(), 0..40))
}

fn in_threads(threads: usize, range: std::ops::Range<u64>) -> Partial {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| run_shard(design(), &Options::default(), range))
}

#[test]
fn any_number_of_threads_gives_the_same() {
    assert_eq!(in_threads(1, 0..40), *whole());
    assert_eq!(in_threads(3, 0..40), *whole());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    /// To the last digit, in any order, and written as JSON and read back.
    #[test]
    fn any_cut_in_any_order_merges_to_the_same(cuts in prop::collection::vec(0u64..=40, 1..4), turn in 0usize..4) {
        let mut ends = cuts;
        ends.extend([0, 40]);
        ends.sort_unstable();
        let mut parts: Vec<Partial> = ends
            .windows(2)
            .map(|pair| run_shard(design(), &Options::default(), pair[0]..pair[1]))
            .map(|part| serde_json::from_str(&serde_json::to_string(&part).unwrap()).unwrap())
            .collect();
        let middle = turn % parts.len();
        parts.rotate_left(middle);
        prop_assert_eq!(&merge(parts).unwrap(), whole());
    }
}

#[test]
fn a_run_is_never_counted_twice() {
    let options = Options::default();
    let part = |range| run_shard(design(), &options, range);
    assert_eq!(merge([part(0..5), part(4..6)]), Err(MergeError::Overlap(4)));
    assert_eq!(merge([part(0..5), part(0..5)]), Err(MergeError::Overlap(0)));
    assert_eq!(merge([]), Err(MergeError::Empty));
    let other = run_shard(design(), &options.with_seed(2), 5..6);
    assert_eq!(merge([part(0..5), other]), Err(MergeError::Options));
    let mut changed = design().clone();
    changed.scenario.steps += 1;
    let foreign = run_shard(&changed, &options, 5..6);
    assert_eq!(merge([part(0..5), foreign]), Err(MergeError::Design));
    let holes = merge([part(6..8), part(0..3)]).unwrap();
    assert_eq!(holes.done, [[0, 3], [6, 8]]);
    assert_eq!(holes.missing(0..10), [3..6, 8..10]);
    assert_eq!(
        holes.missing(2..7),
        std::iter::once(3..6).collect::<Vec<_>>()
    );
    assert_eq!(holes.missing(0..2), []);
    assert_eq!(merge([holes, part(3..6)]).unwrap().done, [[0, 8]]);
}

#[test]
fn shards_cover_every_run_once() {
    for (runs, count) in [(10_000, 3), (7, 10), (1, 1), (0, 4)] {
        let shards: Vec<_> = (1..=count).map(|index| shard(runs, index, count)).collect();
        assert_eq!(shards[0].start, 0);
        assert_eq!(shards[shards.len() - 1].end, runs);
        assert!(shards.windows(2).all(|pair| pair[0].end == pair[1].start));
    }
}

/// The statistics are those of the runs, counted here a second time.
#[test]
fn statistics_are_those_of_the_runs() {
    let (options, controller) = (
        Options::default(),
        Controller::new(design().parameters()).unwrap(),
    );
    let outcomes: Vec<_> = (0..40)
        .map(|run| run_one(design(), &controller, &options, run))
        .collect();
    let statistics = &whole().statistics;
    assert_eq!(statistics.runs, 40);
    let mut ratios: Vec<f64> = outcomes.iter().map(|o| o.error[0] / o.error[2]).collect();
    ratios.sort_by(f64::total_cmp);
    let median = statistics.over_told.quantile(0.5).unwrap();
    assert!((median / ratios[19] - 1.0).abs() < 0.011);
    let faulty = outcomes.iter().filter(|o| !o.faults.is_empty()).count() as u64;
    assert_eq!(statistics.faulty_runs, faulty);
    let seen = outcomes
        .iter()
        .flat_map(|o| &o.faults)
        .filter(|f| !f.hidden);
    let (count, detected) = seen.fold((0, 0), |(all, found), fault| {
        (all + 1, found + u64::from(fault.delay.is_some()))
    });
    let kinds = statistics.kinds.values();
    let sums = kinds.fold((0, 0), |(all, found), kind| {
        (all + kind.count, found + kind.detected)
    });
    assert_eq!((count, detected), sums);
    let worst = statistics.worst[0].over_told;
    assert!((worst / ratios[39] - 1.0).abs() < 1e-9);
    assert_eq!(statistics.worst.len(), 10);
}

/// Fault tolerance is what it says in the middle of the distribution.
#[test]
fn the_paper_s_example_gains_from_fault_tolerance() {
    let statistics = &whole().statistics;
    assert!(statistics.over_told.quantile(0.5).unwrap() < 1.2);
    let gain =
        statistics.error_without.quantile(0.9).unwrap() / statistics.error.quantile(0.9).unwrap();
    assert!(gain > 1.5, "{gain}");
}

#[test]
fn what_is_drawn_stays_in_its_bounds() {
    let options = Options::default();
    let mut kinds = std::collections::BTreeSet::new();
    for run in 0..300 {
        let drawn = draw(design(), &options, run);
        assert_eq!(drawn, draw(design(), &options, run));
        assert!(drawn.scenario.events.len() <= 2);
        assert!((0.5..=2.0).contains(&drawn.noise) && drawn.model_error <= options.model_error);
        for event in &drawn.scenario.events {
            assert!(event.sensor < 2 && event.from >= 30.0 && event.until > event.from);
            kinds.insert(
                std::mem::discriminant(&event.kind)
                    == std::mem::discriminant(&ftc_plant::scenario::FaultKind::Stuck),
            );
        }
        let TruePlant::Linear { plant } = &drawn.true_plant else {
            panic!("no linear plant")
        };
        let nominal = &design().plant.modes[0].a;
        let off = (&plant.modes[0].a - nominal).component_div(nominal);
        assert!(off.amax() <= options.model_error);
        let schedule = &drawn.scenario.schedule;
        assert_eq!(schedule[0].from, 0.0);
        assert!(
            schedule
                .windows(2)
                .all(|pair| pair[0].mode != pair[1].mode && pair[0].from < pair[1].from)
        );
    }
    assert_eq!(kinds.len(), 2);
}

/// The page holds its numbers and no script.
#[test]
fn the_page_and_the_json_hold_the_numbers() {
    let page = campaign::page::html(design(), whole(), 50);
    assert!(page.contains("campaign of 40 runs") && page.contains("40 of the 50 runs"));
    assert!(!page.contains("<script"));
    let json = campaign::page::json(whole(), 50).to_string();
    assert_eq!(campaign::page::read(&json).unwrap(), (whole().clone(), 50));
    assert!(campaign::page::read("{}").is_err());
}

#[test]
fn rows_are_a_parquet_file() {
    let controller = Controller::new(design().parameters()).unwrap();
    let outcomes: Vec<_> = (0..3)
        .map(|run| run_one(design(), &controller, &Options::default(), run))
        .collect();
    let mut bytes = Vec::new();
    let mut writer = campaign::rows::RowWriter::new(&mut bytes).unwrap();
    writer.write(&outcomes[..2]).unwrap();
    writer.write(&outcomes[2..]).unwrap();
    writer.finish().unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
}
