//! Integral action: `Z(k+1) = Z(k) + Te (y_ref(k) - S y_c(k))`, equations (2) and (19).

use super::kernel;
use super::parameters::FeedbackGains;

/// Advances the tracking-error integral (r entries) by one sample.
///
/// `excess` (m) is what saturation took off the command; back-calculation lets it unwind `integral`.
pub fn advance(
    integral: &mut [f64],
    sample_time: f64,
    reference: &[f64],
    corrected: &[f64],
    tracked: &[usize],
    gains: &FeedbackGains,
    excess: &[f64],
) {
    for ((sum, &target), &row) in integral.iter_mut().zip(reference).zip(tracked) {
        let output = corrected.get(row).copied().unwrap_or(0.0);
        *sum += sample_time * (target - output);
    }
    kernel::add_product(integral, &gains.anti_windup, excess);
    kernel::bound(integral);
}
