//! The test slave, its C functions as a C program sees them, and an instance for the tests.

#[path = "../../examples/staircase.rs"]
pub mod staircase;

use fmu_abi::types::*;
use std::ffi::{CStr, CString, c_void};
use std::sync::Mutex;

unsafe extern "C" {
    pub fn fmi2GetTypesPlatform() -> Text;
    pub fn fmi2GetVersion() -> Text;
    pub fn fmi2Instantiate(
        name: Text,
        kind: Choice,
        guid: Text,
        resources: Text,
        functions: *const CallbackFunctions,
        visible: Boolean,
        logging: Boolean,
    ) -> Pointer;
    pub fn fmi2FreeInstance(c: Pointer);
    pub fn fmi2SetDebugLogging(c: Pointer, on: Boolean, n: usize, names: *const Text) -> Status;
    pub fn fmi2SetupExperiment(
        c: Pointer,
        tolerance_defined: Boolean,
        tolerance: Real,
        start: Real,
        stop_defined: Boolean,
        stop: Real,
    ) -> Status;
    pub fn fmi2EnterInitializationMode(c: Pointer) -> Status;
    pub fn fmi2ExitInitializationMode(c: Pointer) -> Status;
    pub fn fmi2Terminate(c: Pointer) -> Status;
    pub fn fmi2Reset(c: Pointer) -> Status;
    pub fn fmi2GetReal(c: Pointer, vr: *const u32, n: usize, value: *mut Real) -> Status;
    pub fn fmi2GetInteger(c: Pointer, vr: *const u32, n: usize, value: *mut Integer) -> Status;
    pub fn fmi2GetBoolean(c: Pointer, vr: *const u32, n: usize, value: *mut Boolean) -> Status;
    pub fn fmi2GetString(c: Pointer, vr: *const u32, n: usize, value: *mut Text) -> Status;
    pub fn fmi2SetReal(c: Pointer, vr: *const u32, n: usize, value: *const Real) -> Status;
    pub fn fmi2SetInteger(c: Pointer, vr: *const u32, n: usize, value: *const Integer) -> Status;
    pub fn fmi2SetBoolean(c: Pointer, vr: *const u32, n: usize, value: *const Boolean) -> Status;
    pub fn fmi2SetString(c: Pointer, vr: *const u32, n: usize, value: *const Text) -> Status;
    pub fn fmi2GetFMUstate(c: Pointer, state: *mut Pointer) -> Status;
    pub fn fmi2SetFMUstate(c: Pointer, state: Pointer) -> Status;
    pub fn fmi2FreeFMUstate(c: Pointer, state: *mut Pointer) -> Status;
    pub fn fmi2SerializedFMUstateSize(c: Pointer, state: Pointer, size: *mut usize) -> Status;
    pub fn fmi2SerializeFMUstate(c: Pointer, state: Pointer, to: *mut Byte, size: usize) -> Status;
    pub fn fmi2DeSerializeFMUstate(
        c: Pointer,
        from: *const Byte,
        size: usize,
        state: *mut Pointer,
    ) -> Status;
    pub fn fmi2GetDirectionalDerivative(
        c: Pointer,
        unknowns: *const u32,
        unknown_count: usize,
        knowns: *const u32,
        known_count: usize,
        changes: *const Real,
        out: *mut Real,
    ) -> Status;
    pub fn fmi2SetRealInputDerivatives(
        c: Pointer,
        vr: *const u32,
        n: usize,
        order: *const Integer,
        value: *const Real,
    ) -> Status;
    pub fn fmi2GetRealOutputDerivatives(
        c: Pointer,
        vr: *const u32,
        n: usize,
        order: *const Integer,
        value: *mut Real,
    ) -> Status;
    pub fn fmi2DoStep(c: Pointer, point: Real, step: Real, no_set_before: Boolean) -> Status;
    pub fn fmi2CancelStep(c: Pointer) -> Status;
    pub fn fmi2GetStatus(c: Pointer, kind: Choice, value: *mut Choice) -> Status;
    pub fn fmi2GetRealStatus(c: Pointer, kind: Choice, value: *mut Real) -> Status;
    pub fn fmi2GetIntegerStatus(c: Pointer, kind: Choice, value: *mut Integer) -> Status;
    pub fn fmi2GetBooleanStatus(c: Pointer, kind: Choice, value: *mut Boolean) -> Status;
    pub fn fmi2GetStringStatus(c: Pointer, kind: Choice, value: *mut Text) -> Status;
    pub fn fmi2EnterEventMode(c: Pointer) -> Status;
    pub fn fmi2NewDiscreteStates(c: Pointer, info: *mut c_void) -> Status;
    pub fn fmi2EnterContinuousTimeMode(c: Pointer) -> Status;
    pub fn fmi2CompletedIntegratorStep(
        c: Pointer,
        no_set_before: Boolean,
        enter_event_mode: *mut Boolean,
        terminate: *mut Boolean,
    ) -> Status;
    pub fn fmi2SetTime(c: Pointer, time: Real) -> Status;
    pub fn fmi2SetContinuousStates(c: Pointer, x: *const Real, n: usize) -> Status;
    pub fn fmi2GetDerivatives(c: Pointer, x: *mut Real, n: usize) -> Status;
    pub fn fmi2GetEventIndicators(c: Pointer, x: *mut Real, n: usize) -> Status;
    pub fn fmi2GetContinuousStates(c: Pointer, x: *mut Real, n: usize) -> Status;
    pub fn fmi2GetNominalsOfContinuousStates(c: Pointer, x: *mut Real, n: usize) -> Status;
}

