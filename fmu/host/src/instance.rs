//! One instance, and what an importer does with it.

use crate::{Functions, Model};
use fmu_abi::types::*;
use model_description::{Span, VariableTable};
use std::ffi::{CStr, CString};
use std::ptr::null_mut;
use std::sync::Mutex;

/// What an importer's log received: status, category, message.
pub type Messages = Mutex<Vec<(Status, String, String)>>;

/// One instance of an FMU, freed when dropped.
pub struct Instance {
    /// The component.
    pub c: Pointer,
    /// Its log.
    pub messages: Box<Messages>,
    /// Its variables.
    pub table: VariableTable,
    functions: Functions,
}

// SAFETY: an instance may move between threads, as the standard demands; only one uses it.
unsafe impl Send for Instance {}

unsafe extern "C" fn log(to: Pointer, _: Text, status: Status, category: Text, message: Text) {
    // SAFETY: the FMU hands back what it was given, and strings that end.
    let (messages, texts) = unsafe {
        let texts = [category, message].map(|text| CStr::from_ptr(text).to_string_lossy());
        (&*to.cast::<Messages>(), texts)
    };
    let [category, message] = texts.map(String::from);
    messages.lock().unwrap().push((status, category, message));
}

/// The FMU made no instance; what it wrote to the log.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct NotInstantiated(pub Vec<String>);

impl Instance {
    /// Instantiates.
    ///
    /// # Errors
    /// What the log received.
    pub fn new(functions: Functions, model: &Model) -> Result<Self, NotInstantiated> {
        Self::made(functions, model, &model.guid, &model.location())
    }

    /// The same with another guid and resource location than the model's.
    ///
    /// # Errors
    /// What the log received.
    pub fn made(
        functions: Functions,
        model: &Model,
        guid: &str,
        location: &str,
    ) -> Result<Self, NotInstantiated> {
        type Fixed = unsafe extern "C" fn(Pointer, Text, Status, Text, Text);
        let messages: Box<Messages> = Box::default();
        let callbacks = CallbackFunctions {
            // SAFETY: a callee with fixed arguments may be called through the variadic type on
            // the platforms where tests run (System V and Windows, x86-64).
            logger: Some(unsafe { std::mem::transmute::<Fixed, LoggerCallback>(log) }),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: (&raw const *messages).cast_mut().cast(),
        };
        let [guid, location] = [guid, location].map(|text| CString::new(text).unwrap());
        let name = c"instance".as_ptr();
        // SAFETY: all pointers are good for the call.
        let c = unsafe {
            (functions.instantiate)(
                name,
                CO_SIMULATION,
                guid.as_ptr(),
                location.as_ptr(),
                &callbacks,
                0,
                1,
            )
        };
        if c.is_null() {
            let messages = messages.lock().unwrap();
            let texts = messages.iter().map(|(_, _, text)| text.clone());
            return Err(NotInstantiated(texts.collect()));
        }
        Ok(Self {
            c,
            messages,
            table: model.table.clone(),
            functions,
        })
    }

    /// Switches the log off.
    pub fn silence(&self) {
        // SAFETY: no categories.
        let status = unsafe { (self.functions.set_debug_logging)(self.c, 0, 0, std::ptr::null()) };
        assert_eq!(status, Status::Ok);
    }

    /// The C functions.
    pub fn functions(&self) -> &Functions {
        &self.functions
    }

    /// The vector `y[1..]`, or the scalar, of this name.
    pub fn span(&self, name: &str) -> Span {
        let span = self.table.vector(name);
        assert!(!span.is_empty(), "there is no variable {name}");
        span
    }

    /// Goes through initialization mode; `before_exit` is called in it.
    pub fn initialize(&self, start: f64, before_exit: impl FnOnce(&Self)) {
        self.enter(start);
        before_exit(self);
        // SAFETY: the instance lives.
        let status = unsafe { (self.functions.exit_initialization_mode)(self.c) };
        assert_eq!(status, Status::Ok, "{}", self.last_message());
    }

    /// Goes into initialization mode.
    pub fn enter(&self, start: f64) {
        // SAFETY: the instance lives.
        unsafe {
            let status = (self.functions.setup_experiment)(self.c, 0, 0.0, start, 0, 0.0);
            assert_eq!(status, Status::Ok, "{}", self.last_message());
            assert_eq!(
                (self.functions.enter_initialization_mode)(self.c),
                Status::Ok
            );
        }
    }

    /// Sets the first Reals of a vector.
    pub fn set(&self, span: Span, values: &[f64]) -> Status {
        let mut references = [0; 64];
        let references = fill(&mut references, span, values.len());
        // SAFETY: both arrays have this length.
        unsafe {
            (self.functions.set_real)(
                self.c,
                references.as_ptr(),
                references.len(),
                values.as_ptr(),
            )
        }
    }

    /// Reads a vector of Reals.
    pub fn get_into(&self, span: Span, out: &mut [f64]) -> Status {
        let mut references = [0; 64];
        let references = fill(&mut references, span, out.len());
        // SAFETY: both arrays have this length.
        unsafe {
            (self.functions.get_real)(
                self.c,
                references.as_ptr(),
                references.len(),
                out.as_mut_ptr(),
            )
        }
    }

