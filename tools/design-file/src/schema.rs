//! The keys of a design file, table by table, as the user writes them.
//!
//! A key exists exactly when a field here has its name: what is unknown is refused, and the
//! nearest known key is found from these structs. What an absent key means is written down in
//! [`crate::defaults`]; what a value must satisfy, in [`crate::check`].
#![expect(
    clippy::exhaustive_structs,
    clippy::exhaustive_enums,
    reason = "the keys of a design file: only what reads one makes these"
)]

use crate::event::Event;
use crate::signal::Signal;
use crate::values::{Matrix, NameOrList, NumberOrList, Which};
use ftc_plant::rectifier::Rectifier;
use serde::Deserialize;

/// A whole design file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignFile {
    /// Name of the design: a C identifier, it names files and FMUs.
    pub name: String,
    /// `Te` in seconds.
    pub sample_time: f64,
    /// Whether `A`, `B`, `E` describe `dx/dt` rather than the next sample.
    pub continuous: Option<bool>,
    /// The modes of the plant, `[[mode]]`; none where the plant has a model with a name.
    #[serde(rename = "mode", default)]
    pub modes: Vec<Mode>,
    /// A nonlinear plant with a name, in place of the modes.
    pub plant: Option<PlantModel>,
    /// What the signals are called and measured in.
    #[serde(default)]
    pub signals: Signals,
    /// What is known of the periodic disturbance.
    pub disturbance: Option<Disturbance>,
    /// The state feedback that is asked for.
    #[serde(default)]
    pub controller: Controller,
    /// The observer that is asked for.
    #[serde(default)]
    pub observer: Observer,
    /// The fault estimator that is asked for.
    #[serde(default)]
    pub estimator: Estimator,
    /// What is done about an estimated fault.
    #[serde(default)]
    pub compensation: Compensation,
    /// The experiment.
    #[serde(default)]
    pub scenario: Scenario,
}

/// `[plant]`: what is simulated, and linearised for the design.
#[derive(Clone, Debug, Deserialize)]
#[serde(from = "PlantTable")]
pub enum PlantModel {
    /// The averaged three-phase rectifier; one mode per load.
    Rectifier(Rectifier),
}

/// `[plant]` as it is written: a table with a tag would not say which of its keys is at fault.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlantTable {
    model: ModelName,
    inductance: f64,
    resistance: f64,
    capacitance: f64,
    phase_voltage: f64,
    current_loop: f64,
    dc_voltage: f64,
    loads: Vec<f64>,
}

/// Values of `plant.model`.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ModelName {
    Rectifier,
}

impl From<PlantTable> for PlantModel {
    fn from(table: PlantTable) -> Self {
        match table.model {
            ModelName::Rectifier => Self::Rectifier(Rectifier {
                inductance: table.inductance,
                resistance: table.resistance,
                capacitance: table.capacitance,
                phase_voltage: table.phase_voltage,
                current_loop: table.current_loop,
                dc_voltage: table.dc_voltage,
                loads: table.loads,
            }),
        }
    }
}

/// One `[[mode]]`; a matrix is a list of rows, or the name of a variable in `file`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// What the user calls it.
    pub name: Option<String>,
    /// A MATLAB (`.mat`) or NumPy (`.npz`) file with the matrices that are not given as rows.
    pub file: Option<String>,
    /// The structure in `file` whose fields the matrices are.
    #[serde(rename = "struct")]
    pub structure: Option<String>,
    /// State matrix (n x n).
    #[serde(rename = "A")]
    pub a: Option<Matrix>,
    /// Input matrix (n x m).
    #[serde(rename = "B")]
    pub b: Option<Matrix>,
    /// Output matrix (p x n).
    #[serde(rename = "C")]
    pub c: Option<Matrix>,
    /// Direct feedthrough from input to output (p x m).
    #[serde(rename = "D")]
    pub d: Option<Matrix>,
    /// Disturbance to state (n x s).
    #[serde(rename = "E")]
    pub e: Option<Matrix>,
    /// Disturbance to output (p x s).
    #[serde(rename = "F")]
    pub f: Option<Matrix>,
    /// The steady state around which the mode is linear.
    pub operating_point: Option<OperatingPoint>,
}

/// A steady state of one mode.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OperatingPoint {
    /// State (n).
    pub x: Vec<f64>,
    /// Input (m).
    pub u: Vec<f64>,
    /// Output (p).
    pub y: Vec<f64>,
}

