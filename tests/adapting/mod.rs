//! Loops with and without adaptation, on plants that may have changed, under random faults.
#![allow(dead_code, missing_docs)]

use crate::random_plants::{RandomNumbers, design};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::TruePlant;
use ftc_plant::scenario::{FaultEvent, FaultKind, ModeInterval};
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run};

pub const STEPS: u64 = 6000;

/// Six faults of random kind, sensor, size and time.
pub fn with_faults(design: &mut Design, random: &mut RandomNumbers) {
    let te = design.plant.sample_time;
    let sensors = design.controller.estimator.thresholds.len();
    design.scenario.steps = STEPS;
    design.scenario.schedule = (0..3)
        .map(|k| ModeInterval {
            from: 2000.0 * f64::from(k) * te,
            mode: (k % 2) as usize,
        })
        .collect();
    design.scenario.events = (0..6)
        .map(|_| {
            let sensor = random.count(0, sensors - 1);
            let size = design.controller.estimator.thresholds[sensor] * random.between(-20.0, 20.0);
            let from = random.between(600.0, 5400.0);
            let kind = match random.count(0, 3) {
                0 => FaultKind::Bias { size },
                1 => FaultKind::Drift {
                    slope: size / (100.0 * te),
                },
                2 => FaultKind::Intermittent {
                    size,
                    period: 50.0 * te,
                },
                _ => FaultKind::Dropout,
            };
            FaultEvent {
                sensor,
                from: from * te,
                until: (from + random.between(50.0, 600.0)) * te,
                kind,
            }
        })
        .collect();
}

/// The loop's run with or without adaptation.
pub fn simulate(design: &Design, adapt: bool, variant: Variant) -> Trajectory {
    let mut parameters = design.parameters();
    parameters.estimator.adapt = adapt;
    let plant = PlantSimulator::with_true_plant(
        design.plant.clone(),
        design.true_plant.clone(),
        design.scenario.clone(),
    );
    run(&plant, &Controller::new(parameters).unwrap(), variant)
}

/// Sum of the true mean square errors.
pub fn error(design: &Design, run: &Trajectory) -> f64 {
    let tracked = &design.controller.feedback.tracked;
    run.merits(tracked).iter().map(|m| m.true_output.mse).sum()
}

/// Beyond this an output counts as lost.
const LOST: f64 = 1e3;

/// The true error with adaptation and without; none where an output is lost.
pub fn errors(design: &Design) -> [Option<f64>; 2] {
    [true, false].map(|adapt| {
        let run = simulate(design, adapt, Variant::Ftc);
        let mut outputs = run.records.iter().flat_map(|r| &r.y_true);
        outputs.all(|y| y.abs() < LOST).then(|| error(design, &run))
    })
}

/// How much larger the error is with adaptation than without.
pub fn ratio(design: &Design) -> f64 {
    let [Some(adapted), Some(fixed)] = errors(design) else {
        panic!("an output is lost");
    };
    adapted / fixed
}

/// Changes the gains of all inputs of the true plant by a factor.
pub fn change_gains(design: &mut Design, factor: f64) {
    let mut plant = design.plant.clone();
    for mode in &mut plant.modes {
        mode.b *= factor;
    }
    design.true_plant = TruePlant::Linear { plant };
}

/// Whether the loop itself tolerates the change: the same gains told the fault do as well as before.
pub fn tolerates(design: &Design) -> bool {
    let mut unchanged = design.clone();
    unchanged.true_plant = TruePlant::AsDesigned;
    let [changed, before] = [design, &unchanged]
        .map(|design| error(design, &simulate(design, false, Variant::ToldTheFault)));
    changed < 1.2 * before
}

/// Widens or narrows every threshold.
pub fn scale_thresholds(design: &mut Design, factor: f64) {
    for threshold in &mut design.controller.estimator.thresholds {
        *threshold *= factor;
    }
}

/// A random plant whose input gains are off by `gain`, with thresholds opened tenfold and faults of up to
/// `largest` thresholds; none where the loop itself does not bear the change.
pub fn changed_plant(random: &mut RandomNumbers, gain: f64, largest: f64) -> Option<Design> {
    let mut design = design(random);
    // Faults are drawn up to twenty thresholds.
    scale_thresholds(&mut design, largest / 2.0);
    with_faults(&mut design, random);
    scale_thresholds(&mut design, 20.0 / largest);
    change_gains(&mut design, gain);
    tolerates(&design).then_some(design)
}
