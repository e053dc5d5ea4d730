//! The response to a periodic disturbance, mapped from one mode to another.
//!
//! At angle `theta` per sample the disturbance reaches the output through
//! `G_i = C_i (e^{j theta} I - A_i)^-1 E_i + F_i`, so phasors learned in mode `i` become
//! `G_j G_i^+` times themselves in mode `j`. That is exact where the model is, and a better
//! initial value than zero where the model is approximate.

use super::units::power_of_two;
use super::words::counted;
use core::f64::consts::TAU;
use ftc_control::parameters::{KnownPeriod, MOST_HARMONICS, PhasorMap};
use ftc_plant::number::{NumberError, not_negative, positive};
use ftc_plant::{Mode, SwitchedPlant};
use ftc_record::plain;
use nalgebra::{Complex, DMatrix, DVector};

/// What is known of the periodic disturbance.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct KnownDisturbance {
    /// Period in seconds.
    pub period: f64,
    /// Harmonics, the fundamental included.
    pub harmonics: usize,
    /// Largest value of each channel (s), if known.
    pub amplitude: Option<Vec<f64>>,
}

/// Why a disturbance cannot be learned. Channels count from 1.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DisturbanceError {
    /// The period is not positive.
    #[error("the period of the disturbance {0}")]
    Period(NumberError),
    /// No harmonic, or too many.
    #[error("the disturbance has {}: give 1 to {MOST_HARMONICS}", counted(*.0, "harmonic", "harmonics"))]
    Harmonics(usize),
    /// The shortest period of its harmonics is not above two samples.
    #[error(
        "the period of the disturbance is {period}, but with {} it has to be above {} seconds at this sample time: give \
         a longer period, fewer harmonics or a shorter sample time",
        counted(*.harmonics, "harmonic", "harmonics"), .above
    )]
    TooShort {
        /// The period in seconds.
        period: f64,
        /// Harmonics.
        harmonics: usize,
        /// What it has to be above, in seconds.
        above: f64,
    },
    /// Not one amplitude for each channel.
    #[error("the disturbance has {}: give {needed}", counted(*.found, "amplitude", "amplitudes"))]
    AmplitudeCount {
        /// Amplitudes found.
        found: usize,
        /// Channels.
        needed: usize,
    },
    /// An amplitude is negative or no number.
    #[error("the amplitude of disturbance {channel} {error}")]
    Amplitude {
        /// The channel.
        channel: usize,
        /// What is wrong with it.
        error: NumberError,
    },
}

impl KnownDisturbance {
    /// How many harmonics, where no number is asked for: the fundamental.
    pub const HARMONICS: usize = 1;

    /// Whether a controller sampled every `sample_time` seconds can learn it, where it has so many `channels`.
    ///
    /// # Errors
    /// The first number that is out of its range.
    pub fn check(&self, sample_time: f64, channels: usize) -> Result<(), DisturbanceError> {
        positive(self.period).map_err(DisturbanceError::Period)?;
        if !(1..=MOST_HARMONICS).contains(&self.harmonics) {
            return Err(DisturbanceError::Harmonics(self.harmonics));
        }
        // Of anything shorter no sample tells one harmonic from another.
        let shortest = 2.0 * sample_time;
        if self.period / self.harmonics as f64 <= shortest {
            return Err(DisturbanceError::TooShort {
                period: self.period,
                harmonics: self.harmonics,
                above: shortest * self.harmonics as f64,
            });
        }
        let amplitude = self.amplitude.as_deref().unwrap_or_default();
        if self.amplitude.is_some() && amplitude.len() != channels {
            return Err(DisturbanceError::AmplitudeCount {
                found: amplitude.len(),
                needed: channels,
            });
        }
        for (at, &size) in amplitude.iter().enumerate() {
            not_negative(size).map_err(|error| DisturbanceError::Amplitude {
                channel: at + 1,
                error,
            })?;
        }
        Ok(())
    }

    /// The fundamental alone, of a period in seconds; its size is not known.
    pub fn new(period: f64) -> Self {
        Self {
            period,
            harmonics: Self::HARMONICS,
            amplitude: None,
        }
    }

    /// Angle per sample (radians) of each harmonic, for [`ControlSpec::resonators`](crate::ControlSpec::resonators).
    pub fn angles(&self, sample_time: f64) -> Vec<f64> {
        self.known_period().angles(sample_time).collect()
    }

