//! The tuning constants of the on-line path: every number that decides something there and does not follow from
//! the plant or from what the user tells. They stand in the design's record
//! ([`Estimator::tuning`](crate::parameters::Estimator::tuning)); `default()` holds the values that are designed with.
//!
//! Thresholds, debounce, rates, sizes and initial variances are chosen per design: see
//! [`Estimator`](crate::parameters::Estimator) and [`Hypotheses`](crate::parameters::Hypotheses). Bounds that only keep
//! numbers finite stand where they are used.

mod record;

use record::tuning;
use serde::{Deserialize, Serialize};

/// Most hypotheses of the state-based estimator that may be kept after a sample; its memory is sized by it.
pub const MOST_KEPT: usize = 12;

/// Initial variance over that of the noise (1) of a response of which nothing is known: a few samples outweigh it.
pub const UNKNOWN_VARIANCE: f64 = 1e6;

/// Leverage (1) beyond which a residual is not used: the input then lies so far outside what the database spans that
/// the prediction's deviation is ten times that of the noise.
pub const LEVERAGE_LIMIT: f64 = 100.0;

/// All tuning constants of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Tuning {
    /// Of the estimator from a database (`method = "reference"`, `"sliding"`).
    pub database: DatabaseTuning,
    /// Of the state-based estimator (`method = "observer"`).
    pub bank: BankTuning,
    /// Of the watch over the command's delay.
    pub delay: DelayTuning,
}

tuning! {
    /// Tuning constants of the estimator from a database.
    pub struct DatabaseTuning {
        /// Threshold over standard deviation of the noise (1): turns a threshold back into a noise level where no
        /// database gives one. The design's default number of deviations.
        threshold_deviations: 6.0, [1.0, 1e12];
        /// Share of its threshold (1) below which a residual is learned from: a fault that grows slowly, or
        /// stays just below its threshold, must not be taken for the disturbance.
        learning_share: 0.5, [0.0, 1.0];
        /// Deviation of a prediction over the predicted change (1) up to which it is used where the input lies
        /// beyond what the database spans: a loop closed over a less precise one may diverge.
        extrapolation_error: 0.01, [0.0, 1e12];
        /// Share of the past (1, per sample) in the running means of squared errors of adaptation: means over
        /// about a hundred samples.
        adaptation_memory: 0.99, [0.0, 1.0];
        /// Adapted over fixed mean square error (1) below which the adapted response is preferred: equal ones
        /// leave the database's in use.
        adaptation_advantage: 0.98, [0.0, 1.0];
        /// Largest change of an output by adaptation over the database's prediction of it (1): what is learned
        /// wrongly can do no more than this.
        adaptation_change: 0.05, [0.0, 1e12];
        /// The same in standard deviations of the noise (1), where the prediction is near zero.
        adaptation_deviations: 3.0, [0.0, 1e12];
        /// Samples per coefficient before a learned periodic response counts as known: four times what determines
        /// it without noise.
        samples_per_coefficient: 4.0, [0.0, 1e6];
        /// Error of a periodic response carried over from another mode over its size (1): that of a model of
        /// usual quality.
        transfer_error: 0.1, [0.0, 1e12];
        /// Length of a direction over the longest row (1) below which it carries no information in the sliding
        /// window: far above rounding, far below noise.
        window_rank: 1e-9, [0.0, 1.0];
        /// Share of the threshold (1) below which a constant residual, or the rest a fit leaves, is no fault: half
        /// of what would be flagged.
        recovery_share: 0.5, [0.0, 1.0];
        /// Initial variance of that fit over that of the noise (1): nothing is known.
        recovery_variance: UNKNOWN_VARIANCE, [0.0, 1e12];
        /// Thresholds (1) by which a corrected reading and the model in open loop may differ: the model knows
        /// neither the disturbance nor its own error.
        open_loop_thresholds: 4.0, [0.0, 1e12];
    }
}

