//! Integral action: `Z(k+1) = Z(k) + Te (y_ref(k) - S y_c(k))`, equations (2) and (19), and
//! resonators that do for a known frequency what the integrator does for a constant.
//!
//! The state holds the `r` integrators first; then, resonator by resonator and tracked output by
//! tracked output, a pair that turns by the resonator's angle each sample and is driven in its
//! first component by `Te (y_ref - y_c)`.

use super::kernel;
use super::parameters::{FeedbackGains, StateFeedback};

/// Advances the integral part (q entries) by one sample.
///
/// `excess` (m) is what saturation took off the command; back-calculation lets it unwind `integral`.
pub fn advance(
    integral: &mut [f64],
    sample_time: f64,
    reference: &[f64],
    corrected: &[f64],
    feedback: &StateFeedback,
    gains: &FeedbackGains,
    excess: &[f64],
) {
    let tracked = &feedback.tracked;
    let errors = || {
        reference.iter().zip(tracked).map(|(&target, &row)| {
            let output = corrected.get(row).copied().unwrap_or(0.0);
            sample_time * (target - output)
        })
    };
    let (integrators, resonators) = integral.split_at_mut(tracked.len().min(integral.len()));
    for (sum, error) in integrators.iter_mut().zip(errors()) {
        *sum += error;
    }
    let groups = resonators.chunks_exact_mut((2 * tracked.len()).max(1));
    for (group, &angle) in groups.zip(&feedback.resonators) {
        let (sine, cosine) = libm::sincos(angle);
        for (pair, error) in group.chunks_exact_mut(2).zip(errors()) {
            if let [a, b] = pair {
                (*a, *b) = (cosine * *a - sine * *b + error, sine * *a + cosine * *b);
            }
        }
    }
    kernel::add_product(integral, &gains.anti_windup, excess);
    kernel::bound(integral);
}