    /// What the estimator is told of it.
    pub(crate) fn known_period(&self) -> KnownPeriod {
        KnownPeriod {
            seconds: self.period,
            harmonics: self.harmonics,
        }
    }
}

/// Singular values below this fraction of the largest count as zero.
const TOLERANCE: f64 = 1e-9;

/// Maps of all harmonics, `[from][to][harmonic]`, for a period in samples. `outputs` holds the outputs'
/// nominal values (p): they weigh the outputs where there are more of them than disturbances.
///
/// Empty where the plant has no disturbance, since then nothing can be said.
pub fn transfers(
    plant: &SwitchedPlant,
    outputs: &[f64],
    period: f64,
    count: usize,
) -> Vec<Vec<Vec<PhasorMap>>> {
    let units: Vec<f64> = outputs.iter().map(|&value| power_of_two(value)).collect();
    let responses: Option<Vec<Vec<_>>> = plant
        .modes
        .iter()
        .map(|mode| {
            (1..=count)
                .map(|h| response(mode, TAU * h as f64 / period))
                .collect()
        })
        .collect();
    let silent =
        |modes: &Vec<Vec<DMatrix<Complex<f64>>>>| modes.iter().flatten().all(|g| g.norm() == 0.0);
    let Some(responses) = responses.filter(|modes| !silent(modes)) else {
        return Vec::new();
    };
    responses
        .iter()
        .map(|from| {
            let harmonics = |to| {
                from.iter()
                    .zip(to)
                    .map(|(f, t)| map(f, t, &units))
                    .collect()
            };
            responses.iter().map(harmonics).collect()
        })
        .collect()
}

/// `G_j G_i^+`, taken where outputs are in `units` and the disturbances' own are such that each moves
/// the outputs by about one.
fn map(from: &DMatrix<Complex<f64>>, to: &DMatrix<Complex<f64>>, units: &[f64]) -> PhasorMap {
    let (mut from, mut to) = (from.clone(), to.clone());
    for response in [&mut from, &mut to] {
        for (mut row, unit) in response.row_iter_mut().zip(units) {
            row /= Complex::from(*unit);
        }
    }
    for (mut left, mut entered) in from.column_iter_mut().zip(to.column_iter_mut()) {
        let unit = Complex::from(power_of_two(left.norm()));
        left /= unit;
        entered /= unit;
    }
    let threshold = TOLERANCE * from.norm().max(f64::MIN_POSITIVE);
    let inverse = from
        .clone()
        .pseudo_inverse(threshold)
        .unwrap_or_else(|_| from.adjoint());
    let product = to * inverse;
    let part = |of: fn(&Complex<f64>) -> f64| {
        plain(&DMatrix::from_fn(
            product.nrows(),
            product.ncols(),
            |row, column| of(&product[(row, column)]) * (units[row] / units[column]),
        ))
    };
    PhasorMap {
        real: part(|z| z.re),
        imaginary: part(|z| z.im),
    }
}

/// A bound of each output (p) under a disturbance of the given amplitudes (s) at any of the first
/// `count` harmonics of `period` (samples), in the worst mode: `max |G_i| a`.
///
/// Infinite where a mode resonates at a harmonic.
pub fn largest_response(
    plant: &SwitchedPlant,
    period: f64,
    count: usize,
    amplitudes: &[f64],
) -> Vec<f64> {
    let amplitudes = DVector::from_column_slice(amplitudes);
    let outputs = plant.dimensions().outputs;
    let mut largest = DVector::zeros(outputs);
    for mode in &plant.modes {
        for harmonic in 1..=count {
            let at_harmonic = match response(mode, TAU * harmonic as f64 / period) {
                Some(gain) => gain.map(|z| z.norm()) * &amplitudes,
                None => DVector::repeat(outputs, f64::INFINITY),
            };
            largest = largest.sup(&at_harmonic);
        }
    }
    largest.iter().copied().collect()
}

