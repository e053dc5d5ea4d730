//! One scalar variable of an FMU.
#![expect(
    clippy::exhaustive_structs,
    clippy::exhaustive_enums,
    reason = "FMI 2.0 says what a variable has"
)]

/// How a variable is used by the importer (FMI 2.0, section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set by the importer, no signal.
    Parameter,
    /// A signal that comes in.
    Input,
    /// A signal that goes out.
    Output,
}

impl Causality {
    /// As FMI 2.0 writes it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Parameter => "parameter",
            Self::Input => "input",
            Self::Output => "output",
        }
    }
}

/// When a variable may change (FMI 2.0, section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variability {
    /// Never after initialization.
    Fixed,
    /// Whenever the importer sets it between two steps.
    Tunable,
    /// At ticks only; every signal of a sampled system is of this kind.
    Discrete,
    /// At any time.
    Continuous,
}

/// Where the value at the start comes from (FMI 2.0, section 2.2.7). Inputs have none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initial {
    /// The start value.
    Exact,
    /// Computed during initialization.
    Calculated,
}

/// Type and range of a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Double precision.
    Real {
        /// Unit, as the user writes it; `None` for a pure number.
        unit: Option<String>,
        /// Unit in which a person would rather read it.
        display_unit: Option<String>,
        /// Typical magnitude, positive.
        nominal: Option<f64>,
        /// Least value.
        min: Option<f64>,
        /// Greatest value.
        max: Option<f64>,
        /// Whether it is a difference, which a unit's offset does not apply to.
        relative: bool,
    },
    /// 32 bit signed.
    Integer {
        /// Least value.
        min: Option<i32>,
        /// Greatest value.
        max: Option<i32>,
    },
    /// True or false, held as 1 or 0.
    Boolean,
}

/// What a variable means, so that code finds its signals without strings.
///
/// One role is one vector (or one scalar) in a table, contiguous and in order. The controller's
/// command is an output there and an input of the plant: the role is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// `y`, measured outputs (p).
    Measurement,
    /// `y_ref`, references of the tracked outputs (r).
    Reference,
    /// `mode`, the active mode counted from 1; as an input, 0 means not told yet.
    Mode,
    /// `mode_real`, the mode as a Real; 0 means not connected.
    ModeReal,
    /// `u`, commands (m).
    Command,
    /// `x_hat`, state estimate (n).
    StateEstimate,
    /// `f_hat`, estimate of the sensor faults (p).
    FaultEstimate,
    /// `residual`, measurement less prediction (p).
    Residual,
    /// `fault`, flags (p).
    FaultFlag,
    /// `fault_real`, the flags as Reals (p).
    FaultFlagReal,
    /// `suspect`, flags (p).
    Suspect,
    /// `model_valid`, a flag.
    ModelValid,
    /// `load_hat` (m).
    LoadEstimate,
    /// `actuator_fault`, flags (m).
    ActuatorFault,
    /// `mode_hat`, the mode that the readings fit, counted from 1.
    ModeEstimate,
    /// `mode_hat_real`, the same as a Real.
    ModeEstimateReal,
    /// `mode_probability`, of each mode.
    ModeProbability,
    /// `ftc_enabled`, switches the compensation.
    FtcEnabled,
    /// `threshold`, of the residuals (p).
    Threshold,
    /// `f_ext`, sensor faults from outside, added (p).
    ExternalFault,
    /// `w_ext`, disturbances from outside, added (s).
    ExternalDisturbance,
    /// `mode_ext`, the mode while the scenario is off.
    ExternalMode,
    /// `mode_ext_real`, the same as a Real; 0 means not connected.
    ExternalModeReal,
    /// `y_true`, outputs without sensor fault (p).
    TrueOutput,
    /// `x`, states (n).
    State,
    /// `f`, sensor faults in force (p).
    Fault,
    /// `w`, disturbances in force (s).
    Disturbance,
    /// `scenario_enabled`, switches the built-in scenario.
    ScenarioEnabled,
    /// `noise_enabled`, switches the measurement noise.
    NoiseEnabled,
    /// `inject_kind`, kinds of the sensor faults set from outside (p).
    InjectedKind,
    /// `inject_size`, their sizes (p).
    InjectedSize,
    /// `inject_from`, when they begin (p).
    InjectedFrom,
    /// `inject_until`, when they end (p).
    InjectedUntil,
}

/// One scalar variable; its value reference is its position in the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name in structured naming, such as `y[1]`; part of the contract.
    pub name: String,
    /// One line for a person; carries the user's own name of the signal.
    pub description: String,
    /// Type and range.
    pub kind: Kind,
    /// Use.
    pub causality: Causality,
    /// When it changes.
    pub variability: Variability,
    /// Start value; an Integer or a Boolean is held exactly.
    pub start: f64,
    /// Meaning.
    pub role: Role,
    /// Value references on which an output depends *at a communication point*, ascending.
    ///
    /// Empty for every output here: outputs are those of the last tick, so an input set after
    /// it moves none before the next step. That is what keeps a closed loop of two FMUs free
    /// of algebraic loops.
    pub dependencies: Vec<u32>,
    /// Value references on which an output depends during initialization, ascending.
    pub initial_dependencies: Vec<u32>,
}

impl Variable {
    /// Where the value at the start comes from: outputs are computed, parameters are given.
    pub fn initial(&self) -> Option<Initial> {
        match self.causality {
            Causality::Parameter => Some(Initial::Exact),
            Causality::Output => Some(Initial::Calculated),
            Causality::Input => None,
        }
    }
}