    /// Reads a vector of Reals, which must succeed.
    pub fn get(&self, name: &str) -> Vec<f64> {
        let span = self.span(name);
        let mut out = vec![0.0; span.len as usize];
        assert_eq!(
            self.get_into(span, &mut out),
            Status::Ok,
            "{}",
            self.last_message()
        );
        out
    }

    /// Sets an Integer.
    pub fn set_integer(&self, span: Span, value: i32) -> Status {
        // SAFETY: one reference, one value.
        unsafe { (self.functions.set_integer)(self.c, &span.first, 1, &value) }
    }

    /// Reads an Integer.
    pub fn integer(&self, span: Span) -> i32 {
        let mut value = 0;
        // SAFETY: one reference, one value.
        let status = unsafe { (self.functions.get_integer)(self.c, &span.first, 1, &mut value) };
        assert_eq!(status, Status::Ok);
        value
    }

    /// Sets a Boolean.
    pub fn set_boolean(&self, span: Span, value: bool) -> Status {
        // SAFETY: one reference, one value.
        unsafe { (self.functions.set_boolean)(self.c, &span.first, 1, &i32::from(value)) }
    }

    /// Reads a Boolean.
    pub fn boolean(&self, span: Span, element: u32) -> bool {
        let mut value = -1;
        let reference = span.first + element;
        // SAFETY: one reference, one value.
        let status = unsafe { (self.functions.get_boolean)(self.c, &reference, 1, &mut value) };
        assert_eq!(status, Status::Ok);
        value != 0
    }

    /// One communication step.
    pub fn step(&self, from: f64, length: f64) -> Status {
        // SAFETY: the instance lives.
        unsafe { (self.functions.do_step)(self.c, from, length, 1) }
    }

    /// Saves the state.
    pub fn save(&self) -> Pointer {
        let mut state = null_mut();
        // SAFETY: a good place for the state.
        let status = unsafe { (self.functions.get_fmu_state)(self.c, &mut state) };
        assert_eq!(status, Status::Ok);
        state
    }

    /// Restores a state.
    #[allow(
        clippy::not_unsafe_ptr_arg_deref,
        reason = "a state that is not the FMU's own is refused by it, which is what tests try"
    )]
    pub fn restore(&self, state: Pointer) -> Status {
        // SAFETY: unknown states are refused.
        unsafe { (self.functions.set_fmu_state)(self.c, state) }
    }

    /// The bytes of the present state.
    pub fn bytes(&self) -> Vec<u8> {
        let mut state = self.save();
        let mut size = 0;
        // SAFETY: the buffer has the size that is asked for.
        unsafe {
            let status = (self.functions.serialized_fmu_state_size)(self.c, state, &mut size);
            assert_eq!(status, Status::Ok);
            let mut bytes = vec![0_u8; size];
            let status = (self.functions.serialize_fmu_state)(
                self.c,
                state,
                bytes.as_mut_ptr().cast(),
                size,
            );
            assert_eq!(status, Status::Ok);
            assert_eq!(
                (self.functions.free_fmu_state)(self.c, &mut state),
                Status::Ok
            );
            bytes
        }
    }

    /// A saved state from bytes; null if they are refused.
    pub fn read_bytes(&self, bytes: &[u8]) -> Pointer {
        let mut state = null_mut();
        // SAFETY: pointer and size belong together.
        unsafe {
            (self.functions.deserialize_fmu_state)(
                self.c,
                bytes.as_ptr().cast(),
                bytes.len(),
                &mut state,
            );
        }
        state
    }

    /// The changes of `unknown` when `known` changes by `changes`.
    pub fn derivative(
        &self,
        unknown: Span,
        known: Span,
        changes: &[f64],
        out: &mut [f64],
    ) -> Status {
        let (mut unknowns, mut knowns) = ([0; 64], [0; 64]);
        let unknowns = fill(&mut unknowns, unknown, out.len());
        let knowns = fill(&mut knowns, known, changes.len());
        // SAFETY: the arrays have these lengths.
        unsafe {
            (self.functions.get_directional_derivative)(
                self.c,
                unknowns.as_ptr(),
                unknowns.len(),
                knowns.as_ptr(),
                knowns.len(),
                changes.as_ptr(),
                out.as_mut_ptr(),
            )
        }
    }

    /// fmi2Reset.
    pub fn reset(&self) -> Status {
        // SAFETY: the instance lives.
        unsafe { (self.functions.reset)(self.c) }
    }

    /// The log's last message.
    pub fn last_message(&self) -> String {
        let messages = self.messages.lock().unwrap();
        messages
            .last()
            .map(|(_, _, text)| text.clone())
            .unwrap_or_default()
    }
}

/// The value references of the first `count` elements of a vector.
fn fill(references: &mut [u32; 64], span: Span, count: usize) -> &[u32] {
    let first = &mut references[..count.min(span.len as usize)];
    for (reference, value) in first.iter_mut().zip(span.first..) {
        *reference = value;
    }
    first
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the instance lives, and never again.
        unsafe { (self.functions.free_instance)(self.c) };
    }
}
