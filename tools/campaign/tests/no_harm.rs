//! What the default estimator does over random faults, on plants that are not quite the model: nearly
//! never worse than no fault tolerance, and nothing to a healthy loop. A drift is left out: it cannot be
//! told from a load (README, Known limits).
//!
//! promise: no-harm
#![allow(missing_docs)]

use campaign::{Options, Outcome, draw, run_one};
use ftc_control::Controller;
use ftc_control::parameters::EstimatorMethod;
use ftc_design::Design;
use ftc_plant::scenario::FaultKind;
use rayon::prelude::*;
use std::path::Path;

/// Runs per example; the seed was not used while the estimator was made.
const RUNS: u64 = 120;
const SEED: u64 = 20_261_127;
/// Largest relative error of an entry of the true plant's matrices.
const MODEL_ERROR: f64 = 0.1;

/// An example with the default estimator in place of its own.
fn design(example: &str) -> Design {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut request = design_file::read(&examples.join(example)).unwrap().request;
    request.estimator = ftc_design::assembly::EstimatorSpec {
        disturbance: request.estimator.disturbance,
        threshold: request.estimator.threshold,
        ..Default::default()
    };
    assert_eq!(request.estimator.method, EstimatorMethod::Observer);
    ftc_design::assembly::assemble(request).unwrap()
}

/// Of each run without a drift: whether it has no fault, and its true root mean square error over that
/// without fault tolerance.
fn over_none(example: &str) -> Vec<(bool, f64)> {
    let design = design(example);
    let controller = Controller::new(design.parameters()).unwrap();
    let mut options = Options::default();
    (options.seed, options.model_error) = (SEED, MODEL_ERROR);
    let run = |run: u64| {
        let events = draw(&design, &options, run).scenario.events;
        if events
            .iter()
            .any(|event| matches!(event.kind, FaultKind::Drift { .. }))
        {
            return None;
        }
        let Outcome { error, .. } = run_one(&design, &controller, &options, run);
        Some((events.is_empty(), error[0] / error[1]))
    };
    (0..RUNS).into_par_iter().filter_map(run).collect()
}

#[test]
fn hardly_ever_worse_than_no_fault_tolerance() {
    let examples = ["paper.toml", "paper_latency.toml", "tank.toml"];
    let runs: Vec<_> = examples.iter().flat_map(|name| over_none(name)).collect();
    let worse = runs.iter().filter(|(_, ratio)| *ratio > 1.05).count();
    let worst = |healthy: bool| {
        let of_kind = runs.iter().filter(|(none, _)| !healthy || *none);
        of_kind.map(|(_, ratio)| *ratio).fold(0.0, f64::max)
    };
    println!(
        "{worse} of {} worse, worst {:.3}, healthy {:.3}",
        runs.len(),
        worst(false),
        worst(true)
    );
    assert!(100 * worse <= runs.len(), "{worse} of {}", runs.len());
    assert!(worst(true) <= 1.05, "{}", worst(true));
}
