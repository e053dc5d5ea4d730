//! The tuning constants of the estimator from a healthy database (`method = "reference"`) and of what stands in
//! for it: every number there that decides something on line and is not part of the design.
//!
//! Thresholds, debounce, leverage limit and initial variances belong to the design: see
//! [`Estimator`](crate::parameters::Estimator). The state-based estimator keeps its own beside its code.

/// Tuning constants; [`TUNING`] holds the values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tuning {
    /// Threshold over standard deviation of the noise (1): turns a threshold back into a noise level where no
    /// database gives one. The design's default number of deviations.
    pub threshold_deviations: f64,
    /// Share of its threshold (1) below which a residual is learned from: a fault that grows slowly, or
    /// stays just below its threshold, must not be taken for the disturbance.
    pub learning_share: f64,
    /// Deviation of a prediction over the predicted change (1) up to which it is used where the input lies
    /// beyond what the database spans: a loop closed over a less precise one may diverge.
    pub extrapolation_error: f64,
    /// Share of the past (1, per sample) in the running means of squared errors of adaptation: means over
    /// about a hundred samples.
    pub adaptation_memory: f64,
    /// Adapted over fixed mean square error (1) below which the adapted response is preferred: equal ones
    /// leave the database's in use.
    pub adaptation_advantage: f64,
    /// Largest change of an output by adaptation over the database's prediction of it (1): what is learned
    /// wrongly can do no more than this.
    pub adaptation_change: f64,
    /// The same in standard deviations of the noise (1), where the prediction is near zero.
    pub adaptation_deviations: f64,
    /// Samples per coefficient before a learned periodic response counts as known: four times what determines
    /// it without noise.
    pub samples_per_coefficient: u64,
    /// Error of a periodic response carried over from another mode over its size (1): that of a model of
    /// usual quality.
    pub transfer_error: f64,
    /// Length of a direction over the longest row (1) below which it carries no information in the sliding
    /// window: far above rounding, far below noise.
    pub window_rank: f64,
    /// Share of the threshold (1) below which a constant residual, or the rest a fit leaves, is no fault: half
    /// of what would be flagged.
    pub recovery_share: f64,
    /// Initial variance of that fit over that of the noise (1): nothing is known.
    pub recovery_variance: f64,
    /// Thresholds (1) by which a corrected reading and the model in open loop may differ: the model knows
    /// neither the disturbance nor its own error.
    pub open_loop_thresholds: f64,
}

/// The values in use.
pub const TUNING: Tuning = Tuning {
    threshold_deviations: 6.0,
    learning_share: 0.5,
    extrapolation_error: 0.01,
    adaptation_memory: 0.99,
    adaptation_advantage: 0.98,
    adaptation_change: 0.05,
    adaptation_deviations: 3.0,
    samples_per_coefficient: 4,
    transfer_error: 0.1,
    window_rank: 1e-9,
    recovery_share: 0.5,
    recovery_variance: 1e6,
    open_loop_thresholds: 4.0,
};
