//! What an absent key means. What a design asks for by default is the library's: [`Request::new`],
//! [`ControlSpec::new`], [`ObserverSpec::beside`], [`EstimatorSpec`] and [`HypothesesSpec`]; the experiment's
//! defaults are the constants below.
//!
//! [`Request::new`]: ftc_design::assembly::Request::new
//! [`ControlSpec::new`]: ftc_design::ControlSpec::new
//! [`ObserverSpec::beside`]: ftc_design::ObserverSpec::beside
//! [`EstimatorSpec`]: ftc_design::assembly::EstimatorSpec
//! [`HypothesesSpec`]: ftc_design::HypothesesSpec
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
//! | `disturbance.harmonics` | 1 |
//! | `disturbance.amplitude` | unknown: learning starts from nothing |
//! | `controller.output_weight`, `integral_weight`, `input_weight` | 1, 0.3 and 0.1 divided by the nominal value of the signal |
//! | `controller.tracked` | the first outputs, as many as there are inputs |
//! | `controller.latency`, `lyapunov`, `objective`, `decay` | 0, `common`, `attenuation`, 0.95 |
//! | `controller.bumpless`, `feedforward`, `internal_model` | false, true, false |
//! | `observer.kind` | `auto` |
//! | `observer.decay` | that of the controller |
//! | `estimator.method`, `database` | `observer` (`reference` where `database` names logs), `commission` |
//! | `estimator.sigmas`, `debounce`, `stuck_after`, `adapt` | 6, 1 sample, 0 (never), false |
//! | `estimator.authority` | the sensor's range `max - min`; without one ten times the larger of its nominal value and of what the references move it by, plus eight times its largest operating point |
//! | `estimator.input_load` | a fifth of the input's nominal value |
//! | `estimator.model_error`, `fault_rate`, `fault_length`, `ambiguous` | 0.05, 1e-5 a sample, 1000 samples, `trust-sensors` |
//! | `estimator.mode`, `mode_length` | `told`; 500 samples where it is `estimated` |
//! | `estimator.response_length` | until the response has decayed to 1e-7 of itself |
//! | `estimator.threshold` | from `sigmas`, and at least a thousandth of the nominal value of the output |
//! | `compensation.method` | `virtual-sensor` |
//! | `scenario.steps`, `seed` | 1000, 1 |
//! | `scenario.noise`, `fault` | none |
//! | `scenario.schedule` | mode 1 all the time |
//! | `scenario.reference` | a step after a tenth of the run, of 1 if the output has no nominal value, else of a fifth of it |
//! | `scenario.disturbance` | a sine of the known period and amplitude if both are given, else none |
//! | `events.*.until`, ramp `until` | never |
//! | table `time`, `estimator.time` | the column called `t`, `time`, `timestamp` or the like; if there is none, a row is a sample |
//! | table `interpolation` | `hold` |
//! | `scenario.plant.continuous` | as `continuous` of the file |
//! | `scenario.plant` | the plant is what it was designed for |

use ftc_plant::Scenario;

/// `scenario.steps`
pub const STEPS: u64 = 1000;
/// `scenario.seed`
pub const SEED: u64 = Scenario::SEED;
