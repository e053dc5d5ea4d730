//! Whether the inputs reach what they are asked to govern, before any inequality is solved.

use super::augmented::{AugmentedMode, augment};
use super::units::other_scaling;
use super::{ControlSpec, Units, words};
use ftc_plant::SwitchedPlant;
use ftc_plant::scaling::Scaling;
use nalgebra::{Complex, DMatrix};

/// Singular values below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-11;

/// What the inputs cannot move. Modes and harmonics count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Uncontrollable {
    /// An eigenvalue of a mode that decays more slowly than asked.
    #[error(
        "mode {mode}: (A, B) is uncontrollable: no input moves its eigenvalue {} of magnitude {:.4}, \
         which decays more slowly than the {decay} asked for: add an input or ask for a slower decay",
        words::eigenvalue(*eigenvalue), eigenvalue.norm()
    )]
    Eigenvalue {
        /// The mode.
        mode: usize,
        /// The eigenvalue.
        eigenvalue: Complex<f64>,
        /// The decay that is asked for.
        decay: f64,
    },
    /// The tracked outputs at rest.
    #[error(
        "mode {mode}: (A, B) cannot hold the tracked outputs at arbitrary values, the pair with integral action is \
         uncontrollable: track fewer outputs, or outputs on which the inputs act independently"
    )]
    Tracked {
        /// The mode.
        mode: usize,
    },
    /// The tracked outputs at a harmonic of the disturbance.
    #[error(
        "mode {mode}: the inputs cannot move the tracked outputs at harmonic {harmonic} of the disturbance, so no internal \
         model can reject it: use fewer harmonics, track fewer outputs, or leave the internal model out"
    )]
    Harmonic {
        /// The mode.
        mode: usize,
        /// The harmonic.
        harmonic: usize,
    },
}

/// Checks by the Popov-Belevitch-Hautus test that every eigenvalue of every mode, the integrators'
/// and the resonators' included, that decays more slowly than asked can be moved by the inputs.
///
/// A verdict that something is uncontrollable is given only after another scaling has confirmed it.
///
/// # Errors
/// The mode, and what its inputs cannot move.
pub fn check_controllable(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    scaling: &Scaling,
) -> Result<(), Uncontrollable> {
    let first = check_scaled(plant, spec, scaling);
    first.or_else(|what| check_scaled(plant, spec, &other_scaling(plant, scaling)).or(Err(what)))
}

/// The check in one scaling.
fn check_scaled(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    scaling: &Scaling,
) -> Result<(), Uncontrollable> {
    let units = Units::choose(plant, spec, scaling);
    let models = augment(plant, spec, &units);
    for (index, (model, mode)) in models.iter().zip(&plant.modes).enumerate() {
        let number = index + 1;
        for eigenvalue in ftc_plant::eigenvalues(&mode.a).iter() {
            if eigenvalue.norm() >= spec.decay && !is_movable(model, *eigenvalue) {
                return Err(Uncontrollable::Eigenvalue {
                    mode: number,
                    eigenvalue: *eigenvalue,
                    decay: spec.decay,
                });
            }
        }
        if !is_movable(model, Complex::new(1.0, 0.0)) {
            return Err(Uncontrollable::Tracked { mode: number });
        }
        for (harmonic, angle) in spec.resonators.iter().enumerate() {
            if !is_movable(model, Complex::from_polar(1.0, *angle)) {
                return Err(Uncontrollable::Harmonic {
                    mode: number,
                    harmonic: harmonic + 1,
                });
            }
        }
    }
    Ok(())
}

/// Whether `[lambda I - A, B]` has full row rank.
fn is_movable(model: &AugmentedMode, eigenvalue: Complex<f64>) -> bool {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let states = model.a.nrows();
    let shifted = DMatrix::from_diagonal_element(states, states, eigenvalue) - complex(&model.a);
    let mut pencil = shifted.resize_horizontally(states + model.b.ncols(), Complex::new(0.0, 0.0));
    pencil
        .columns_mut(states, model.b.ncols())
        .copy_from(&complex(&model.b));
    let values = pencil.singular_values();
    values.min() > RANK_TOLERANCE * values.max()
}
