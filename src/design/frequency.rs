//! The open-loop response to a periodic disturbance.

use crate::plant::{Mode, SwitchedPlant};
use nalgebra::{Complex, DMatrix, DVector};

/// A bound of each output (p) under a disturbance of the given amplitudes (s) at any of the first
/// `harmonics` harmonics of `period` (samples), in the worst mode: `max |C (zI - A)^-1 E + F| a`.
///
/// Infinite where a mode resonates at a harmonic.
pub fn disturbance_response(
    plant: &SwitchedPlant,
    period: f64,
    harmonics: usize,
    amplitudes: &[f64],
) -> Vec<f64> {
    let amplitudes = DVector::from_column_slice(amplitudes);
    let mut largest = DVector::zeros(plant.dimensions().outputs);
    for mode in &plant.modes {
        for harmonic in 1..=harmonics {
            let angle = core::f64::consts::TAU * harmonic as f64 / period;
            let response = gain(mode, angle) * &amplitudes;
            largest = largest.sup(&response);
        }
    }
    largest.iter().copied().collect()
}

/// Magnitude of the transfer from each disturbance to each output (p x s) at `angle` radians per sample.
fn gain(mode: &Mode, angle: f64) -> DMatrix<f64> {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let states = mode.a.nrows();
    let point = Complex::from_polar(1.0, angle);
    let resolvent = DMatrix::from_diagonal_element(states, states, point) - complex(&mode.a);
    match resolvent.lu().solve(&complex(&mode.e)) {
        Some(state) => (complex(&mode.c) * state + complex(&mode.f)).map(|value| value.norm()),
        None => DMatrix::from_element(mode.f.nrows(), mode.f.ncols(), f64::INFINITY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::OperatingPoint;

    fn first_order(pole: f64) -> SwitchedPlant {
        let one = DMatrix::from_element(1, 1, 1.0);
        SwitchedPlant {
            sample_time: 1.0,
            modes: vec![Mode {
                name: "lag".into(),
                a: &one * pole,
                b: one.clone(),
                c: one.clone(),
                e: one.clone(),
                f: DMatrix::zeros(1, 1),
                operating_point: OperatingPoint::zero(1, 1, 1),
            }],
        }
    }

    #[test]
    fn the_response_is_what_a_long_simulation_settles_to() {
        let (pole, period) = (0.8, 40.0);
        let bound = disturbance_response(&first_order(pole), period, 1, &[0.5])[0];
        let (mut x, mut largest) = (0.0f64, 0.0f64);
        for k in 0..4000 {
            x = pole * x + 0.5 * (core::f64::consts::TAU * f64::from(k) / period).sin();
            largest = if k > 2000 { largest.max(x.abs()) } else { 0.0 };
        }
        assert!(largest <= bound * (1.0 + 1e-9));
        // Forty samples a period see the crest to within 1 - cos(pi / 40).
        assert!(largest >= bound * 0.99, "{largest} of {bound}");
    }

    #[test]
    fn the_slowest_harmonic_counts_for_a_lag() {
        let plant = first_order(0.8);
        let one = disturbance_response(&plant, 40.0, 1, &[1.0]);
        assert_eq!(one, disturbance_response(&plant, 40.0, 5, &[1.0]));
    }
}
