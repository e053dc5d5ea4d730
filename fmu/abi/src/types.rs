//! The C types of FMI 2.0 (`fmi2TypesPlatform.h`, `fmi2FunctionTypes.h`), platform "default".

use std::ffi::{c_char, c_int, c_void};

/// `fmi2Component`, `fmi2ComponentEnvironment`, `fmi2FMUstate`: opaque pointers.
pub type Pointer = *mut c_void;
/// `fmi2ValueReference`.
pub type ValueReference = u32;
/// `fmi2Real`.
pub type Real = f64;
/// `fmi2Integer`.
pub type Integer = c_int;
/// `fmi2Boolean`: 0 is false, the rest is true.
pub type Boolean = c_int;
/// `fmi2String`: UTF-8, terminated by a zero.
pub type Text = *const c_char;
/// `fmi2Byte`.
pub type Byte = c_char;
/// An enumeration that the importer passes in; any number may arrive.
pub type Choice = c_int;

/// `fmi2Status`, in the order of its numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// All well.
    Ok,
    /// Not quite right, but the computation goes on.
    Warning,
    /// The asked-for information cannot be given.
    Discard,
    /// The call was refused or failed; other instances are not affected.
    Error,
    /// The instance is beyond repair; it may only be freed.
    Fatal,
    /// The computation goes on in the background; never returned here.
    Pending,
}

/// `fmi2Type`: what the importer wants; only co-simulation is offered.
pub const CO_SIMULATION: Choice = 1;

/// `fmi2StatusKind`: the end of the last step that succeeded.
pub const LAST_SUCCESSFUL_TIME: Choice = 2;

/// `fmi2StatusKind`: whether the slave wants the simulation to end.
pub const TERMINATED: Choice = 3;

/// `fmi2CallbackLogger`.
pub type LoggerCallback = unsafe extern "C" fn(Pointer, Text, Status, Text, Text, ...);

/// `fmi2CallbackFunctions`. Only the logger is used: memory comes from Rust's allocator, and no
/// step runs in the background.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct CallbackFunctions {
    /// Receives messages.
    pub logger: Option<LoggerCallback>,
    /// Not used.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> Pointer>,
    /// Not used.
    pub free_memory: Option<unsafe extern "C" fn(Pointer)>,
    /// Not used.
    pub step_finished: Option<unsafe extern "C" fn(Pointer, Status)>,
    /// Handed back to the logger.
    pub component_environment: Pointer,
}

/// `fmi2EventInfo`, of model exchange only; never filled in.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EventInfo {
    /// Not used.
    pub new_discrete_states_needed: Boolean,
    /// Not used.
    pub terminate_simulation: Boolean,
    /// Not used.
    pub nominals_of_continuous_states_changed: Boolean,
    /// Not used.
    pub values_of_continuous_states_changed: Boolean,
    /// Not used.
    pub next_event_time_defined: Boolean,
    /// Not used.
    pub next_event_time: Real,
}