tuning! {
    /// Tuning constants of the bank of Kalman filters.
    pub struct BankTuning {
        /// Hypotheses kept after a sample, at most: with 6 or 8 random runs had more harm.
        kept: MOST_KEPT as f64, [1.0, MOST_KEPT as f64];
        /// Hypotheses about the same set of faulty sensors, at most: the likeliest, and one that began at another time.
        per_sensor_set: 2.0, [1.0, MOST_KEPT as f64];
        /// Log likelihood (nat) by which the best hypothesis without a fault may fall behind: it stays, and can
        /// come back from there.
        unflagged_range: 30.0, [0.0, 1e12];
        /// Squared whitened innovation (1) below which nothing is proposed, or a drift explains a sample, per output.
        quiet_per_output: 2.0, [0.0, 1e12];
        /// Beside it, whatever the number of outputs (1).
        quiet_beside: 8.0, [0.0, 1e12];
        /// The same, at most [`quiet_beside`](Self::quiet_beside), above which something may have happened to a
        /// hypothesis, per output. One deviation above its mean.
        unlikely_per_output: 1.0, [0.0, 1e12];
        /// Beside it, whatever the number of outputs (1).
        unlikely_beside: 4.0, [0.0, 1e12];
        /// Log likelihood (nat) by which a drift leads what it explains where the model is trusted.
        drift_lead: 1.0, [0.0, 1e12];
        /// Largest number of sensors (1) of which any two may fail at once; of more, one or all.
        pairs_up_to: 4.0, [0.0, 64.0];
        /// Log probability of two sensors failing at once over that of one, and of loads on all states over that of one
        /// load (1): less than for independent ones, which would be two. Each further sensor adds as much as the second.
        several: 1.5, [1.0, 1e12];
        /// The same of all loads and gains at once, and of a plant that is no longer the model (1).
        everything: 2.0, [0.0, 1e12];
        /// Log probability (nat) of a fault before the first sample: one sensor in a hundred.
        start_fault: -4.6, [-1e6, 1e6];
        /// Mean of the relative error of a sensor's gain when it begins (1): half of the signal is lost.
        gain_fault_mean: -0.5, [-1e6, 1e6];
        /// Its variance (1): from none of the signal lost to all.
        gain_fault_variance: 0.25, [0.0, 1e12];
        /// Variance of loads and input gains that have ended over that of their jumps (1).
        load_remainder: 0.01, [0.0, 1e12];
        /// Standard deviation of loads and input gains at the start over that of their jumps (1).
        load_at_start: 0.3, [0.0, 1e12];
        /// Variance of loads on the states after a switch, beside the model's error, over the square of the loads before
        /// (1): they may have changed sign.
        load_at_switch: 2.0, [0.0, 1e12];
        /// Size of a large jump of the loads on all states over that of a usual one (1).
        large_load: 3.0, [0.0, 1e12];
        /// Log probability (nat) of a large jump over that of a usual one: one in ten.
        large_load_log_rate: -2.3, [-1e6, 0.0];
        /// Largest variance of a load over that of its usual jumps, or over its square (1): six deviations. With two,
        /// what a wrong model does was beyond it, and taken for a fault.
        load_limit: 36.0, [0.0, 1e12];
        /// Largest variance of a fault over that of a new one (1).
        fault_limit: 2.0, [0.0, 1e12];
        /// Variance (1, per sample) by which the error of a sensor's gain wanders.
        gain_fault_walk: 1e-6, [0.0, 1e12];
        /// Square of a usual deviation over that of the nominal value (1): half of it.
        usual_deviation: 0.25, [0.0, 1e12];
        /// Largest variance of a state over the square of its nominal value (1).
        state_limit: 1e8, [0.0, 1e12];
        /// Least variance (1, per sample) that a state gains over the square of its nominal value: it keeps the
        /// covariance regular.
        state_floor: 1e-12, [0.0, 1e12];
        /// The same of the disturbance's states, over the square of their size.
        wave_floor: 1e-8, [0.0, 1e12];
        /// Squared difference of two innovations or estimates over their variance (1) up to which they are the same.
        same_estimate: 0.1, [0.0, 1e12];
        /// Evidence (nat) of a frozen sensor from which it is proposed.
        frozen_evidence: 4.0, [0.0, 1e12];
        /// Evidence (nat) for a frozen sensor by an exactly repeated reading while the model in open loop moves.
        repeat_evidence: 5.0, [0.0, 1e12];
        /// Largest squared innovation over its variance (1) that counts as evidence for a frozen sensor: one outlier
        /// is not enough.
        frozen_outlier: 50.0, [0.0, 1e12];
        /// Evidence (nat) lost per sample: a sensor that is not frozen does not gather any.
        frozen_loss: 0.02, [0.0, 1e12];
        /// Samples over which the value of a frozen sensor is averaged.
        frozen_memory: 200.0, [1.0, 1e12];
        /// Squared distance of an output from the model in open loop over its variance (1) from which loads have moved
        /// it: six deviations.
        displaced: 36.0, [0.0, 1e12];
        /// The same up to which they may have ended: two deviations.
        returned: 4.0, [0.0, 1e12];
        /// Share of a sample in the running mean of the misfit (1): the last ten samples.
        misfit_share: 0.1, [0.0, 1.0];
        /// Largest squared whitened innovation (1) that counts in that mean.
        misfit_limit: 1e3, [0.0, 1e12];
        /// Misfit (1, per output) from which the model does not explain the readings.
        misfit_invalid: 4.0, [0.0, 1e12];
        /// Misfit (1) below which a hypothesis with a fault may lead, per output.
        misfit_of_fault_per_output: 3.0, [0.0, 1e12];
        /// Beside it, whatever the number of outputs (1).
        misfit_of_fault_beside: 6.0, [0.0, 1e12];
        /// Squared whitened innovation (1) of a sample below which it may, per output.
        square_of_fault_per_output: 4.0, [0.0, 1e12];
        /// Beside it, whatever the number of outputs (1).
        square_of_fault_beside: 20.0, [0.0, 1e12];
        /// Deviations of the noise (1) of an estimated bias from which its sensor is suspect.
        suspect_deviations: 6.0, [0.0, 1e12];
        /// Variance of a sensor's noise at the start over the design's (1): the design's may be too small.
        noise_at_start: 4.0, [1.0, 1e12];
        /// Samples that the variance at the start counts for.
        noise_prior: 25.0, [1.0, 1e12];
        /// Samples over which the noise is estimated afterwards.
        noise_memory: 300.0, [1.0, 1e12];
        /// Largest variance of the noise over the design's (1): ten times the deviation.
        noise_limit: 100.0, [1.0, 1e12];
        /// Squared innovation over its variance (1) beyond which it is not taken for noise: three deviations.
        outlier: 9.0, [0.0, 1e12];
        /// Least variance of the model's error over the one assumed (1): a fifth of the deviation.
        model_share_least: 0.04, [1e-6, 1.0];
        /// Largest (1): ten times the deviation.
        model_share_most: 100.0, [1.0, 1e6];
        /// Samples that the assumed variance counts for, where all that is not expected is the model's error.
        model_prior: 8.0, [1.0, 1e12];
        /// Samples over which it is estimated afterwards, counted like that.
        model_memory: 300.0, [1.0, 1e12];
        /// Log likelihood (nat) by which a switch at this sample must be more likely than an earlier one to replace it.
        switch_restart: 3.0, [0.0, 1e12];
        /// Log likelihood (nat) that a fault whose estimate is zero loses per sample: none is left after two hundred.
        fading: 0.05, [0.0, 1e12];
        /// Samples over which the error of the model in open loop is estimated.
        run_memory: 300.0, [1.0, 1e12];
        /// Least variance of that error over what the model's error allows (1).
        run_share_least: 0.02, [0.0, 0.1];
        /// Largest (1).
        run_share_most: 1.0, [0.1, 1.0];
        /// Samples after which a constant load belongs to the plant's usual state.
        usual_load: 1000.0, [1.0, 1e12];
        /// Standard deviations (1) by which the state at the start may differ from the design's.
        start_deviations: 3.0, [0.0, 1e12];
    }
}

