//! What the state-based estimator is for, on plants drawn at random: an abrupt fault costs hardly more than being
//! told it, and a plant that changes, or answers late, is not taken for one. The table of all kinds is in docs/estimator.md.
//!
//! promise: as-told

mod random_plants;
mod random_runs;

use random_runs::{Bench, Change, Fault, quantile};

/// One constant was chosen by its runs and others: how long the assumed model error counts (`model_prior`).
const SEED: u64 = 20_261_129;

#[test]
fn an_abrupt_fault_costs_hardly_more_than_being_told_it() {
    let mut bench = Bench::seeded(SEED);
    let kinds = Fault::ABRUPT.into_iter();
    let costs: Vec<_> = kinds
        .flat_map(|fault| bench.runs(None, Some(fault)))
        .collect();
    let [half, most] = [0.5, 0.95].map(|share| quantile(costs.iter().map(|cost| cost.told), share));
    println!(
        "{} runs over told: half {half:.4}, 95 % {most:.4}",
        costs.len()
    );
    assert!(half <= 1.01 && most <= 1.05, "{half} {most}");
}

#[test]
fn the_same_while_the_plant_changes() {
    let mut bench = Bench::seeded(SEED);
    let kinds = Change::LOADS.into_iter();
    let costs: Vec<_> = kinds
        .flat_map(|change| bench.runs(Some(change), Some(Fault::Bias)))
        .collect();
    let most = quantile(costs.iter().map(|cost| cost.told), 0.9);
    println!("{} runs over told: 90 % {most:.4}", costs.len());
    assert!(most <= 1.1, "{most}");
}

#[test]
fn a_plant_that_changes_is_not_taken_for_a_fault() {
    let mut bench = Bench::seeded(SEED);
    let kinds = Change::LOADS.into_iter();
    let costs: Vec<_> = kinds
        .flat_map(|change| bench.runs(Some(change), None))
        .collect();
    let most = quantile(costs.iter().map(|cost| cost.none), 0.99);
    println!("{} runs over none: 99 % {most:.4}", costs.len());
    assert!(most <= 1.1, "{most}");
}

#[test]
fn readings_that_come_a_sample_late_are_not_taken_for_faults() {
    let costs = Bench::seeded(SEED).runs(Some(Change::Late), None);
    let [most, worst] =
        [0.95, 1.0].map(|share| quantile(costs.iter().map(|cost| cost.none), share));
    println!(
        "{} runs over none: 95 % {most:.4}, worst {worst:.3}",
        costs.len()
    );
    assert!(most <= 1.1 && worst <= 3.0, "{most} {worst}");
}
