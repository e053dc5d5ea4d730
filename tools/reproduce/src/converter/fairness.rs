//! The predictive controller's horizon and weight were chosen by hand; this shows that the choice
//! does not hold it back.

use super::*;

/// True VAF of both outputs without any fault, in percent.
fn healthy(design: &Design, horizon: usize, input_weight: f64) -> [f64; 2] {
    let mut scenario = design.scenario.clone();
    scenario.events.clear();
    let plant =
        PlantSimulator::with_true_plant(design.plant.clone(), design.true_plant.clone(), scenario);
    let run = predict(design, &plant, horizon, input_weight).unwrap();
    let merits = merits(&run, design);
    [merits[0].true_output.vaf, merits[1].true_output.vaf]
}

/// Percentage points of true VAF that a neighbouring choice may be ahead.
const SMALL_SHARE: f64 = 0.01;

/// Twice or half the horizon, three times or a third of the weight: none is better for either output.
#[test]
fn no_neighbouring_choice_makes_the_predictive_controller_better() {
    let design = design(experiment::request(EXAMPLE).unwrap(), "").unwrap();
    let chosen = healthy(&design, HORIZON, INPUT_WEIGHT);
    for horizon in [HORIZON / 2, HORIZON, 2 * HORIZON] {
        for factor in [1.0 / 3.0, 1.0, 3.0] {
            let neighbour = healthy(&design, horizon, factor * INPUT_WEIGHT);
            println!("{horizon} samples, {factor:.2} times the weight: {neighbour:.4?}");
            for (other, own) in neighbour.iter().zip(chosen) {
                assert!(
                    *other <= own + SMALL_SHARE,
                    "{other} % against {own} % with {horizon} samples and {factor} times the weight"
                );
            }
        }
    }
}