/// `[signals]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signals {
    /// Inputs (m).
    pub inputs: Option<Vec<SignalInfo>>,
    /// Outputs (p).
    pub outputs: Option<Vec<SignalInfo>>,
    /// States (n).
    pub states: Option<Vec<SignalInfo>>,
    /// Disturbances (s).
    pub disturbances: Option<Vec<SignalInfo>>,
}

/// What is known of one signal.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignalInfo {
    /// Name.
    pub name: Option<String>,
    /// Unit.
    pub unit: Option<String>,
    /// Typical magnitude of a change.
    pub nominal: Option<f64>,
    /// Smallest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
}

/// `[disturbance]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disturbance {
    /// Period in seconds.
    pub period: f64,
    /// Number of harmonics, the fundamental included.
    pub harmonics: Option<usize>,
    /// Largest value of each disturbance (number or s).
    pub amplitude: Option<NumberOrList>,
}

/// `[controller]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// The outputs that follow a reference.
    pub tracked: Option<Vec<Which>>,
    /// Samples between a measurement and the first effect of its command.
    pub latency: Option<i64>,
    /// Which guarantee of stability under switching.
    pub lyapunov: Option<LyapunovKind>,
    /// What the gains are chosen for.
    pub objective: Option<ObjectiveKind>,
    /// Decay rate per sample.
    pub decay: Option<f64>,
    /// Weight of each tracked output (number or r).
    pub output_weight: Option<NumberOrList>,
    /// Weight of each tracking-error integral (number or r).
    pub integral_weight: Option<NumberOrList>,
    /// Weight of each input (number or m).
    pub input_weight: Option<NumberOrList>,
    /// No jump of the command at a mode switch.
    pub bumpless: Option<bool>,
    /// The reference acts on the command at once.
    pub feedforward: Option<bool>,
    /// Asymptotic rejection of the periodic disturbance.
    pub internal_model: Option<bool>,
}

/// Values of `controller.lyapunov`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LyapunovKind {
    /// One Lyapunov function for all modes.
    Common,
    /// One per mode, every switch proved.
    Switched,
    /// One per mode, modes must last.
    Dwell,
}

/// Values of `controller.objective`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectiveKind {
    /// Least gain from the disturbance to the performance signal (T2).
    Attenuation,
    /// Stability with the decay rate only (T1).
    Decay,
}

/// `[observer]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observer {
    /// Which observer.
    pub kind: Option<ObserverKind>,
    /// Decay rate of the estimation error per sample.
    pub decay: Option<f64>,
}

/// Values of `observer.kind`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObserverKind {
    /// Unknown input observer.
    Uio,
    /// Luenberger observer.
    Luenberger,
    /// Kalman filter chosen for the running loop.
    Kalman,
    /// The one that serves the running loop best.
    Auto,
}

/// `[estimator]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Estimator {
    /// How faults are estimated.
    pub method: Option<EstimatorMethod>,
    /// Past inputs the output depends on, in samples.
    pub response_length: Option<i64>,
    /// `commission`, `model`, the name of a CSV file, or a list of one per mode.
    pub database: Option<NameOrList>,
    /// The time column of the logs, where it has no usual name.
    pub time: Option<String>,
    /// Residual that flags a fault, per sensor (number or p).
    pub threshold: Option<NumberOrList>,
    /// The same in standard deviations of the healthy residual.
    pub sigmas: Option<f64>,
    /// Consecutive samples that raise or release a fault.
    pub debounce: Option<i64>,
    /// Repetitions of one reading after which a sensor is taken for frozen.
    pub stuck_after: Option<i64>,
    /// Whether the response goes on being learned while all is well.
    pub adapt: Option<bool>,
    /// Relative error of the entries of the plant's matrices.
    pub model_error: Option<f64>,
    /// Faults per sample and sensor.
    pub fault_rate: Option<f64>,
    /// Mean length of a fault in samples.
    pub fault_length: Option<f64>,
    /// Whether sensors or model are used where a slow divergence could be a sensor's drift or a load.
    pub ambiguous: Option<Ambiguous>,
    /// Whether the active mode is told, or found from the readings.
    pub mode: Option<ModeSource>,
    /// Mean length of a mode in samples, where it is found.
    pub mode_length: Option<f64>,
    /// Largest correction, per sensor (number or p).
    pub authority: Option<NumberOrList>,
    /// Size of a load on each input (number or m).
    pub input_load: Option<NumberOrList>,
}

