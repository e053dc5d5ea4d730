//! What a controller holds beside its certified gains, derived from them, the plant and the signals: here when it is
//! assembled, and again when it is checked.

use crate::Signal;
use crate::defaults::{LARGEST_FAULT, SMALLEST_NOISE, UNWINDING};
use crate::feedforward;
use crate::running_loop::{TRANSFER_DECAY, TransferCertificate};
use ftc_control::parameters::{Limits, StateFeedback, Transfer};
use ftc_control::tuning::DatabaseTuning;
use ftc_plant::SwitchedPlant;
use ftc_record::{dense, plain};

/// The certified gains as the controller runs them, with or without reference feedforward. What saturation takes off an input unwinds
/// the integral by half of what would undo it; inputs without a limit never saturate.
pub fn feedback(
    control: &crate::StateFeedback,
    plant: &SwitchedPlant,
    transfer: Option<&TransferCertificate>,
    feedforward: bool,
    limits: &[Limits],
) -> StateFeedback {
    let mut feedback = control.for_controller(plant);
    feedback.transfer = transfer.map(|proved| Transfer {
        samples: proved.samples(),
        decay: TRANSFER_DECAY,
    });
    if feedforward {
        let found = feedforward::feedforward(plant, control);
        for (gains, gain) in feedback.modes.iter_mut().zip(found) {
            gains.feedforward = plain(&gain);
        }
    }
    for gains in &mut feedback.modes {
        let mut unwinding = dense(&gains.anti_windup);
        for (mut column, limit) in unwinding.column_iter_mut().zip(limits) {
            let limited = limit.min.is_some() || limit.max.is_some();
            column *= if limited { UNWINDING } else { 0.0 };
        }
        gains.anti_windup = plain(&unwinding);
    }
    feedback
}

/// Standard deviation of each sensor's noise (p) for the state-based estimator: that of the scenario, and
/// never below what the smallest threshold stands for.
pub(crate) fn sensor_noise(given: &[f64], thresholds: &[f64]) -> Vec<f64> {
    let deviations = DatabaseTuning::default().threshold_deviations;
    let sensors = given.iter().zip(thresholds);
    sensors
        .map(|(&noise, &threshold)| match noise > 0.0 {
            true => noise.max(SMALLEST_NOISE * threshold),
            false => threshold / deviations,
        })
        .collect()
}

/// The largest estimate of each sensor's fault (p).
pub(crate) fn largest_faults(outputs: &[Signal]) -> Vec<f64> {
    outputs.iter().map(largest_fault).collect()
}

fn largest_fault(output: &Signal) -> f64 {
    let range = output.max.zip(output.min).map(|(max, min)| max - min);
    range.unwrap_or(LARGEST_FAULT * output.nominal)
}
