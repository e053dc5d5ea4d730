//! What an absent key means. The only place where it is written down.
//!
//! | key | when absent |
//! |---|---|
//! | `continuous` | false: `A`, `B` and `E` give the next sample |
//! | `mode.D` | zero |
//! | `mode.name` | `mode 1`, `mode 2` ... |
//! | `mode.E`, `mode.F` | zero |
//! | `mode.operating_point` | zero |
//! | `signals.*.name` | `u[1]`, `y[1]`, `x[1]` ... |
//! | `signals.*.unit` | none |
//! | `signals.*.nominal` | the largest value of this signal among the operating points; if that is 0, half of `max - min`; if there is none, 1, unless balancing the plant about the known values puts one of these signals beyond a factor of 1000 from 1: then what balancing gives |
//! | `signals.*.min`, `max` | unbounded |
//! | `disturbance` | no periodic disturbance is learned on line |
//! | `disturbance.amplitude` | unknown: learning starts from nothing |
//! | `controller.output_weight`, `integral_weight`, `input_weight` | 1, 0.3 and 0.1 divided by the nominal value of the signal |
//! | `controller.tracked` | the first outputs, as many as there are inputs |
//! | `observer.decay` | that of the controller |
//! | `estimator.method` | `observer`, or `reference` where `database` names a log |
//! | `estimator.authority` | the sensor's range `max - min`; without one 2.5 times its nominal value and twice its largest operating point |
//! | `estimator.input_load` | a fifth of the input's nominal value |
//! | `estimator.model_error`, `fault_rate`, `fault_length`, `ambiguous` | 0.05, 1e-5 a sample, 1000 samples, `trust-sensors` |
//! | `estimator.response_length` | until the response has decayed to 1e-7 of itself |
//! | `estimator.threshold` | from `sigmas`, and at least a thousandth of the nominal value of the output |
//! | `scenario.noise`, `fault` | none |
//! | `scenario.schedule` | mode 1 all the time |
//! | `scenario.reference` | a step after a tenth of the run, of 1 if the output has no nominal value, else of a fifth of it |
//! | `scenario.disturbance` | a sine of the known period and amplitude if both are given, else none |
//! | `events.*.until`, ramp `until` | never |
//! | table `time`, `estimator.time` | the column called `t`, `time`, `timestamp` or the like; if there is none, a row is a sample |
//! | table `interpolation` | `hold` |
//! | `scenario.plant` | the plant is what it was designed for |
//!
//! The other defaults are the constants below.

use crate::schema::{
    CompensationMethod, EstimatorMethod, LyapunovKind, ObjectiveKind, ObserverKind,
};
use ftc_design::assembly::DatabaseSource;

/// `disturbance.harmonics`
pub const HARMONICS: usize = 1;
/// `controller.latency`: FMUs stepped one after the other, the controller first.
pub const LATENCY: usize = 0;
/// `controller.lyapunov`
pub const LYAPUNOV: LyapunovKind = LyapunovKind::Common;
/// `controller.objective`
pub const OBJECTIVE: ObjectiveKind = ObjectiveKind::Attenuation;
/// `controller.decay`
pub const DECAY: f64 = 0.95;
/// `controller.output_weight`, per unit of the nominal value.
pub const OUTPUT_WEIGHT: f64 = 1.0;
/// `controller.integral_weight`, per unit of the nominal value.
pub const INTEGRAL_WEIGHT: f64 = 0.3;
/// `controller.input_weight`, per unit of the nominal value.
pub const INPUT_WEIGHT: f64 = 0.1;
/// `controller.internal_model`
pub const INTERNAL_MODEL: bool = false;
/// `controller.bumpless`
pub const BUMPLESS: bool = false;
/// `controller.feedforward`
pub const FEEDFORWARD: bool = true;
/// `observer.kind`
pub const OBSERVER: ObserverKind = ObserverKind::Auto;
/// `estimator.method`
pub const ESTIMATOR: EstimatorMethod = EstimatorMethod::Reference;
/// `estimator.database`
pub const DATABASE: DatabaseSource = DatabaseSource::Commission;
/// `estimator.sigmas`
pub const SIGMAS: f64 = 6.0;
/// `estimator.debounce`
pub const DEBOUNCE: u32 = 1;
/// `estimator.stuck_after`
pub const STUCK_AFTER: u32 = 0;
/// `estimator.adapt`
pub const ADAPT: bool = false;
/// `compensation.method`
pub const COMPENSATION: CompensationMethod = CompensationMethod::VirtualSensor;
/// `scenario.steps`
pub const STEPS: u64 = 1000;
/// `scenario.seed`
pub const SEED: u64 = 1;