/// The value of `estimator.database` for a commissioning run on the model.
pub const COMMISSION: &str = "commission";
/// The value of `estimator.database` for the model's own response.
pub const MODEL: &str = "model";

impl Estimator {
    /// The logs that the database is taken from, if it is.
    pub fn logs(&self) -> Option<&NameOrList> {
        let kinds = [COMMISSION, MODEL];
        let database = self.database.as_ref();
        database.filter(|given| match given {
            NameOrList::Name(name) => !kinds.contains(&name.as_str()),
            NameOrList::List(_) => true,
        })
    }
}

/// Values of `estimator.mode`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModeSource {
    /// An input of the controller.
    Told,
    /// The readings.
    Estimated,
}

/// Values of `estimator.ambiguous`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ambiguous {
    /// The sensors.
    TrustSensors,
    /// The model.
    TrustModel,
}

/// Values of `estimator.method`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorMethod {
    /// State-based: hypotheses about sensors and plant in competition.
    Observer,
    /// Predictor from a healthy database.
    Reference,
    /// Sliding window as printed in the paper.
    Sliding,
    /// No estimation.
    None,
}

/// `[compensation]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compensation {
    /// How an estimated fault is taken out of the loop.
    pub method: Option<CompensationMethod>,
}

/// Values of `compensation.method`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CompensationMethod {
    /// Observer and integrator see the corrected measurement.
    VirtualSensor,
    /// The additive control as printed in the paper.
    Additive,
    /// The estimate is reported, not used.
    None,
}

/// `[scenario]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Number of samples.
    pub steps: Option<i64>,
    /// Standard deviation of the measurement noise (number or p).
    pub noise: Option<NumberOrList>,
    /// Seed of the noise.
    pub seed: Option<i64>,
    /// Which mode is active from when on.
    pub schedule: Option<Vec<ModeInterval>>,
    /// Reference of each tracked output (r).
    pub reference: Option<Vec<Signal>>,
    /// Additive fault of each sensor (p).
    pub fault: Option<Vec<Signal>>,
    /// Disturbance of each channel (s).
    pub disturbance: Option<Vec<Signal>>,
    /// Faults that are more than an addition.
    pub events: Option<Vec<Event>>,
    /// How the true plant departs from the model.
    pub plant: Option<TruePlant>,
}

/// `[scenario.plant]`: the true plant, as far as it is not what the design is made for.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruePlant {
    /// Other matrices, one entry per mode; a matrix that is left out is that of the model.
    #[serde(rename = "mode")]
    pub modes: Option<Vec<Mode>>,
    /// Whether these describe `dx/dt`; as the whole file, where it is not said.
    pub continuous: Option<bool>,
    /// Largest relative error of the entries of `A`, `B` and `E`.
    pub relative_error: Option<f64>,
    /// Seed of these errors.
    pub seed: Option<i64>,
    /// Gain of each actuator (number or m).
    pub input_gain: Option<NumberOrList>,
    /// Samples by which every reading is late.
    pub sensor_delay: Option<i64>,
    /// Samples by which the mode is told late.
    pub mode_delay: Option<i64>,
    /// Times at which another mode is told.
    pub told: Option<Vec<Told>>,
    /// Constants added to inputs, disturbances or states for a while.
    pub loads: Option<Vec<Load>>,
    /// Faults of actuators; they name an `input` where a sensor's name a `sensor`.
    pub actuator: Option<Vec<Event>>,
}

/// Another mode is told for a while.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Told {
    /// Seconds.
    pub from: f64,
    /// Seconds.
    #[serde(default = "crate::signal::never")]
    pub until: f64,
    /// The mode.
    pub mode: Which,
}

/// A constant added to an input, a disturbance or a state.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// The input.
    pub input: Option<Which>,
    /// The disturbance.
    pub disturbance: Option<Which>,
    /// The state.
    pub state: Option<Which>,
    /// Seconds.
    pub from: f64,
    /// Seconds.
    #[serde(default = "crate::signal::never")]
    pub until: f64,
    /// What is added.
    pub size: f64,
}

/// A mode and the time in seconds from which it is active.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeInterval {
    /// Seconds.
    pub from: f64,
    /// The mode.
    pub mode: Which,
}