tuning! {
    /// Tuning constants of the watch over the command's delay.
    pub struct DelayTuning {
        /// Samples, at least, before a delay is reported.
        least_samples: 20.0, [0.0, 4e9];
        /// Samples after which it is left undecided.
        most_samples: 500.0, [0.0, 4e9];
        /// Logarithm of the likelihood ratio (nat) at which a delay is reported: a chance of `e^-30`.
        log_ratio: 30.0, [0.0, 1e12];
        /// How many times smaller (1) the squares of some output must be: a model that is a little wrong fits a wrong
        /// delay better by less than this.
        squares_ratio: 5.0, [1.0, 1e12];
        /// What counts as no innovation, over the squares of the readings (1).
        zero: 1e-20, [0.0, 1e12];
    }
}

impl Tuning {
    /// The first constant beyond its bounds: its structure, its name and the bounds.
    pub(crate) fn beyond_bounds(&self) -> Option<(&'static str, &'static str, [f64; 2])> {
        let database = self
            .database
            .beyond_bounds()
            .map(|found| ("database", found));
        let bank = || self.bank.beyond_bounds().map(|found| ("bank", found));
        let delay = || self.delay.beyond_bounds().map(|found| ("delay", found));
        let found = database.or_else(bank).or_else(delay);
        found.map(|(part, (name, bounds))| (part, name, bounds))
    }
}

impl BankTuning {
    /// The running mean of a misfit after a sample with this squared whitened innovation, which counts up to
    /// [`misfit_limit`](Self::misfit_limit), and `penalty` beside it.
    pub(crate) fn averaged(&self, misfit: f64, square: f64, penalty: f64) -> f64 {
        misfit + self.misfit_share * (square.min(self.misfit_limit) + penalty - misfit)
    }

    /// [`quiet_per_output`](Self::quiet_per_output) and beside, for `outputs` sensors.
    pub(crate) fn quiet(&self, outputs: usize) -> f64 {
        self.quiet_beside + self.quiet_per_output * outputs as f64
    }

    /// The same of [`unlikely_per_output`](Self::unlikely_per_output), at most `quiet_beside`.
    pub(crate) fn unlikely(&self, outputs: usize) -> f64 {
        let limit = self.unlikely_beside + self.unlikely_per_output * outputs as f64;
        self.quiet_beside.min(limit)
    }

    /// The same of [`misfit_of_fault_per_output`](Self::misfit_of_fault_per_output).
    pub(crate) fn misfit_of_fault(&self, outputs: usize) -> f64 {
        self.misfit_of_fault_beside + self.misfit_of_fault_per_output * outputs as f64
    }

    /// The same of [`square_of_fault_per_output`](Self::square_of_fault_per_output).
    pub(crate) fn square_of_fault(&self, outputs: usize) -> f64 {
        self.square_of_fault_beside + self.square_of_fault_per_output * outputs as f64
    }

    /// Log probability that so many sensors fail, or recover, at once over that of one: [`several`](Self::several)
    /// for two.
    pub(crate) fn together(&self, sensors: u32) -> f64 {
        1.0 + (self.several - 1.0) * (f64::from(sensors) - 1.0)
    }
}
