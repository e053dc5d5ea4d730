//! How much worse than not adapting: random plants with input gains off by 3 %, thresholds opened tenfold,
//! random faults. Prints one line per seed; outputs beyond 1000 are lost and have no ratio.
#![allow(missing_docs)]

#[path = "../adapting/mod.rs"]
mod adapting;
#[path = "../random_plants/mod.rs"]
mod random_plants;

use adapting::{changed_plant, errors};
use random_plants::RandomNumbers;

const PLANTS: usize = 25;

fn main() {
    println!(
        "| seed | gains | largest fault, thresholds | best | median | worst | lost adapting | lost not adapting |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let faults = [2.0, 5.0, 20.0];
    for seed in 31..=36 {
        let gain = if seed % 2 == 0 { 0.97 } else { 1.03 };
        let largest = faults[(seed as usize - 31) / 2];
        let mut random = RandomNumbers::seeded(seed);
        let plants = std::iter::repeat_with(|| changed_plant(&mut random, gain, largest));
        let errors: Vec<[Option<f64>; 2]> = plants
            .flatten()
            .take(PLANTS)
            .map(|design| errors(&design))
            .collect();
        let mut ratios: Vec<f64> = errors
            .iter()
            .filter_map(|&[adapted, fixed]| Some(adapted? / fixed?))
            .collect();
        ratios.sort_by(f64::total_cmp);
        let last = ratios.len() - 1;
        let [best, median, worst] = [0, last / 2, last].map(|i| ratios[i]);
        let [adapting, not] = [0, 1].map(|i| errors.iter().filter(|e| e[i].is_none()).count());
        println!(
            "| {seed} | {gain} | {largest} | {best:.4} | {median:.4} | {worst:.4} | {adapting} | {not} |"
        );
    }
}
