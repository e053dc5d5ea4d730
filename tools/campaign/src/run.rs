//! One run, and what came of it.

use crate::Options;
use crate::draw::{Drawn, draw};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_simulate::detection::{Detection, FaultDetection};
use ftc_simulate::{PlantSimulator, Variant, closed_loop};
use serde::{Deserialize, Serialize};

/// Errors beyond this one are all alike: the loop has diverged.
const DIVERGED: f64 = 1e12;

/// What came of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Outcome {
    /// Its number.
    pub run: u64,
    /// Root mean square of the true tracking error, in nominal values, over samples and tracked
    /// outputs: with fault tolerance, without, told the fault.
    pub error: [f64; 3],
    /// The faults, in the order in which they were drawn.
    pub faults: Vec<FaultDetection>,
    /// Per sensor (p): how often it was flagged while it was healthy.
    pub false_alarms: Vec<u64>,
    /// Per sensor (p): samples in which it was healthy.
    pub healthy_samples: Vec<u64>,
    /// Where there was one fault: its sensor, and the first sensor flagged while it lasted.
    pub isolation: Option<(usize, Option<usize>)>,
    /// Switches between modes.
    pub switches: u64,
    /// Largest relative error of the model.
    pub model_error: f64,
    /// Noise, relative to the scenario.
    pub noise: f64,
    /// The mode (from 0) in which the true plant is unstable while the model is not, and the spectral
    /// radius of its `A`; of several the largest.
    pub unstable: Option<(usize, f64)>,
}

/// Does run number `run`.
pub fn run_one(design: &Design, controller: &Controller, options: &Options, run: u64) -> Outcome {
    let drawn = draw(design, options, run);
    let (outputs, te) = (&design.signals.outputs, design.plant.sample_time);
    let mut detection = Detection::new(&drawn.scenario.events, outputs.len(), te);
    let plant = PlantSimulator::with_true_plant(
        design.plant.clone(),
        drawn.true_plant.clone(),
        drawn.scenario.clone(),
    );
    let tracked = &design.controller.feedback.tracked;
    let error = [Variant::Ftc, Variant::NoFtc, Variant::ToldTheFault].map(|variant| {
        let mut squares = 0.0;
        let stalled = closed_loop::visit(&plant, controller, variant, &mut |seen| {
            squares += seen.square_error(tracked, outputs);
            if variant == Variant::Ftc {
                detection.see(seen);
            }
        });
        let count = drawn.scenario.steps * tracked.len() as u64;
        let error = (squares / count.max(1) as f64).sqrt();
        match stalled {
            None if error < DIVERGED => error,
            _ => DIVERGED,
        }
    });
    Outcome {
        run,
        error,
        isolation: detection.isolation(),
        faults: detection.faults,
        false_alarms: detection.false_alarms,
        healthy_samples: detection.healthy_samples,
        switches: drawn.scenario.schedule.len() as u64 - 1,
        model_error: drawn.model_error,
        noise: drawn.noise,
        unstable: unstable(design, &drawn),
    }
}

/// The most unstable of the modes that the true plant's matrices make unstable.
fn unstable(design: &Design, drawn: &Drawn) -> Option<(usize, f64)> {
    let lost = drawn.true_plant.linear(&design.plant);
    let lost = lost.destabilised(&design.plant);
    let largest = lost.iter().max_by(|a, b| a.radius.total_cmp(&b.radius))?;
    Some((largest.mode, largest.radius))
}
