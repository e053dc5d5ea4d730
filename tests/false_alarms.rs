//! Healthy sensors are not flagged: random plants under noise, disturbance and mode switches, with
//! thresholds at 6 standard deviations of the residual.
//!
//! promise: no-false-alarms

mod random_plants;

use ftc_control::Controller;
use ftc_simulate::{PlantSimulator, Variant, run};
use random_plants::{RandomNumbers, STEPS, design, schedule};

/// Plants; each runs for [`STEPS`] samples. `cargo bench --bench detection` counts on twenty.
const PLANTS: usize = 4;
/// Samples between two mode switches.
const EVERY: u64 = 5_000;

#[test]
fn no_healthy_sensor_is_flagged() {
    let mut random = RandomNumbers::seeded(71);
    let mut samples = 0;
    for plant in 0..PLANTS {
        let mut design = design(&mut random);
        let te = design.plant.sample_time;
        design.scenario.schedule = schedule(te, STEPS, EVERY);
        let simulator = PlantSimulator::new(design.plant.clone(), design.scenario.clone());
        let controller = Controller::new(design.parameters()).unwrap();
        let trajectory = run(&simulator, &controller, Variant::Ftc);
        for record in &trajectory.records {
            assert!(
                !record.flagged.contains(&true),
                "plant {plant}, sample {}: {:?}",
                record.tick,
                record.residual
            );
        }
        samples += trajectory.records.len() as u64;
    }
    assert_eq!(samples, PLANTS as u64 * STEPS);
}
