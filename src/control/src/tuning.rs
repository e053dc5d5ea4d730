//! The tuning constants of the on-line path: every number that decides something there and is not part of the
//! design. [`TUNING`] is for the estimator from a database (`method = "reference"`), [`BANK`] for the state-based one
//! (`method = "observer"`), [`DELAY`] for the watch over the command's delay.
//!
//! Thresholds, debounce, leverage limit, rates, sizes and initial variances belong to the design: see
//! [`Estimator`](crate::parameters::Estimator) and [`Hypotheses`](crate::parameters::Hypotheses).

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

/// Tuning constants of the bank of Kalman filters; [`BANK`] holds the values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BankTuning {
    /// Hypotheses kept after a sample, at most: with 6 or 8 random runs had more harm.
    pub kept: usize,
    /// Hypotheses about the same set of faulty sensors, at most: the likeliest, and one that began at another time.
    pub per_sensor_set: usize,
    /// Log likelihood (nat) by which the best hypothesis without a fault may fall behind: it stays, and can
    /// come back from there.
    pub unflagged_range: f64,
    /// Squared whitened innovation (1), beside two for each output, below which nothing is proposed.
    pub quiet: f64,
    /// Log probability of several sensors failing at once over that of one, and of loads on all states over that of one
    /// load (1): less than for independent ones, which would be two.
    pub several: f64,
    /// The same of all loads and gains at once, and of a plant that is no longer the model (1).
    pub everything: f64,
    /// Log probability (nat) of a fault before the first sample: one sensor in a hundred.
    pub start_fault: f64,
    /// Mean of the relative error of a sensor's gain when it begins (1): half of the signal is lost.
    pub gain_fault_mean: f64,
    /// Its variance (1): from none of the signal lost to all.
    pub gain_fault_variance: f64,
    /// Variance of loads and input gains that have ended over that of their jumps (1).
    pub load_remainder: f64,
    /// Standard deviation of loads and input gains at the start over that of their jumps (1).
    pub load_at_start: f64,
    /// Squared difference of two innovations or estimates over their variance (1) up to which they are the same.
    pub same_estimate: f64,
    /// Evidence (nat) of a frozen sensor from which it is proposed.
    pub frozen_evidence: f64,
    /// Evidence (nat) for a frozen sensor by an exactly repeated reading while the model in open loop moves.
    pub repeat_evidence: f64,
    /// Squared distance of an output from the model in open loop over its variance (1) from which loads have moved
    /// it: six deviations.
    pub displaced: f64,
    /// The same up to which they may have ended: two deviations.
    pub returned: f64,
    /// Share of a sample in the running mean of the misfit (1): the last ten samples.
    pub misfit_share: f64,
    /// Variance of a sensor's noise at the start over the design's (1): the design's may be too small.
    pub noise_at_start: f64,
    /// Samples that the variance at the start counts for.
    pub noise_prior: f64,
    /// Samples over which the noise is estimated afterwards.
    pub noise_memory: f64,
    /// Largest variance of the noise over the design's (1): ten times the deviation.
    pub noise_limit: f64,
    /// Squared innovation over its variance (1) beyond which it is not taken for noise: three deviations.
    pub outlier: f64,
    /// Log likelihood (nat) by which a switch at this sample must be more likely than an earlier one to replace it.
    pub switch_restart: f64,
    /// Log likelihood (nat) that a fault whose estimate is zero loses per sample: none is left after two hundred.
    pub fading: f64,
    /// Samples over which the error of the model in open loop is estimated.
    pub run_memory: f64,
    /// Least and largest variance of that error over what the model's error allows (1).
    pub run_share: [f64; 2],
    /// Samples after which a constant load belongs to the plant's usual state.
    pub usual_load: f64,
    /// Standard deviations (1) by which the state at the start may differ from the design's.
    pub start_deviations: f64,
}

/// The values in use.
pub const BANK: BankTuning = BankTuning {
    kept: 12,
    per_sensor_set: 2,
    unflagged_range: 30.0,
    quiet: 8.0,
    several: 1.5,
    everything: 2.0,
    start_fault: -4.6,
    gain_fault_mean: -0.5,
    gain_fault_variance: 0.25,
    load_remainder: 0.01,
    load_at_start: 0.3,
    same_estimate: 0.1,
    frozen_evidence: 4.0,
    repeat_evidence: 5.0,
    displaced: 36.0,
    returned: 4.0,
    misfit_share: 0.1,
    noise_at_start: 4.0,
    noise_prior: 25.0,
    noise_memory: 300.0,
    noise_limit: 100.0,
    outlier: 9.0,
    switch_restart: 3.0,
    fading: 0.05,
    run_memory: 300.0,
    run_share: [0.02, 1.0],
    usual_load: 1000.0,
    start_deviations: 3.0,
};

/// Tuning constants of the watch over the command's delay; [`DELAY`] holds the values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DelayTuning {
    /// Samples, at least, before a delay is reported.
    pub least_samples: u32,
    /// Samples after which it is left undecided.
    pub most_samples: u32,
    /// Logarithm of the likelihood ratio (nat) at which a delay is reported: a chance of `e^-30`.
    pub log_ratio: f64,
    /// How many times smaller (1) the squares of some output must be: a model that is a little wrong fits a wrong
    /// delay better by less than this.
    pub squares_ratio: f64,
    /// What counts as no innovation, over the squares of the readings (1).
    pub zero: f64,
}

/// The values in use.
pub const DELAY: DelayTuning = DelayTuning {
    least_samples: 20,
    most_samples: 500,
    log_ratio: 30.0,
    squares_ratio: 5.0,
    zero: 1e-20,
};
