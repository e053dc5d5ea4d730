//! What a design takes where nothing is asked for, and what it chooses for the on-line path without being asked: each
//! with its unit and its reason. The constants of the on-line path itself are `ftc_control`'s
//! ([`Tuning`](ftc_control::tuning::Tuning)).

/// Decay rate of the feedback, per sample: a loop that forgets in about sixty samples.
pub(crate) const DECAY: f64 = 0.95;
/// Weight of a tracked output, per nominal value: what is wanted, to which the others compare.
pub(crate) const OUTPUT_WEIGHT: f64 = 1.0;
/// Weight of its integral, per nominal value times second: an offset counts once it has lasted.
pub(crate) const INTEGRAL_WEIGHT: f64 = 0.3;
/// Weight of an input, per nominal value: commands are cheap, but not free.
pub(crate) const INPUT_WEIGHT: f64 = 0.1;

/// Relative error of the plant's matrices (1): that of a model of usual quality.
pub(crate) const MODEL_ERROR: f64 = 0.05;
/// Faults per sample and sensor.
pub(crate) const FAULT_RATE: f64 = 1e-5;
/// Mean length of a fault in samples.
pub(crate) const FAULT_LENGTH: f64 = 1000.0;
/// Mean length of a mode in samples, where none is given.
pub const MODE_LENGTH: f64 = 500.0;

/// Freezes per sample and sensor. Rarer than other faults: readings that agree with a constant for a
/// while are common at rest.
pub(crate) const STUCK_RATE: f64 = 1e-7;
/// Jumps of a present fault per sample: one in its usual length.
pub(crate) const CHANGE_RATE: f64 = 1e-3;
/// Jumps of loads or input gains per sample: as rare as faults.
pub(crate) const LOAD_RATE: f64 = 1e-5;
/// Relative error (1) of the matrices of a plant that is no longer the model.
pub(crate) const CHANGED_ERROR: f64 = 1.0;
/// Log odds (nat) of a sensor's fault against the best explanation without one: 20 to 1.
pub(crate) const ODDS: f64 = 3.0;
/// Wander of an abrupt fault per sample, in noise deviations: it hardly moves.
pub(crate) const FAULT_WALK: f64 = 0.05;
/// Wander of a fault that grew slowly per sample, in noise deviations: it goes on growing.
pub(crate) const DRIFT_WALK: f64 = 0.5;
/// Size (1) of a fault without a known range, relative to the nominal value and to the operating point.
pub(crate) const FAULT_SIZE: [f64; 2] = [0.6, 0.5];
/// Size (1) of a fault relative to a known range.
pub(crate) const FAULT_OF_RANGE: f64 = 0.5;
/// Authority (1) without a known range, relative to the nominal value (or what the references reach) and to the operating
/// point. Wide, since a reading corrected by less than its fault may leave the loop unstable; finite, since so may a
/// correction of a fault that is none.
pub(crate) const AUTHORITY: [f64; 2] = [10.0, 8.0];
/// Size (1) of a load on an input relative to its nominal value.
pub(crate) const INPUT_LOAD: f64 = 0.2;
/// Displacement (1) at rest by a load on a state, relative to the state's nominal value.
pub(crate) const STATE_LOAD: f64 = 0.03;
/// Wander (1) of a load per sample relative to the size of its jumps.
pub(crate) const LOAD_WALK: f64 = 5e-3;
/// Wander (1) of a disturbance per sample, relative to its size: what a sine with a period of ninety samples does at
/// most. Less of it and a disturbance whose period is told wrong is taken for a gain of the inputs that it moves.
pub(crate) const DISTURBANCE_WALK: f64 = 0.07;
/// Relative error (1) of an input's gain: an actuator that has lost a third.
pub(crate) const GAIN_ERROR: f64 = 0.3;
/// Its wander (1) per sample.
pub(crate) const GAIN_WALK: f64 = 1e-4;
/// Relative error (1) of the disturbance's period.
pub(crate) const PERIOD_ERROR: f64 = 0.05;
/// How far (1) the disturbance may move an output where its size is not known, relative to nominal.
pub(crate) const DISTURBANCE: f64 = 0.05;
/// Error (1) of the state at the start relative to its nominal value.
pub(crate) const START: f64 = 3e-3;

/// Noise (1) that the state-based estimator assumes at least, relative to the threshold.
pub(crate) const SMALLEST_NOISE: f64 = 0.05;
/// Share (1) of what saturation took off that unwinds the integrator in one sample.
pub(crate) const UNWINDING: f64 = 0.5;
/// Largest fault (1) of a sensor without a range, relative to the nominal value of its output.
pub(crate) const LARGEST_FAULT: f64 = 1e6;

/// Consecutive samples that raise or release a fault: the first sample beyond its threshold counts.
pub(crate) const DEBOUNCE: u32 = 1;
/// The smallest threshold (1) that is chosen automatically, relative to the nominal value.
pub(crate) const SMALLEST_THRESHOLD: f64 = 1e-3;
/// A threshold opens by so much more (1) than the largest known response to the disturbance before that
/// is learned. While least squares learns, what is left of any such response stays below `1 / OPENING_FACTOR` of
/// that opening (Cauchy-Schwarz), hence below the half from which the estimator learns.
pub(crate) const OPENING_FACTOR: f64 = 2.5;
/// Periods over which harmonics are averaged: a few, so that noise averages out.
pub(crate) const MEMORY_PERIODS: f64 = 10.0;
/// Samples over which they are averaged at least, however short the period.
pub(crate) const LEAST_MEMORY: f64 = 200.0;
/// Samples a sliding window holds beyond those its own inputs can explain.
pub(crate) const WINDOW_MARGIN: usize = 20;
/// Seed of the commissioning run; any will do, but the same design must give the same bytes.
pub(crate) const COMMISSIONING_SEED: u64 = 20;
