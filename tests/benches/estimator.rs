//! What the state-based estimator costs, over being told the faults and over no fault tolerance, by what happens: the
//! table of docs/estimator.md. Other plants are drawn where seeds are given: `cargo bench -p ftc-tests --bench estimator -- 31337`.
#![allow(missing_docs)]

#[path = "../random_plants/mod.rs"]
mod random_plants;
#[path = "../random_runs/mod.rs"]
mod random_runs;

use random_runs::{Bench, Change, Cost, Fault, quantile};

/// No constant was chosen by its runs alone.
const SEED: u64 = 20_261_128;

fn short(value: f64) -> String {
    match value < 1000.0 {
        true => format!("{value:.2}"),
        false => format!("{value:.0e}"),
    }
}

fn row(name: &str, costs: &[Cost]) {
    let columns = [
        costs.iter().map(|cost| cost.told).collect::<Vec<_>>(),
        costs.iter().map(|cost| cost.none).collect(),
    ];
    let cells = columns.map(|ratios| {
        let of = |share| quantile(ratios.iter().copied(), share);
        let within = ratios.iter().filter(|&&ratio| ratio <= 1.05).count();
        format!(
            "{:.3} | {:.3} | {} | {:.1} %",
            of(0.5),
            of(0.95),
            short(of(1.0)),
            100.0 * within as f64 / ratios.len() as f64
        )
    });
    println!("| {name} | {} | {} |", costs.len(), cells.join(" | "));
}

fn main() {
    let given: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|word| word.parse().ok())
        .collect();
    match given.as_slice() {
        [] => table(SEED),
        seeds => seeds.iter().copied().for_each(table),
    }
}

fn table(seed: u64) {
    let mut bench = Bench::seeded(seed);
    println!(
        "| what happens | runs | over told: half | 95 % | worst | at most 1.05 | over none: half | 95 % | worst | at most 1.05 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut healthy = Vec::new();
    for change in Change::ALL {
        let costs = bench.runs(Some(change), None);
        row(change.name(), &costs);
        if Change::LOADS.contains(&change) {
            healthy.extend(costs);
        }
    }
    let mut abrupt = Vec::new();
    for fault in Fault::ABRUPT {
        let costs = bench.runs(None, Some(fault));
        row(fault.name(), &costs);
        abrupt.extend(costs);
    }
    for fault in Fault::SLOW {
        row(fault.name(), &bench.runs(None, Some(fault)));
    }
    for change in Change::ALL {
        let both = format!("bias, and {}", change.name());
        row(&both, &bench.runs(Some(change), Some(Fault::Bias)));
    }
    let most = quantile(abrupt.iter().map(|cost| cost.told), 0.95);
    let harm = quantile(healthy.iter().map(|cost| cost.none), 0.99);
    println!(
        "\nSeed {seed}: abrupt faults, 95 % at most {most:.3} over told; loads, gains and matrices, no fault, 99 % at most \
         {harm:.3} over none.\n"
    );
}
