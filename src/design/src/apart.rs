//! How far the readings of two modes part: what finding the mode rests on.

use crate::Design;
use ftc_control::parameters::Hypotheses;
use ftc_plant::Mode;
use nalgebra::DVector;

/// Deviations of the noise by which readings must part for modes to be told apart.
pub const LEAST_DEVIATIONS: f64 = 3.0;

/// Samples for which two modes are run beside each other.
const SAMPLES: usize = 50;

/// Two modes, and how far their readings part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Apart {
    /// The modes (0-based).
    pub modes: [usize; 2],
    /// Largest difference of a reading, in standard deviations of its sensor's noise, while states and
    /// inputs leave the operating point by their nominal values.
    pub deviations: f64,
}

/// Every pair of modes of a design that finds the mode from the readings; empty where it is told.
pub fn pairs(design: &Design) -> Vec<Apart> {
    let estimator = &design.controller.estimator;
    let settings = match (&estimator.hypotheses, estimator.finds_the_mode()) {
        (Some(settings), true) => settings,
        _ => return Vec::new(),
    };
    let modes = &design.plant.modes;
    let inputs = design.signals.scaling().inputs;
    let pair = |i: usize, j: usize| Apart {
        modes: [i, j],
        deviations: deviations(&modes[i], &modes[j], settings, &inputs),
    };
    (0..modes.len())
        .flat_map(|j| (0..j).map(move |i| (i, j)))
        .map(|(i, j)| pair(i, j))
        .collect()
}

/// The largest difference of the readings after the same start under the same input.
fn deviations(one: &Mode, other: &Mode, settings: &Hypotheses, inputs: &[f64]) -> f64 {
    let point = &one.operating_point;
    let rest = (
        DVector::from_column_slice(&point.x),
        DVector::from_column_slice(&point.u),
    );
    let displaced = settings.state_size.iter().enumerate().map(|(k, size)| {
        let mut from = rest.clone();
        from.0[k] += size;
        from
    });
    let moved = inputs.iter().enumerate().map(|(j, size)| {
        let mut from = rest.clone();
        from.1[j] += size;
        from
    });
    let starts = std::iter::once(rest.clone()).chain(displaced).chain(moved);
    starts
        .map(|(x, u)| parting(one, other, (x, &u), &settings.noise))
        .fold(0.0, f64::max)
}

/// The same from the state `x` (n) under the constant input `u` (m), relative to the `noise` (p).
fn parting(one: &Mode, other: &Mode, (x, u): (DVector<f64>, &DVector<f64>), noise: &[f64]) -> f64 {
    let (mut a, mut b) = (x.clone(), x);
    let mut most = 0.0_f64;
    for _ in 0..SAMPLES {
        let difference = reading(one, &a) - reading(other, &b);
        for (difference, noise) in difference.iter().zip(noise) {
            most = most.max(difference.abs() / noise);
        }
        a = &one.a * a + &one.b * u + one.state_offset();
        b = &other.a * b + &other.b * u + other.state_offset();
    }
    most
}

/// The reading of healthy sensors (p) at the state `x` (n).
fn reading(mode: &Mode, x: &DVector<f64>) -> DVector<f64> {
    let point = &mode.operating_point;
    let off = x - DVector::from_column_slice(&point.x);
    &mode.c * off + DVector::from_column_slice(&point.y)
}
