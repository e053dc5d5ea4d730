//! Sensors that say the very same number again and again.
//!
//! A sensor with any noise does not repeat a reading to the last bit; one that has frozen does. Its
//! residual alone tells this late, and not at all while the true output happens to pass by.

use super::compensation::is_measurement;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// Stands for the reading of a sensor without one: no measurement, yet equal to itself.
const NO_READING: f64 = f64::INFINITY;

/// How often each sensor has repeated itself.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Repetition {
    /// The last reading of each sensor (p).
    last: Vec<f64>,
    /// How many times in a row it has been repeated (p).
    repeats: Vec<u32>,
    /// The readings, infinite where a sensor gives none or is frozen (p).
    screened: Vec<f64>,
    /// Whether the coming readings are held ones, whose repetition means nothing.
    held: bool,
}

crate::state!(Repetition {
    parts: [last, repeats, screened],
    constants: [],
    counters: [held]
});

impl Repetition {
    /// Nothing seen of any of the `outputs` sensors.
    pub fn new(outputs: usize) -> Self {
        Self {
            last: vec![NO_READING; outputs],
            repeats: vec![0; outputs],
            screened: vec![NO_READING; outputs],
            held: false,
        }
    }

    /// Takes a sample's readings (p); one repeated `limit` times in a row is none. A `limit` of zero
    /// lets everything through.
    pub fn screen(&mut self, readings: &[f64], limit: u32) -> &[f64] {
        let held = core::mem::take(&mut self.held);
        let seen = self.last.iter_mut().zip(&mut self.repeats);
        for (((last, repeats), out), &given) in seen.zip(&mut self.screened).zip(readings) {
            let reading = if is_measurement(given) {
                given
            } else {
                NO_READING
            };
            let repeated = reading == *last;
            *repeats = match (repeated, held) {
                (true, true) => *repeats,
                (true, false) => repeats.saturating_add(1),
                (false, _) => 0,
            };
            *last = reading;
            let frozen = limit > 0 && *repeats >= limit;
            *out = if frozen { NO_READING } else { reading };
        }
        &self.screened
    }

    /// Marks the coming readings as held: the sensors were not sampled again.
    pub fn hold(&mut self) {
        self.held = true;
    }

    /// The readings of the last sample (p), infinite where a sensor gives none or is frozen.
    pub fn screened(&self) -> &[f64] {
        &self.screened
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn silent(readings: &[f64], limit: u32) -> Vec<bool> {
        let mut repetition = Repetition::new(1);
        let screened = readings
            .iter()
            .map(|&value| repetition.screen(&[value], limit)[0] == NO_READING);
        screened.collect()
    }

    #[test]
    fn a_reading_counts_until_it_was_repeated_too_often() {
        let readings = [1.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0];
        let expected = [false, false, false, true, true, false, false];
        assert_eq!(silent(&readings, 2), expected);
    }

    #[test]
    fn held_readings_flag_no_sensor() {
        let mut repetition = Repetition::new(1);
        for k in 0..100 {
            if k % 10 > 0 {
                repetition.hold();
            }
            let reading = f64::from(k / 10);
            assert_eq!(repetition.screen(&[reading], 2), [reading]);
        }
    }

    #[test]
    fn without_a_limit_all_is_let_through() {
        assert_eq!(silent(&[4.0; 9], 0), [false; 9]);
    }
}