/// Value references of the staircase.
pub const INPUT: [u32; 2] = [0, 1];
pub const REFERENCE: u32 = 2;
pub const MODE: u32 = 3;
pub const MODE_REAL: u32 = 4;
pub const GAIN: u32 = 5;
pub const START_AT_ONE: u32 = 6;
pub const EARLY: [u32; 2] = [7, 8];
pub const LATE: [u32; 2] = [9, 10];
pub const TICKS: u32 = 11;
pub const ODD: u32 = 12;

/// Reals that can be read back, in order.
pub const REALS: [u32; 9] = [0, 1, 2, 4, 5, 7, 8, 9, 10];

/// What an importer's log received: status, category, message.
pub type Messages = Mutex<Vec<(Status, String, String)>>;

/// A folder with the staircase's resource, removed when dropped.
pub struct Resources {
    pub folder: tempfile::TempDir,
    pub guid: CString,
}

impl Resources {
    pub fn new(sample_time: f64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let text = format!("{sample_time:?}");
        std::fs::write(folder.path().join(staircase::RESOURCE), &text).unwrap();
        let guid = model_description::guid(staircase::IDENTIFIER, text.as_bytes());
        Self {
            folder,
            guid: CString::new(guid).unwrap(),
        }
    }

    pub fn uri(&self) -> CString {
        CString::new(format!("file://{}", self.folder.path().display())).unwrap()
    }
}

/// One instance, freed when dropped.
pub struct Instance {
    pub c: Pointer,
    pub messages: Box<Messages>,
}

/// The callbacks of an importer that keeps messages in `messages`.
pub fn callbacks(messages: &Messages) -> CallbackFunctions {
    CallbackFunctions {
        logger: Some(logger()),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: (&raw const *messages).cast_mut().cast(),
    }
}

/// A logger with the standard's signature; the further arguments of a variadic function are of
/// no interest to it.
pub fn logger() -> LoggerCallback {
    unsafe extern "C" fn log(
        environment: Pointer,
        _name: Text,
        status: Status,
        category: Text,
        message: Text,
    ) {
        let text = |text: Text| {
            unsafe { CStr::from_ptr(text) }
                .to_str()
                .unwrap()
                .to_string()
        };
        let messages = unsafe { &*environment.cast::<Messages>() };
        messages
            .lock()
            .unwrap()
            .push((status, text(category), text(message)));
    }
    type Fixed = unsafe extern "C" fn(Pointer, Text, Status, Text, Text);
    // SAFETY: a callee with fixed arguments may be called through the variadic type on the
    // platforms where the tests run (System V and Windows x86-64).
    unsafe { std::mem::transmute::<Fixed, LoggerCallback>(log) }
}

