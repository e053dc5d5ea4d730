//! How much worse than not adapting: random plants with input gains off by 3 %, thresholds opened tenfold,
//! random faults. Prints one line per seed.
#![allow(missing_docs)]

#[path = "../tests/adapting/mod.rs"]
mod adapting;
#[path = "../tests/random_plants/mod.rs"]
mod random_plants;

use adapting::{changed_plant, ratio};
use random_plants::Dice;

const PLANTS: usize = 25;

fn main() {
    println!("| seed | gains | largest fault, thresholds | best | median | worst |");
    println!("|---|---|---|---|---|---|");
    let faults = [2.0, 5.0, 20.0];
    for seed in 31..=36 {
        let gain = if seed % 2 == 0 { 0.97 } else { 1.03 };
        let largest = faults[(seed as usize - 31) / 2];
        let mut dice = Dice::seeded(seed);
        let plants = std::iter::repeat_with(|| changed_plant(&mut dice, gain, largest));
        let mut ratios: Vec<f64> = plants
            .flatten()
            .take(PLANTS)
            .map(|design| ratio(&design))
            .collect();
        ratios.sort_by(f64::total_cmp);
        let [best, median, worst] = [0, PLANTS / 2, PLANTS - 1].map(|i| ratios[i]);
        println!("| {seed} | {gain} | {largest} | {best:.4} | {median:.4} | {worst:.4} |");
    }
}
