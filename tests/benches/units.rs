//! 200 random plants, each in its own units and in units spread from 1e-6 to 1e6: how often the two
//! verdicts differ, the largest difference of gamma, and how often the structured solver fell short.
//! Fails where a plant is refused in one of the two.
#![allow(missing_docs)]

#[path = "../plants/mod.rs"]
mod plants;

use ftc_design::state_feedback::synthesise_with;
use ftc_design::{DesignError, Run, StateFeedback, Step};
use ftc_plant::scaling::Scaling;
use plants::{in_units, random_plant, spread_units, usual_spec};
use std::sync::atomic::{AtomicUsize, Ordering};

fn main() {
    let fallbacks = AtomicUsize::new(0);
    let count = |step: Step| {
        if step == Step::GeneralSolver {
            fallbacks.fetch_add(1, Ordering::Relaxed);
        }
    };
    let mut run = Run::default();
    run.watch = &count;
    let (mut designed, mut infeasible, mut worst) = (0, 0, 0.0_f64);
    let mut refused = Vec::new();
    for seed in 0..200 {
        let plant = random_plant(seed, 1.0);
        let dims = plant.dimensions();
        let spec = usual_spec(seed, dims);
        let (twin, twin_spec) = in_units(&plant, &spec, &spread_units(seed, dims));
        let design = |plant, spec| -> Result<StateFeedback, DesignError> {
            synthesise_with(plant, spec, &Scaling::automatic(plant), &run)
        };
        match (design(&plant, &spec), design(&twin, &twin_spec)) {
            (Ok(own), Ok(other)) => {
                designed += 1;
                let pairs = own.gamma.unwrap_or_default().into_iter();
                for (own, other) in pairs.zip(other.gamma.unwrap_or_default()) {
                    worst = worst.max((own / other - 1.0).abs());
                }
            }
            (Err(DesignError::Infeasible(_)), Err(DesignError::Infeasible(_))) => infeasible += 1,
            (own, other) => refused.push((seed, own.err(), other.err())),
        }
    }
    println!(
        "| plants | designed in both units | infeasible in both | other | gamma differs by at most | general solver asked |"
    );
    println!("|---|---|---|---|---|---|");
    println!(
        "| 200 | {designed} | {infeasible} | {} | {worst:.1e} | {} |",
        refused.len(),
        fallbacks.load(Ordering::Relaxed)
    );
    assert!(refused.is_empty(), "{refused:?}");
    assert!(worst < 1e-4, "gamma differs by {worst}");
}