impl Instance {
    pub fn new(resources: &Resources) -> Self {
        Self::made(resources, callbacks, 1)
    }

    /// The same with callbacks made from its log, and logging switched on or off.
    pub fn made(
        resources: &Resources,
        callbacks: impl FnOnce(&Messages) -> CallbackFunctions,
        logging: Boolean,
    ) -> Self {
        let messages: Box<Messages> = Box::default();
        let callbacks = callbacks(&messages);
        let c = unsafe {
            fmi2Instantiate(
                c"test".as_ptr(),
                CO_SIMULATION,
                resources.guid.as_ptr(),
                resources.uri().as_ptr(),
                &callbacks,
                0,
                logging,
            )
        };
        assert!(!c.is_null(), "{:?}", messages.lock().unwrap());
        Self { c, messages }
    }

    /// An instance in state "step complete" at time `start`.
    pub fn started(resources: &Resources, start: f64) -> Self {
        let instance = Self::new(resources);
        instance.start(start);
        instance
    }

    pub fn start(&self, start: f64) {
        unsafe {
            assert_eq!(
                fmi2SetupExperiment(self.c, 0, 0.0, start, 0, 0.0),
                Status::Ok
            );
            assert_eq!(fmi2EnterInitializationMode(self.c), Status::Ok);
            assert_eq!(fmi2ExitInitializationMode(self.c), Status::Ok);
        }
    }

    pub fn set(&self, reference: u32, value: f64) -> Status {
        unsafe { fmi2SetReal(self.c, &reference, 1, &value) }
    }

    pub fn set_mode(&self, value: i32) -> Status {
        unsafe { fmi2SetInteger(self.c, &MODE, 1, &value) }
    }

    pub fn real(&self, reference: u32) -> f64 {
        let mut value = f64::NAN;
        let status = unsafe { fmi2GetReal(self.c, &reference, 1, &mut value) };
        assert_eq!(status, Status::Ok);
        value
    }

    pub fn ticks(&self) -> i32 {
        let mut value = -1;
        let status = unsafe { fmi2GetInteger(self.c, &TICKS, 1, &mut value) };
        assert_eq!(status, Status::Ok);
        value
    }

    /// The bits of all Reals and the tick count.
    pub fn bits(&self) -> Vec<u64> {
        let mut values = [0.0; REALS.len()];
        let status =
            unsafe { fmi2GetReal(self.c, REALS.as_ptr(), REALS.len(), values.as_mut_ptr()) };
        assert_eq!(status, Status::Ok);
        let mut bits: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
        bits.push(self.ticks() as u64);
        bits
    }

    pub fn step(&self, from: f64, length: f64) -> Status {
        unsafe { fmi2DoStep(self.c, from, length, 1) }
    }

    pub fn save(&self) -> Pointer {
        let mut state = std::ptr::null_mut();
        assert_eq!(unsafe { fmi2GetFMUstate(self.c, &mut state) }, Status::Ok);
        state
    }

    /// The warnings received so far.
    pub fn warnings(&self) -> Vec<String> {
        let messages = self.messages.lock().unwrap();
        let warned = messages
            .iter()
            .filter(|(status, ..)| *status == Status::Warning);
        warned.map(|(_, _, text)| text.clone()).collect()
    }

    pub fn last_message(&self) -> String {
        let messages = self.messages.lock().unwrap();
        messages
            .last()
            .map(|(_, _, text)| text.clone())
            .unwrap_or_default()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        unsafe { fmi2FreeInstance(self.c) };
    }
}
