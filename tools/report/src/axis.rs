//! Where the ticks of an axis stand and what they say.

use crate::text;

/// Below this fraction of its magnitude a range counts as one constant value.
const FLAT: f64 = 1e-6;

/// A labelled interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Lower end.
    pub low: f64,
    /// Upper end, above `low`.
    pub high: f64,
    /// Tick positions, ascending, inside the interval.
    pub ticks: Vec<f64>,
    /// Labels are in units of ten to this power (a multiple of three).
    pub exponent: i32,
    decimals: usize,
}

impl Axis {
    /// An axis over exactly `[low, high]` with about `count` ticks at round numbers.
    pub fn new(low: f64, high: f64, count: usize) -> Self {
        let (low, high) = widened(low.max(-1e300), high.min(1e300));
        let step = round_step((high - low) / count as f64);
        let first = (low / step - 1e-9).ceil();
        let ticks: Vec<f64> = (0..=2 * count)
            .map(|i| (first + i as f64) * step)
            .take_while(|tick| *tick <= high + 1e-9 * step)
            .collect();
        let exponent = shared_exponent(low.abs().max(high.abs()));
        let decimals = -(step / 10f64.powi(exponent)).log10().floor();
        Self {
            low,
            high,
            ticks,
            exponent,
            decimals: decimals.clamp(0.0, 12.0) as usize,
        }
    }

    /// The same with a margin of 5 % at both ends, so that no curve runs along the frame.
    pub fn with_margin(low: f64, high: f64, count: usize) -> Self {
        let (low, high) = widened(low.max(-1e300), high.min(1e300));
        let margin = 0.05 * (high - low);
        Self::new(low - margin, high + margin, count)
    }

    /// The label of a tick.
    pub fn label(&self, tick: f64) -> String {
        let scaled = tick / 10f64.powi(self.exponent);
        let tiny = scaled.abs() < 0.5 * 10f64.powi(-(self.decimals as i32));
        text::aligned(if tiny { 0.0 } else { scaled }, self.decimals)
    }

    /// Where `value` lies: 0 at the lower end, 1 at the upper; kept within a few lengths of both.
    pub fn fraction(&self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(-4.0, 5.0)
    }
}

/// A constant gets a range around it; nothing at all gets [0, 1].
fn widened(low: f64, high: f64) -> (f64, f64) {
    if low > high {
        return (0.0, 1.0);
    }
    let magnitude = low.abs().max(high.abs());
    if magnitude < 1e-290 {
        (-1.0, 1.0)
    } else if high - low <= FLAT * magnitude {
        (low - 0.1 * magnitude, high + 0.1 * magnitude)
    } else {
        (low, high)
    }
}

/// The nearest step of 1, 2 or 5 times a power of ten at or above `raw`.
fn round_step(raw: f64) -> f64 {
    let power = 10f64.powf(raw.log10().floor());
    let wanted = raw / power;
    let round = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|candidate| *candidate >= wanted - 1e-9)
        .unwrap_or(10.0);
    round * power
}

/// Zero where plain numbers read well, else a multiple of three.
fn shared_exponent(magnitude: f64) -> i32 {
    if (1e-2..1e5).contains(&magnitude) {
        0
    } else {
        3 * (magnitude.log10() / 3.0).floor() as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ticks_are_few_distinct_and_inside(low in -1e6..1e6f64, span in 0.0..1e6f64, power in -150..150i32) {
            let scale = 10f64.powi(power);
            let axis = Axis::with_margin(low * scale, (low + span) * scale, 5);
            prop_assert!(axis.low < axis.high);
            prop_assert!((2..=10).contains(&axis.ticks.len()), "{axis:?}");
            let labels: Vec<_> = axis.ticks.iter().map(|tick| axis.label(*tick)).collect();
            prop_assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
            let slack = 1e-6 * (axis.high - axis.low);
            prop_assert!(axis.ticks.iter().all(|t| (axis.low - slack..=axis.high + slack).contains(t)));
        }
    }

    #[test]
    fn degenerate_ranges_still_make_an_axis() {
        for (low, high) in [
            (0.0, 0.0),
            (600.0, 600.0),
            (f64::INFINITY, f64::NEG_INFINITY),
            (f64::MIN, f64::MAX),
            (-1e-320, 1e-320),
        ] {
            let axis = Axis::with_margin(low, high, 5);
            assert!(
                axis.low.is_finite() && axis.high.is_finite() && axis.low < axis.high,
                "{axis:?}"
            );
            assert!(axis.ticks.len() >= 2, "{axis:?}");
        }
    }

    #[test]
    fn labels_have_no_negative_zero() {
        let axis = Axis::new(-0.3, 0.3, 6);
        assert!(axis.ticks.iter().all(|tick| axis.label(*tick) != "−0.0"));
    }
}
