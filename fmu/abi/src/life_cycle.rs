//! Which function may be called in which state: the standard's table (FMI 2.0, section 4.2.4).

use serde::{Deserialize, Serialize};

/// The states of an instance, one bit each, in the order of the table's columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u16)]
pub enum State {
    /// After fmi2Instantiate or fmi2Reset.
    Instantiated = 1 << 0,
    /// Between fmi2EnterInitializationMode and fmi2ExitInitializationMode.
    InitializationMode = 1 << 1,
    /// Between two steps.
    StepComplete = 1 << 2,
    /// A step runs in the background; never reached, steps are synchronous.
    StepInProgress = 1 << 3,
    /// A step was done in part, since it was too long to be done at once.
    StepFailed = 1 << 4,
    /// A background step was cancelled; never reached.
    StepCanceled = 1 << 5,
    /// After fmi2Terminate.
    Terminated = 1 << 6,
    /// The slave failed amid a step.
    Error = 1 << 7,
    /// The slave panicked.
    Fatal = 1 << 8,
}

impl State {
    /// Whether an instance can be saved in this state, and ever is in it.
    pub fn is_savable(self) -> bool {
        let reached = !matches!(self, Self::StepInProgress | Self::StepCanceled);
        reached && Function::GetFMUstate.allowed().contain(self)
    }

    /// What a person calls the state.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "instantiated",
            Self::InitializationMode => "initialization mode",
            Self::StepComplete => "step complete",
            Self::StepInProgress => "step in progress",
            Self::StepFailed => "step failed",
            Self::StepCanceled => "step canceled",
            Self::Terminated => "terminated",
            Self::Error => "error",
            Self::Fatal => "fatal",
        }
    }
}

/// A set of states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct States(u16);

impl States {
    /// No state.
    pub const NONE: Self = Self(0);
    /// Where parameters, start values and inputs can be set before the first step.
    pub const BEFORE_START: Self =
        Self(State::Instantiated as u16 | State::InitializationMode as u16);
    /// The same, and between steps.
    pub const UNTIL_END: Self = Self(Self::BEFORE_START.0 | State::StepComplete as u16);

    /// Whether the state is one of them.
    pub const fn contain(self, state: State) -> bool {
        self.0 & state as u16 != 0
    }

    /// A bit for each of them: [`State`] as a number.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Reads a row of the table: an `x` for each state in the set.
    const fn from_row(row: &str) -> Self {
        let row = row.as_bytes();
        let (mut bits, mut column, mut at) = (0, 0, 0);
        while at < row.len() {
            if row[at] == b'x' {
                bits |= 1 << column;
            }
            if row[at] != b' ' {
                column += 1;
            }
            at += 1;
        }
        assert!(column == 9, "a row has one mark for each state");
        Self(bits)
    }
}

/// Makes the enumeration of functions and the table from one list.
macro_rules! table {
    ($($function:ident $row:literal)*) => {
        /// The functions of FMI 2.0 that act on an instance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the names are the standard's")]
        pub enum Function { $($function),* }

        impl Function {
            /// All of them, in the order of the table.
            pub const ALL: &[Self] = &[$(Self::$function),*];

            /// The C name.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$function => concat!("fmi2", stringify!($function))),* }
            }

            /// The states in which the function may be called.
            pub const fn allowed(self) -> States {
                match self { $(Self::$function => const { States::from_row($row) }),* }
            }
        }
    };
}

// Columns: instantiated, initialization mode, step complete, step in progress, step failed,
// step canceled, terminated, error, fatal. One cell is more lenient than the standard:
// an instance may be freed after fmi2Fatal, since otherwise its memory could never be had back.
table! {
    SetDebugLogging                "x x x x x x x x ."
    FreeInstance                   "x x x . x x x x x"
    SetupExperiment                "x . . . . . . . ."
    EnterInitializationMode        "x . . . . . . . ."
    ExitInitializationMode         ". x . . . . . . ."
    Terminate                      ". . x . x . . . ."
    Reset                          "x x x . x x x x ."
    GetReal                        ". x x . x x x x ."
    GetInteger                     ". x x . x x x x ."
    GetBoolean                     ". x x . x x x x ."
    GetString                      ". x x . x x x x ."
    SetReal                        "x x x . . . . . ."
    SetInteger                     "x x x . . . . . ."
    SetBoolean                     "x x x . . . . . ."
    SetString                      "x x x . . . . . ."
    GetFMUstate                    "x x x . x x x x ."
    SetFMUstate                    "x x x . x x x x ."
    FreeFMUstate                   "x x x . x x x x ."
    SerializedFMUstateSize         "x x x . x x x x ."
    SerializeFMUstate              "x x x . x x x x ."
    DeSerializeFMUstate            "x x x . x x x x ."
    GetDirectionalDerivative       ". x x . x x x x ."
    SetRealInputDerivatives        "x x x . . . . . ."
    GetRealOutputDerivatives       ". . x . x x x x ."
    DoStep                         ". . x . . . . . ."
    CancelStep                     ". . . x . . . . ."
    GetStatus                      ". . x x x . x . ."
    GetRealStatus                  ". . x x x . x . ."
    GetIntegerStatus               ". . x x x . x . ."
    GetBooleanStatus               ". . x x x . x . ."
    GetStringStatus                ". . x x x . x . ."
    EnterEventMode                 ". . . . . . . . ."
    NewDiscreteStates              ". . . . . . . . ."
    EnterContinuousTimeMode        ". . . . . . . . ."
    CompletedIntegratorStep        ". . . . . . . . ."
    SetTime                        ". . . . . . . . ."
    SetContinuousStates            ". . . . . . . . ."
    GetDerivatives                 ". . . . . . . . ."
    GetEventIndicators             ". . . . . . . . ."
    GetContinuousStates            ". . . . . . . . ."
    GetNominalsOfContinuousStates  ". . . . . . . . ."
}
