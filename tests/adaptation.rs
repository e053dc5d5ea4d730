//! Adaptation must be unable to do harm: over random plants, references and faults it is never
//! worse than 1.05 times not adapting, and nothing diverges.

mod random_plants;

use ftc::control::Controller;
use ftc::design::Design;
use ftc::simulate::scenario::{FaultEvent, FaultKind, ModeInterval};
use ftc::simulate::{PlantSimulator, Variant, run};
use random_plants::{Dice, design};

const PLANTS: u64 = 25;
const STEPS: u64 = 6000;

/// Six faults of random kind, sensor, size and time.
fn with_faults(design: &mut Design, dice: &mut Dice) {
    let te = design.controller.plant.sample_time;
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
            let sensor = dice.count(0, sensors - 1);
            let size = design.controller.estimator.thresholds[sensor] * dice.between(-20.0, 20.0);
            let from = dice.between(600.0, 5400.0);
            let kind = match dice.count(0, 3) {
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
                until: (from + dice.between(50.0, 600.0)) * te,
                kind,
            }
        })
        .collect();
}

/// Sum of the true mean square errors with adaptation and without.
fn errors(design: &Design) -> [f64; 2] {
    [true, false].map(|adapt| {
        let mut parameters = design.controller.clone();
        parameters.estimator.adapt = adapt;
        let tracked = parameters.feedback.tracked.clone();
        let plant = PlantSimulator::with_truth(
            parameters.plant.clone(),
            design.truth.clone(),
            design.scenario.clone(),
        );
        let trajectory = run(&plant, &Controller::new(parameters), Variant::Ftc);
        let largest = trajectory
            .records
            .iter()
            .flat_map(|r| &r.y_true)
            .fold(0.0_f64, |a, y| a.max(y.abs()));
        assert!(largest < 1e3, "diverges to {largest}");
        trajectory
            .merits(&tracked)
            .iter()
            .map(|m| m.truth.mse)
            .sum()
    })
}

#[test]
fn adapting_is_never_worse_than_not_adapting() {
    let mut dice = Dice::seeded(7);
    let mut worst: f64 = 0.0;
    for plant in 0..PLANTS {
        let mut design = design(&mut dice);
        with_faults(&mut design, &mut dice);
        let [adapted, fixed] = errors(&design);
        worst = worst.max(adapted / fixed);
        assert!(
            adapted <= 1.05 * fixed,
            "plant {plant}: {adapted:.3e} against {fixed:.3e}"
        );
    }
    println!("worst ratio {worst:.4}");
}
