//! Counts of positive numbers in bins of equal ratio: quantiles to one percent, merged exactly.
//!
//! The bins of a sketch with relative accuracy (DDSketch), without its sum and extremes: with counts
//! alone, merging is the same in any order to the last digit.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Ratio of the ends of a bin.
const RATIO: f64 = 1.02;
/// Numbers below count as zero.
const LEAST: f64 = 1e-12;
/// Numbers above count as unbounded.
const MOST: f64 = 1e12;

/// How often numbers of each size occurred.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Histogram {
    /// Zero, negative, or negligible.
    zero: u64,
    /// By bin: bin `i` holds `[RATIO^i, RATIO^(i+1))`.
    bins: BTreeMap<i32, u64>,
    /// Too large, or not a number.
    unbounded: u64,
}

impl Histogram {
    /// Counts a number.
    pub fn add(&mut self, value: f64) {
        if value <= LEAST {
            self.zero += 1;
        } else if value < MOST {
            let bin = libm::floor(libm::log(value) / libm::log(RATIO)) as i32;
            *self.bins.entry(bin).or_default() += 1;
        } else {
            self.unbounded += 1;
        }
    }

    /// Adds the counts of another.
    pub fn merge(&mut self, other: &Self) {
        self.zero += other.zero;
        self.unbounded += other.unbounded;
        for (&bin, &count) in &other.bins {
            *self.bins.entry(bin).or_default() += count;
        }
    }

    /// How many numbers were counted.
    pub fn count(&self) -> u64 {
        self.zero + self.unbounded + self.bins.values().sum::<u64>()
    }

    /// The least number that at least `share` (0 to 1) of all do not exceed, to one percent; infinite
    /// where it is unbounded, none where nothing was counted.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let wanted = (share * self.count() as f64).ceil().max(1.0);
        self.cumulated()
            .find(|(_, below)| *below as f64 >= wanted)
            .map(|(value, _)| value)
    }

    /// The middle of each bin that holds anything, ascending, and how many numbers lie up to it.
    pub fn cumulated(&self) -> impl Iterator<Item = (f64, u64)> + '_ {
        let zero = (self.zero > 0).then_some((0.0, self.zero));
        let bins = self.bins.iter().map(|(&bin, &count)| {
            let middle = libm::exp((f64::from(bin) + 0.5) * libm::log(RATIO));
            (middle, count)
        });
        let unbounded = (self.unbounded > 0).then_some((f64::INFINITY, self.unbounded));
        zero.into_iter()
            .chain(bins)
            .chain(unbounded)
            .scan(0, |below, (value, count)| {
                *below += count;
                Some((value, *below))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn quantiles_are_those_of_the_numbers_to_one_percent(
            mut values in prop::collection::vec(1e-6..1e6f64, 1..200), share in 0.0..1.0f64,
        ) {
            let mut histogram = Histogram::default();
            values.iter().for_each(|&value| histogram.add(value));
            values.sort_by(f64::total_cmp);
            let at = ((share * values.len() as f64).ceil() as usize).max(1) - 1;
            let found = histogram.quantile(share).unwrap();
            prop_assert!((found / values[at] - 1.0).abs() < 0.0101, "{} for {}", found, values[at]);
        }

        #[test]
        fn merging_is_the_same_in_any_order(values in prop::collection::vec(prop::num::f64::ANY, 0..60), cut in 0usize..60) {
            let of = |values: &[f64]| {
                let mut histogram = Histogram::default();
                values.iter().for_each(|&value| histogram.add(value));
                histogram
            };
            let (left, right) = values.split_at(cut.min(values.len()));
            let (mut one, mut other) = (of(left), of(right));
            one.merge(&of(right));
            other.merge(&of(left));
            prop_assert_eq!(&one, &of(&values));
            prop_assert_eq!(one, other);
        }
    }

    #[test]
    fn what_is_no_number_counts_as_unbounded() {
        let mut histogram = Histogram::default();
        for value in [f64::NAN, f64::INFINITY, 0.0] {
            histogram.add(value);
        }
        assert_eq!(histogram.quantile(0.0), Some(0.0));
        assert_eq!(histogram.quantile(1.0), Some(f64::INFINITY));
        assert_eq!(Histogram::default().quantile(0.5), None);
    }
}
