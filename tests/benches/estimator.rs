//! What the state-based estimator costs, over being told the faults and over no fault tolerance, by what happens: the
//! table of docs/estimator.md.
#![allow(missing_docs)]

#[path = "../random_plants/mod.rs"]
mod random_plants;
#[path = "../random_runs/mod.rs"]
mod random_runs;

use random_runs::{Bench, Change, Cost, Fault, quantile};

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
    let mut bench = Bench::seeded(SEED);
    println!(
        "| what happens | runs | over told: half | 95 % | worst | at most 1.05 | over none: half | 95 % | worst | at most 1.05 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for change in Change::ALL {
        row(change.name(), &bench.runs(Some(change), None));
    }
    for fault in Fault::ABRUPT
        .into_iter()
        .chain([Fault::Stuck, Fault::Drift])
    {
        row(fault.name(), &bench.runs(None, Some(fault)));
    }
    for change in Change::ALL {
        let both = format!("bias, and {}", change.name());
        row(&both, &bench.runs(Some(change), Some(Fault::Bias)));
    }
}
