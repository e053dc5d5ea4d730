//! The units a design is solved and certified in.
//!
//! Every unit is a power of two, so that going there and back changes no digit: a certificate of
//! the scaled design is a certificate of the shipped doubles.

use super::ControlSpec;
use ftc_plant::SwitchedPlant;
use ftc_plant::scaling::Scaling;
use serde::{Deserialize, Serialize};

/// Powers of two by which signals are divided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Units {
    /// States (n).
    pub states: Vec<f64>,
    /// Inputs (m).
    pub inputs: Vec<f64>,
    /// Outputs (p).
    pub outputs: Vec<f64>,
    /// Integrator states (r): near `Te` times the unit of the tracked output; also the unit of the
    /// resonators of that output.
    pub integrators: Vec<f64>,
    /// Disturbances, one unit for all.
    pub disturbance: f64,
    /// Performance signal, one unit for all.
    pub performance: f64,
}

impl Units {
    /// One for every signal.
    pub fn unit(plant: &SwitchedPlant, tracked: usize) -> Self {
        let dims = plant.dimensions();
        Self {
            states: vec![1.0; dims.states],
            inputs: vec![1.0; dims.inputs],
            outputs: vec![1.0; dims.outputs],
            integrators: vec![1.0; tracked],
            disturbance: 1.0,
            performance: 1.0,
        }
    }

    /// The unit of each state of the integral part (q entries), in the order of the augmented model.
    pub fn integral_part(&self, spec: &ControlSpec) -> Vec<f64> {
        let pairs = self.integrators.iter().flat_map(|&unit| [unit; 2]);
        let resonators = spec.resonators.iter().flat_map(|_| pairs.clone());
        self.integrators.iter().copied().chain(resonators).collect()
    }

    /// Whether there is one positive power of two per signal, as exact scaling needs.
    pub fn fit(&self, plant: &SwitchedPlant, tracked: usize) -> bool {
        let dims = plant.dimensions();
        let sizes = [
            (&self.states, dims.states),
            (&self.inputs, dims.inputs),
            (&self.outputs, dims.outputs),
            (&self.integrators, tracked),
        ];
        let mut all = sizes.iter().flat_map(|(units, _)| units.iter());
        sizes.iter().all(|(units, size)| units.len() == *size)
            && all.all(|&unit| is_unit(unit))
            && is_unit(self.disturbance)
            && is_unit(self.performance)
    }
}

/// Another scaling of the same plant, in which a verdict is confirmed: the balanced one, or none at all
/// where the balanced one is what was used.
pub(crate) fn other_scaling(plant: &SwitchedPlant, used: &Scaling) -> Scaling {
    let balanced = Scaling::automatic(plant);
    let pairs = [
        (&used.states, &balanced.states),
        (&used.inputs, &balanced.inputs),
        (&used.outputs, &balanced.outputs),
    ];
    let mut values = pairs.iter().flat_map(|(a, b)| a.iter().zip(b.iter()));
    if values.all(|(a, b)| (0.5..=2.0).contains(&(a / b))) {
        let dims = plant.dimensions();
        return Scaling::unit(dims.states, dims.inputs, dims.outputs);
    }
    balanced
}

/// Whether a number can be a unit: a power of two, far from where scaling by it could overflow, or
/// underflow and hide a number.
pub(crate) fn is_unit(unit: f64) -> bool {
    let largest = libm::ldexp(1.0, LARGEST_EXPONENT);
    (1.0 / largest..=largest).contains(&unit) && power_of_two(unit) == unit
}

/// Units lie between `2^-LARGEST_EXPONENT` and `2^LARGEST_EXPONENT`.
const LARGEST_EXPONENT: i32 = 200;

/// The power of two nearest a positive number on the logarithmic scale; 1 for anything that has
/// none.
pub(crate) fn power_of_two(value: f64) -> f64 {
    if value.is_normal() && value > 0.0 {
        libm::ldexp(1.0, libm::round(libm::log2(value)) as i32)
    } else {
        1.0
    }
}
