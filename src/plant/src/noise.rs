//! Gaussian measurement noise as a pure function of seed and tick.
//!
//! Because nothing is carried from tick to tick, a plant restored to an earlier time draws the
//! same noise again, and a saved plant state needs no generator inside.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Fills `out` with independent standard normal numbers belonging to `tick`.
pub fn standard_normal(seed: u64, tick: u64, out: &mut [f64]) {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(tick);
    for value in out {
        *value = StandardNormal.sample(&mut generator);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn same_tick_same_noise_other_tick_other_noise() {
        let draw = |tick| {
            let mut out = [0.0; 3];
            standard_normal(7, tick, &mut out);
            out
        };
        assert_eq!(draw(5), draw(5));
        assert_ne!(draw(5), draw(6));
    }

    #[test]
    fn mean_and_variance_are_those_of_a_standard_normal() {
        let mut values = Vec::new();
        for tick in 0..20_000 {
            let mut out = [0.0; 2];
            standard_normal(1, tick, &mut out);
            values.extend(out);
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        // Five standard errors of each estimate.
        assert!(mean.abs() < 5.0 / count.sqrt());
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / count).sqrt());
    }
}
