//! The corrected measurement `y_c = y - f_hat`: the virtual sensor.
//!
//! The printed additive control (37)-(40) is the same thing seen from the command's side: by
//! linearity it is the difference between the command computed from `y_c` and the one from `y`.
//! Feeding the observer and the integrator with `y_c` needs no inverse of `C` and leaves no transient.

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
    value.abs() <= super::kernel::LARGEST
}
