//! The error dynamics of an observer in its certificate's units, enclosed.

use super::ObserverDesign;
use crate::certificate::{Enclosure, scaled_plant};
use ftc_control::Matrix;
use ftc_control::parameters::ObserverKind;
use ftc_plant::SwitchedPlant;
use ftc_record::dense;

/// The error dynamics `T_ij A_i - K_i C_i` of an observer in its certificate's units, enclosed; of a
/// Kalman filter the error of the prediction, `A_i - A_i H_i C_i`, whatever mode follows.
pub(crate) fn error_dynamics(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    i: usize,
    j: usize,
) -> Enclosure {
    if design.observer.kind == ObserverKind::Kalman {
        return corrected_error(plant, design, i, &design.observer.decoupling[i][i]);
    }
    let (states, outputs) = (&design.certificate.states, &design.certificate.outputs);
    let matrix = scaled_plant;
    let (own, next) = (&plant.modes[i], &plant.modes[j]);
    let a = matrix(&own.a, states, states);
    let gain = matrix(&dense(&design.observer.gains[i]), states, outputs);
    let decoupling = matrix(&dense(&design.observer.decoupling[i][j]), states, outputs);
    let seen = &matrix(&next.c, outputs, states) * &a;
    let injected = &gain * &matrix(&own.c, outputs, states);
    &(&a - &(&decoupling * &seen)) - &injected
}

/// `A_i - A_i H C_i` of a filter in correction form, in the observer's units, enclosed.
pub(crate) fn corrected_error(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    mode: usize,
    gain: &Matrix,
) -> Enclosure {
    let (states, outputs) = (&design.certificate.states, &design.certificate.outputs);
    let a = scaled_plant(&plant.modes[mode].a, states, states);
    let c = scaled_plant(&plant.modes[mode].c, outputs, states);
    let h = scaled_plant(&dense(gain), states, outputs);
    &a - &(&(&a * &h) * &c)
}
