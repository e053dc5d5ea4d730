//! Taking the estimated fault out of the loop, in two ways.
//!
//! The *virtual sensor* feeds observer and integrator with `y_c = y - f_hat`. By linearity this is
//! the additive control of the paper seen from the measurement's side, with no inverse of `C`
//! and no transient.
//!
//! The *additive control* as printed (37)-(40) leaves observer and integrator on the raw
//! measurement and corrects the command,
//!
//! ```text
//! u_adc(k)   = -K C^+ f_hat(k) - G f_int(k)
//! f_int(k+1) = f_int(k) - Te S f_hat(k)
//! ```
//!
//! which is exact only where `x_hat = C^+ y` at every instant, and whose integral keeps every
//! error of `f_hat` for ever. It is there to be compared with.

use super::kernel;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Writes `measurement - fault` into `out`; a measurement that is not a number is replaced by `substitute`.
pub fn correct(out: &mut [f64], measurement: &[f64], fault: &[f64], substitute: &[f64]) {
    let pairs = measurement.iter().zip(fault).zip(substitute);
    for (corrected, ((&value, &fault), &otherwise)) in out.iter_mut().zip(pairs) {
        *corrected = if is_measurement(value) {
            value - fault
        } else {
            otherwise
        };
    }
}

/// Whether a sensor's number can be a measurement at all.
pub fn is_measurement(value: f64) -> bool {
    value.abs() <= kernel::LARGEST
}

/// The printed additive control of all modes.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct AdditiveControl {
    /// `f_int`: integral of the negative fault estimate on the tracked outputs (r).
    integral: Vec<f64>,
    /// `u_adc` (m).
    control: Vec<f64>,
}

crate::state!(AdditiveControl {
    parts: [integral, control],
    constants: [],
    counters: []
});

impl AdditiveControl {
    /// Nothing to compensate yet.
    pub fn new(tracked: usize, inputs: usize) -> Self {
        Self {
            integral: vec![0.0; tracked],
            control: vec![0.0; inputs],
        }
    }

    /// Adds `u_adc` to `command` (m). `static_gain` is `K C^+` (m x p), `integral_gain` is `G` (m x r).
    pub fn add_to(
        &mut self,
        command: &mut [f64],
        static_gain: &DMatrix<f64>,
        integral_gain: &DMatrix<f64>,
        fault: &[f64],
    ) {
        self.control.fill(0.0);
        kernel::add_product(&mut self.control, static_gain, fault);
        kernel::add_product(&mut self.control, integral_gain, &self.integral);
        kernel::add_scaled(command, -1.0, &self.control);
    }

    /// Integrates the estimate over one sample.
    pub fn advance(&mut self, sample_time: f64, tracked: &[usize], fault: &[f64]) {
        for (sum, &row) in self.integral.iter_mut().zip(tracked) {
            *sum -= sample_time * fault.get(row).copied().unwrap_or(0.0);
        }
        kernel::bound(&mut self.integral);
    }
}
