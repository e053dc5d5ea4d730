//! Adaptation must be unable to do harm: over random plants, references and faults it is never
//! worse than 1.05 times not adapting, and nothing diverges, be the plant as it was or changed, and be
//! the thresholds so wide that faults hide below them. And it must be of use where the plant changed.

mod adapting;
mod random_plants;

use adapting::{
    STEPS, change_gains, changed_plant, errors, ratio, scale_thresholds, simulate, tolerates,
    with_faults,
};
use ftc_simulate::Variant;
use random_plants::{RandomNumbers, design};

const PLANTS: usize = 25;

#[test]
fn adapting_is_never_worse_than_not_adapting() {
    let mut random = RandomNumbers::seeded(7);
    let mut worst: f64 = 0.0;
    for plant in 0..PLANTS {
        let mut design = design(&mut random);
        with_faults(&mut design, &mut random);
        let ratio = ratio(&design);
        worst = worst.max(ratio);
        assert!(ratio <= 1.05, "plant {plant}: {ratio}");
    }
    println!("worst ratio {worst:.4}");
}

/// Thresholds opened tenfold, faults of up to twice or twenty times that, input gains off by 3 %.
#[test]
fn nor_where_the_plant_changed_and_faults_hide() {
    for (seed, gain, largest) in [(1, 1.03, 2.0), (2, 0.97, 20.0)] {
        let mut random = RandomNumbers::seeded(seed);
        let plants = std::iter::repeat_with(|| changed_plant(&mut random, gain, largest));
        for (plant, design) in plants.flatten().take(PLANTS).enumerate() {
            let ratio = ratio(&design);
            assert!(ratio <= 1.05, "seed {seed}, plant {plant}: {ratio}");
        }
    }
}

/// Without any fault, what the predictor leaves unexplained of a plant that changed.
#[test]
fn a_plant_that_changed_is_predicted_better() {
    let mut random = RandomNumbers::seeded(11);
    let mut gains = Vec::new();
    for _ in 0..PLANTS {
        let mut design = design(&mut random);
        design.scenario.steps = STEPS;
        scale_thresholds(&mut design, 10.0);
        change_gains(&mut design, 1.03);
        if !tolerates(&design) {
            continue;
        }
        let [adapted, fixed] = [true, false].map(|adapt| {
            let run = simulate(&design, adapt, Variant::Ftc);
            let later = &run.records[STEPS as usize / 2..];
            let residuals = later.iter().flat_map(|r| &r.residual);
            (residuals.map(|r| r * r).sum::<f64>() / later.len() as f64).sqrt()
        });
        gains.push(adapted / fixed);
    }
    gains.sort_by(f64::total_cmp);
    println!("adapted over fixed residual: {gains:.3?}");
    assert!(gains.iter().all(|&gain| gain < 0.9));
    assert!(gains[gains.len() / 2] < 0.5);
}

/// Inputs hundreds of times those of the database, a predictor that noise made imprecise, and a
/// sensor flagged: following the residual closed the loop over that predictor, and it diverged.
#[test]
fn an_imprecise_predictor_closes_no_loop() {
    let mut random = RandomNumbers::seeded(32);
    let plants = std::iter::repeat_with(|| changed_plant(&mut random, 0.97, 2.0));
    for design in plants.flatten().take(6) {
        let [_, fixed] = errors(&design);
        assert!(fixed.is_some(), "an output is lost");
    }
}