/// `C (e^{j theta} I - A)^-1 E + F` (p x s); none on an eigenvalue of `A`.
fn response(mode: &Mode, theta: f64) -> Option<DMatrix<Complex<f64>>> {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|v| Complex::new(v, 0.0));
    let n = mode.a.nrows();
    let turned = DMatrix::identity(n, n) * Complex::from_polar(1.0, theta) - complex(&mode.a);
    let state = turned.lu().solve(&complex(&mode.e))?;
    Some(complex(&mode.c) * state + complex(&mode.f))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first_order(pole: f64, gain: f64) -> Mode {
        let scalar = |v| DMatrix::from_element(1, 1, v);
        Mode::new(scalar(pole), scalar(1.0), scalar(1.0))
            .with_disturbance(scalar(gain), scalar(0.0))
    }

    #[test]
    fn a_disturbance_that_cannot_be_learned_is_refused_with_what_would_do() {
        let said = |period, harmonics, amplitude: Option<Vec<f64>>| {
            let mut known = KnownDisturbance::new(period);
            known.harmonics = harmonics;
            known.amplitude = amplitude;
            let found = known.check(0.5, 2);
            found.map_err(|error| error.to_string())
        };
        assert_eq!(said(3.1, 3, Some(vec![0.0, 1.0])), Ok(()));
        let cases: [(f64, usize, Option<Vec<f64>>, &str); 7] = [
            (
                0.0,
                1,
                None,
                "the period of the disturbance is 0: give a positive number",
            ),
            (f64::NAN, 1, None, "the period of the disturbance is NaN"),
            (
                9.0,
                0,
                None,
                "the disturbance has 0 harmonics: give 1 to 50",
            ),
            (99.0, 51, None, "the disturbance has 51 harmonics"),
            (
                3.0,
                3,
                None,
                "the period of the disturbance is 3, but with 3 harmonics it has to be above 3 seconds",
            ),
            (
                9.0,
                1,
                Some(vec![1.0]),
                "the disturbance has 1 amplitude: give 2",
            ),
            (
                9.0,
                1,
                Some(vec![1.0, -1.0]),
                "the amplitude of disturbance 2 is -1: give 0",
            ),
        ];
        for (period, harmonics, amplitude, words) in cases {
            let said = said(period, harmonics, amplitude).expect_err(words);
            assert!(said.starts_with(words), "{said}");
        }
    }

    /// Simulated steady responses of two modes to the same sine are related by the map.
    #[test]
    fn maps_a_simulated_response_to_that_of_the_other_mode() {
        let plant = SwitchedPlant::new(1.0, vec![first_order(0.8, 1.0), first_order(-0.3, 2.0)]);
        let (period, ticks) = (20.0, 400);
        let phasor = |mode: &Mode| {
            let (mut x, mut sine, mut cosine) = (0.0, 0.0, 0.0);
            for k in 0..ticks {
                let angle = TAU * f64::from(k) / period;
                if k >= ticks - 20 {
                    sine += x * angle.sin() / 10.0;
                    cosine += x * angle.cos() / 10.0;
                }
                x = mode.a[0] * x + mode.e[0] * angle.sin();
            }
            (sine, cosine)
        };
        let (a, b) = phasor(&plant.modes[0]);
        let map = &transfers(&plant, &[1.0], period, 1)[0][1][0];
        let (re, im) = (map.real.as_slice()[0], map.imaginary.as_slice()[0]);
        let expected = phasor(&plant.modes[1]);
        assert!(
            (re * a - im * b - expected.0).abs() < 1e-9
                && (im * a + re * b - expected.1).abs() < 1e-9
        );
    }

    #[test]
    fn a_plant_without_disturbance_has_no_maps() {
        let plant = SwitchedPlant::new(1.0, vec![first_order(0.8, 0.0)]);
        assert!(transfers(&plant, &[1.0], 20.0, 1).is_empty());
    }

    fn lag() -> SwitchedPlant {
        SwitchedPlant::new(1.0, vec![first_order(0.8, 1.0)])
    }

    #[test]
    fn the_bound_is_what_a_long_simulation_settles_to() {
        let period = 40.0;
        let bound = largest_response(&lag(), period, 1, &[0.5])[0];
        let (mut x, mut largest) = (0.0f64, 0.0f64);
        for k in 0..4000 {
            x = 0.8 * x + 0.5 * (TAU * f64::from(k) / period).sin();
            largest = if k > 2000 { largest.max(x.abs()) } else { 0.0 };
        }
        assert!(largest <= bound * (1.0 + 1e-9));
        // Forty samples a period see the crest to within 1 - cos(pi / 40).
        assert!(largest >= bound * 0.99, "{largest} of {bound}");
    }

    #[test]
    fn the_slowest_harmonic_counts_for_a_lag() {
        let one = largest_response(&lag(), 40.0, 1, &[1.0]);
        assert_eq!(one, largest_response(&lag(), 40.0, 5, &[1.0]));
    }
}
