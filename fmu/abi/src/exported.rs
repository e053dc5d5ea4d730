//! The bodies of the C functions, generic over the slave.
//!
//! Each one does the same four things: it refuses a null instance, looks up the life-cycle
//! table, turns pointers and counts into slices, and calls a method of
//! [`Component`]. All of it happens behind `catch_unwind`: nothing unwinds into C.
//!
//! # Safety
//!
//! The contract is the standard's. An instance pointer is null or comes from [`instantiate`]
//! and has not been freed; a pointer to values is null or points to as many values as the count
//! says; strings end with a zero; one instance is used by one thread at a time. Null pointers,
//! absurd counts and unknown handles are checked and refused.

use crate::component::{Base, Component, Failure, OUT_OF_MEMORY, Outcome};
use crate::life_cycle::Function;
use crate::logger::Logger;
use crate::memory::{self, Reserve};
use crate::types::*;
use crate::{Refusal, Slave, resource};
use std::any::Any;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice;

/// Runs `body` on the instance if the life cycle allows the function there.
///
/// # Safety
///
/// `c` is null or a live instance.
unsafe fn call<S: Slave>(
    c: Pointer,
    function: Function,
    body: impl FnOnce(&mut Component<S>) -> Outcome,
) -> Status {
    // SAFETY: by contract of the function; the reference ends before the log is handed over.
    let (status, logger, messages) = match unsafe { c.cast::<Component<S>>().as_mut() } {
        None => return Status::Error,
        Some(component) => {
            let status = run(component, function, body);
            if component.messages.is_empty() {
                return status;
            }
            let messages = std::mem::take(&mut component.messages);
            (status, component.logger.clone(), messages)
        }
    };
    // Nothing of the instance is borrowed here: the importer's logger may call the FMU.
    for (status, message) in &messages {
        logger.log(*status, message);
    }
    status
}

/// The same; what the log is to get is left with the instance.
fn run<S: Slave>(
    component: &mut Component<S>,
    function: Function,
    body: impl FnOnce(&mut Component<S>) -> Outcome,
) -> Status {
    let phase = component.phase();
    let ran = if function.allowed().contain(phase) {
        catch_unwind(AssertUnwindSafe(|| body(component)))
    } else {
        Ok(Err(Failure::error(refused(function, phase.name()))))
    };
    match ran {
        Ok(Ok(())) => Status::Ok,
        ran => report(component, function, ran),
    }
}

/// Leaves what went wrong for the log.
#[cold]
#[inline(never)]
fn report<S: Slave>(
    component: &mut Component<S>,
    function: Function,
    ran: std::thread::Result<Outcome>,
) -> Status {
    let (status, message) = match ran {
        Ok(Ok(())) => return Status::Ok,
        Ok(Err(failure)) => (failure.status, failure.message),
        Err(panic) => {
            component.make_fatal();
            let why = panic_text(&*panic);
            (Status::Fatal, format!("a defect of this FMU: {why}"))
        }
    };
    let text = format!("{}: {message}", function.name());
    component.messages.push((status, text));
    status
}

#[cold]
#[inline(never)]
fn refused(function: Function, phase: &str) -> String {
    if function.allowed() == crate::life_cycle::States::NONE {
        "this FMU is for co-simulation, not for model exchange".into()
    } else {
        format!("not allowed in state '{phase}'")
    }
}

fn panic_text(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("unknown")
}

/// The array behind a pointer, which may be null only if the count is 0.
///
/// # Safety
///
/// `pointer` is null or points to `count` values.
unsafe fn array<'a, T>(
    what: &'static str,
    pointer: *const T,
    count: usize,
    most: usize,
) -> Result<&'a [T], Failure> {
    check_array(what, pointer, count, most)?;
    if count == 0 {
        return Ok(&[]);
    }
    // SAFETY: not null, and by contract of the function.
    Ok(unsafe { slice::from_raw_parts(pointer, count) })
}

/// The same, to be written.
///
/// # Safety
///
/// `pointer` is null or points to `count` values that nothing else refers to.
unsafe fn array_mut<'a, T>(
    what: &'static str,
    pointer: *mut T,
    count: usize,
    most: usize,
) -> Result<&'a mut [T], Failure> {
    check_array(what, pointer, count, most)?;
    if count == 0 {
        return Ok(&mut []);
    }
    // SAFETY: not null, and by contract of the function.
    Ok(unsafe { slice::from_raw_parts_mut(pointer, count) })
}

#[inline]
fn check_array<T>(what: &'static str, pointer: *const T, count: usize, most: usize) -> Outcome {
    if count == 0 || (!pointer.is_null() && count <= most) {
        Ok(())
    } else {
        Err(no_array(what, pointer.is_null(), count, most))
    }
}

#[cold]
#[inline(never)]
fn no_array(what: &'static str, is_null: bool, count: usize, most: usize) -> Failure {
    Failure::error(if is_null {
        format!("{what} is a null pointer, but {count} values are asked for")
    } else {
        format!("{what} would have {count} values: at most {most} make sense")
    })
}

/// Writes through a pointer that must not be null.
///
/// # Safety
///
/// `target` is null or may be written.
unsafe fn put<T>(what: &str, target: *mut T, value: T) -> Outcome {
    if target.is_null() {
        return Err(Failure::error(format!("{what} is a null pointer")));
    }
    // SAFETY: not null, and by contract of the function.
    unsafe { target.write(value) };
    Ok(())
}

/// A C string, or `None` for a null pointer.
///
/// # Safety
///
/// `text` is null or ends with a zero.
unsafe fn string<'a>(text: Text) -> Option<&'a CStr> {
    // SAFETY: not null, and by contract of the function.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) })
}

/// `fmi2GetTypesPlatform`.
pub fn get_types_platform() -> Text {
    c"default".as_ptr()
}

/// `fmi2GetVersion`.
pub fn get_version() -> Text {
    c"2.0".as_ptr()
}

/// `fmi2Instantiate`: null if the instance cannot be made; then the reason is logged.
///
/// # Safety
///
/// See the module.
pub unsafe fn instantiate<S: Slave>(
    instance_name: Text,
    kind: Choice,
    guid: Text,
    resources: Text,
    functions: *const CallbackFunctions,
    _visible: Boolean,
    logging_on: Boolean,
) -> Pointer {
    // SAFETY: by contract of the function.
    let Some(functions) = (unsafe { functions.as_ref() }) else {
        return std::ptr::null_mut();
    };
    // SAFETY: by contract of the function.
    let [name, guid, location] = [instance_name, guid, resources].map(|t| unsafe { string(t) });
    let logger = || {
        let environment = functions.component_environment;
        let name = name.unwrap_or(c"unnamed");
        Logger::new(functions.logger, environment, name, logging_on != 0)
    };
    let mark = memory::mark();
    let make = || component::<S>(name, kind, guid, location, logger());
    let made = catch_unwind(AssertUnwindSafe(make)).unwrap_or_else(|panic| {
        Err(Refusal(format!(
            "a defect of this FMU: {}",
            panic_text(&*panic)
        )))
    });
    let made = match made {
        Ok(_) if memory::short_of_memory(mark) => Err(OUT_OF_MEMORY.into()),
        made => made,
    };
    match made {
        Ok((component, _reserve)) => Box::into_raw(component).cast(),
        Err(Refusal(message)) => {
            logger().log(Status::Error, &format!("fmi2Instantiate: {message}"));
            std::ptr::null_mut()
        }
    }
}

/// Bytes of memory that instantiating may take for each byte of the resource: a number takes
/// two at least, and becomes eight in a vector that grows by doubling, in a model and in states.
const LOADING: usize = 64;

/// An instance, and the reserve it was made with, to be kept until it is handed out.
type Made<S> = (Box<Component<S>>, Reserve);

fn component<S: Slave>(
    name: Option<&CStr>,
    kind: Choice,
    guid: Option<&CStr>,
    location: Option<&CStr>,
    logger: Logger,
) -> Result<Made<S>, Refusal> {
    let text = |what: &str, text: Option<&CStr>| {
        let text = text.ok_or_else(|| format!("{what} is a null pointer"))?;
        let text = text.to_str().map_err(|_| format!("{what} is not UTF-8"))?;
        Ok::<_, Refusal>(text.to_string())
    };
    if name.is_none_or(|name| name.to_bytes().trim_ascii().is_empty()) {
        return Err("instanceName is a null pointer or empty: give the instance a name".into());
    }
    if kind != CO_SIMULATION {
        return Err("this FMU is for co-simulation, not for model exchange".into());
    }
    let guid = text("fmuGUID", guid)?;
    let folder = resource::folder(&text("fmuResourceLocation", location)?)?;
    let size = resource::size(&folder.join(S::RESOURCE))? as usize;
    let reserve = Reserve::take(memory::SMALL + LOADING * size).ok_or(OUT_OF_MEMORY)?;
    let component = Component::new(S::load(&folder, &guid)?, &guid, logger)?;
    Ok((Box::new(component), reserve))
}

/// `fmi2FreeInstance`; a null pointer is ignored.
///
/// # Safety
///
/// See the module.
pub unsafe fn free_instance<S: Slave>(c: Pointer) {
    if !c.is_null() {
        // SAFETY: by contract `c` was made by `instantiate` and is freed once. A panicking
        // drop of the slave must not unwind into C; its memory is lost then.
        let drop_it = || drop(unsafe { Box::from_raw(c.cast::<Component<S>>()) });
        let _ = catch_unwind(AssertUnwindSafe(drop_it));
    }
}

/// `fmi2SetDebugLogging`.
///
/// # Safety
///
/// See the module.
pub unsafe fn set_debug_logging<S: Slave>(
    c: Pointer,
    on: Boolean,
    count: usize,
    categories: *const Text,
) -> Status {
    let body = |component: &mut Component<S>| {
        // SAFETY: by contract of the function.
        let texts = unsafe { array("categories", categories, count, 1024) }?;
        let strings = texts.iter().map(|text| {
            // SAFETY: by contract of the function.
            unsafe { string(*text) }.ok_or_else(|| Failure::error("a category is a null pointer"))
        });
        let mark = memory::mark();
        let categories: Vec<&CStr> = strings.collect::<Result<_, _>>()?;
        if memory::short_of_memory(mark) {
            return Err(Failure::out_of_memory());
        }
        Ok(component.logger.switch(on != 0, &categories)?)
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::SetDebugLogging, body) }
}

/// `fmi2SetupExperiment`. The tolerance is of no use to a sampled system.
///
/// # Safety
///
/// See the module.
pub unsafe fn setup_experiment<S: Slave>(
    c: Pointer,
    _tolerance_defined: Boolean,
    _tolerance: Real,
    start: Real,
    stop_defined: Boolean,
    stop: Real,
) -> Status {
    let stop = (stop_defined != 0).then_some(stop);
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::SetupExperiment, |it| it.set_up(start, stop)) }
}

/// `fmi2EnterInitializationMode`.
///
/// # Safety
///
/// See the module.
pub unsafe fn enter_initialization_mode<S: Slave>(c: Pointer) -> Status {
    let function = Function::EnterInitializationMode;
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, function, Component::enter_initialization) }
}

/// `fmi2ExitInitializationMode`.
///
/// # Safety
///
/// See the module.
pub unsafe fn exit_initialization_mode<S: Slave>(c: Pointer) -> Status {
    let function = Function::ExitInitializationMode;
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, function, Component::exit_initialization) }
}

/// `fmi2Terminate`.
///
/// # Safety
///
/// See the module.
pub unsafe fn terminate<S: Slave>(c: Pointer) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::Terminate, Component::terminate) }
}

/// `fmi2Reset`.
///
/// # Safety
///
/// See the module.
pub unsafe fn reset<S: Slave>(c: Pointer) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::Reset, Component::reset) }
}

/// Reads `count` values of one type.
///
/// # Safety
///
/// See the module.
unsafe fn read<S: Slave, T>(
    c: Pointer,
    (function, base): (Function, Base),
    vr: *const ValueReference,
    count: usize,
    out: *mut T,
    convert: impl Fn(f64) -> Option<T>,
) -> Status {
    let body = |component: &mut Component<S>| {
        let most = component.most_values();
        // SAFETY: by contract of the function.
        let references = unsafe { array("vr", vr, count, most) }?;
        // SAFETY: by contract of the function.
        let out = unsafe { array_mut("value", out, count, most) }?;
        component.read(base, references, out, convert)
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, function, body) }
}

/// Sets `count` values of one type.
///
/// # Safety
///
/// See the module.
unsafe fn write<S: Slave, T: Copy>(
    c: Pointer,
    (function, base): (Function, Base),
    vr: *const ValueReference,
    count: usize,
    values: *const T,
    convert: impl Fn(T) -> f64,
) -> Status {
    let body = |component: &mut Component<S>| {
        let most = component.most_values();
        // SAFETY: by contract of the function.
        let references = unsafe { array("vr", vr, count, most) }?;
        // SAFETY: by contract of the function.
        let values = unsafe { array("value", values, count, most) }?;
        component.write(base, references, values, convert)
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, function, body) }
}

/// `fmi2GetReal`.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_real<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    value: *mut Real,
) -> Status {
    let what = (Function::GetReal, Base::Real);
    // SAFETY: by contract of the function.
    unsafe { read::<S, _>(c, what, vr, count, value, Some) }
}

/// `fmi2GetInteger`.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_integer<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    value: *mut Integer,
) -> Status {
    let what = (Function::GetInteger, Base::Integer);
    let exact = |value: f64| {
        let integer = value as Integer;
        (f64::from(integer) == value).then_some(integer)
    };
    // SAFETY: by contract of the function.
    unsafe { read::<S, _>(c, what, vr, count, value, exact) }
}

/// `fmi2GetBoolean`.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_boolean<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    value: *mut Boolean,
) -> Status {
    let what = (Function::GetBoolean, Base::Boolean);
    let flag = |value: f64| Some(Boolean::from(value != 0.0));
    // SAFETY: by contract of the function.
    unsafe { read::<S, _>(c, what, vr, count, value, flag) }
}

/// `fmi2GetString`: there are no String variables, so only a count of 0 succeeds.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_string<S: Slave>(
    c: Pointer,
    _vr: *const ValueReference,
    count: usize,
    _value: *mut Text,
) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::GetString, |_| no_strings(count)) }
}

/// `fmi2SetReal`.
///
/// # Safety
///
/// See the module.
pub unsafe fn set_real<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    value: *const Real,
) -> Status {
    let what = (Function::SetReal, Base::Real);
    // SAFETY: by contract of the function.
    unsafe { write::<S, _>(c, what, vr, count, value, |value| value) }
}

/// `fmi2SetInteger`.
///
/// # Safety
///
/// See the module.
pub unsafe fn set_integer<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    value: *const Integer,
) -> Status {
    let what = (Function::SetInteger, Base::Integer);
    // SAFETY: by contract of the function.
    unsafe { write::<S, _>(c, what, vr, count, value, f64::from) }
}

/// `fmi2SetBoolean`.
///
/// # Safety
///
/// See the module.
pub unsafe fn set_boolean<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    value: *const Boolean,
) -> Status {
    let what = (Function::SetBoolean, Base::Boolean);
    let exact = |value: Boolean| f64::from(u8::from(value != 0));
    // SAFETY: by contract of the function.
    unsafe { write::<S, _>(c, what, vr, count, value, exact) }
}

/// `fmi2SetString`: there are no String variables, so only a count of 0 succeeds.
///
/// # Safety
///
/// See the module.
pub unsafe fn set_string<S: Slave>(
    c: Pointer,
    _vr: *const ValueReference,
    count: usize,
    _value: *const Text,
) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::SetString, |_| no_strings(count)) }
}

fn no_strings(count: usize) -> Outcome {
    if count == 0 {
        Ok(())
    } else {
        Err(Failure::error("this FMU has no String variables"))
    }
}

/// `fmi2GetFMUstate`.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_fmu_state<S: Slave>(c: Pointer, state: *mut Pointer) -> Status {
    let body = |component: &mut Component<S>| {
        // SAFETY: by contract of the function.
        let slot = unsafe { state.as_mut() }.ok_or_else(null_state)?;
        *slot = component.save(*slot as usize)? as Pointer;
        Ok(())
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::GetFMUstate, body) }
}

/// `fmi2SetFMUstate`.
///
/// # Safety
///
/// See the module.
pub unsafe fn set_fmu_state<S: Slave>(c: Pointer, state: Pointer) -> Status {
    let function = Function::SetFMUstate;
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, function, |it| it.restore(state as usize)) }
}

/// `fmi2FreeFMUstate`; null pointers are ignored, and the importer's pointer becomes null.
///
/// # Safety
///
/// See the module.
pub unsafe fn free_fmu_state<S: Slave>(c: Pointer, state: *mut Pointer) -> Status {
    let body = |component: &mut Component<S>| {
        // SAFETY: by contract of the function.
        let Some(slot) = (unsafe { state.as_mut() }) else {
            return Ok(());
        };
        component.forget(*slot as usize)?;
        *slot = std::ptr::null_mut();
        Ok(())
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::FreeFMUstate, body) }
}

/// `fmi2SerializedFMUstateSize`.
///
/// # Safety
///
/// See the module.
pub unsafe fn serialized_fmu_state_size<S: Slave>(
    c: Pointer,
    state: Pointer,
    size: *mut usize,
) -> Status {
    let body = |component: &mut Component<S>| {
        let length = component.serialized_size(state as usize)?;
        // SAFETY: by contract of the function.
        unsafe { put("size", size, length) }
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::SerializedFMUstateSize, body) }
}

/// `fmi2SerializeFMUstate`: `size` must be what `fmi2SerializedFMUstateSize` said.
///
/// # Safety
///
/// See the module.
pub unsafe fn serialize_fmu_state<S: Slave>(
    c: Pointer,
    state: Pointer,
    bytes: *mut Byte,
    size: usize,
) -> Status {
    let body = |component: &mut Component<S>| {
        // The size is checked before anything is written through the pointer.
        let needed = component.serialized_size(state as usize)?;
        if size != needed {
            return Err(Failure::error(format!(
                "size is {size}, but the state has {needed} bytes"
            )));
        }
        // SAFETY: by contract of the function.
        let out = unsafe { array_mut("serializedState", bytes.cast::<u8>(), size, needed) }?;
        component.serialize(state as usize, out)
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::SerializeFMUstate, body) }
}

/// `fmi2DeSerializeFMUstate`: `state` becomes a new saved state.
///
/// # Safety
///
/// See the module.
pub unsafe fn deserialize_fmu_state<S: Slave>(
    c: Pointer,
    bytes: *const Byte,
    size: usize,
    state: *mut Pointer,
) -> Status {
    let body = |component: &mut Component<S>| {
        // No state comes near this size; a greater one would be read from foreign memory.
        const MOST: usize = 1 << 30;
        // SAFETY: by contract of the function.
        let bytes = unsafe { array("serializedState", bytes.cast::<u8>(), size, MOST) }?;
        // SAFETY: by contract of the function.
        let slot = unsafe { state.as_mut() }.ok_or_else(null_state)?;
        *slot = component.deserialize(bytes)? as Pointer;
        Ok(())
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::DeSerializeFMUstate, body) }
}

fn null_state() -> Failure {
    Failure::error("FMUstate is a null pointer")
}

/// `fmi2GetDirectionalDerivative`.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_directional_derivative<S: Slave>(
    c: Pointer,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    changes: *const Real,
    out: *mut Real,
) -> Status {
    let body = |component: &mut Component<S>| {
        let most = component.most_values();
        // SAFETY: by contract of the function.
        let (unknowns, knowns, changes, out) = unsafe {
            (
                array("vUnknown_ref", unknowns, unknown_count, most)?,
                array("vKnown_ref", knowns, known_count, most)?,
                array("dvKnown", changes, known_count, most)?,
                array_mut("dvUnknown", out, unknown_count, most)?,
            )
        };
        component.directional_derivative(unknowns, knowns, changes, out)
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::GetDirectionalDerivative, body) }
}

/// `fmi2SetRealInputDerivatives`: inputs are sampled at the ticks and held, so their
/// derivatives mean nothing here (`canInterpolateInputs` is false).
///
/// # Safety
///
/// See the module.
pub unsafe fn set_real_input_derivatives<S: Slave>(
    c: Pointer,
    _vr: *const ValueReference,
    count: usize,
    _order: *const Integer,
    _value: *const Real,
) -> Status {
    let body = |_: &mut Component<S>| {
        if count == 0 {
            return Ok(());
        }
        Err(Failure::error(
            "inputs are sampled and held, so their derivatives have no use \
             (canInterpolateInputs is false)",
        ))
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::SetRealInputDerivatives, body) }
}

/// `fmi2GetRealOutputDerivatives`: outputs are held between ticks, so all are 0.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_real_output_derivatives<S: Slave>(
    c: Pointer,
    vr: *const ValueReference,
    count: usize,
    order: *const Integer,
    value: *mut Real,
) -> Status {
    let body = |component: &mut Component<S>| {
        let most = component.most_values();
        // SAFETY: by contract of the function.
        let (references, orders, out) = unsafe {
            (
                array("vr", vr, count, most)?,
                array("order", order, count, most)?,
                array_mut("value", value, count, most)?,
            )
        };
        component.output_derivatives(references, orders, out)
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, Function::GetRealOutputDerivatives, body) }
}

/// `fmi2DoStep`.
///
/// # Safety
///
/// See the module.
pub unsafe fn do_step<S: Slave>(
    c: Pointer,
    point: Real,
    step: Real,
    _no_set_state_before_point: Boolean,
) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::DoStep, |it| it.step(point, step)) }
}

/// `fmi2CancelStep`: never allowed, since no step runs in the background.
///
/// # Safety
///
/// See the module.
pub unsafe fn cancel_step<S: Slave>(c: Pointer) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, Function::CancelStep, |_| Ok(())) }
}

/// Answers one of the status inquiries: `given` if the slave can tell it, else fmi2Discard.
///
/// # Safety
///
/// See the module.
unsafe fn status<S: Slave, T>(
    c: Pointer,
    function: Function,
    kind: Choice,
    out: *mut T,
    given: impl FnOnce(&Component<S>) -> Option<T>,
) -> Status {
    let body = |component: &mut Component<S>| {
        let value = given(component).ok_or_else(|| {
            Failure::discard(format!("there is no status of kind {kind} to be told here"))
        })?;
        // SAFETY: by contract of the function.
        unsafe { put("value", out, value) }
    };
    // SAFETY: by contract of the function.
    unsafe { call(c, function, body) }
}

/// `fmi2GetStatus`: only of use to steps in the background, so fmi2Discard.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_status<S: Slave>(c: Pointer, kind: Choice, value: *mut Status) -> Status {
    // SAFETY: by contract of the function.
    unsafe { status::<S, _>(c, Function::GetStatus, kind, value, |_| None) }
}

/// `fmi2GetRealStatus`: the end of the last step that succeeded.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_real_status<S: Slave>(c: Pointer, kind: Choice, value: *mut Real) -> Status {
    let time =
        |it: &Component<S>| (kind == LAST_SUCCESSFUL_TIME).then(|| it.last_successful_time());
    // SAFETY: by contract of the function.
    unsafe { status(c, Function::GetRealStatus, kind, value, time) }
}

/// `fmi2GetIntegerStatus`: the standard knows no such status, so fmi2Discard.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_integer_status<S: Slave>(
    c: Pointer,
    kind: Choice,
    value: *mut Integer,
) -> Status {
    // SAFETY: by contract of the function.
    unsafe { status::<S, _>(c, Function::GetIntegerStatus, kind, value, |_| None) }
}

/// `fmi2GetBooleanStatus`: the slave never wants to end the simulation.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_boolean_status<S: Slave>(
    c: Pointer,
    kind: Choice,
    value: *mut Boolean,
) -> Status {
    let terminated = |_: &Component<S>| (kind == TERMINATED).then_some(0);
    // SAFETY: by contract of the function.
    unsafe { status(c, Function::GetBooleanStatus, kind, value, terminated) }
}

/// `fmi2GetStringStatus`: only of use to steps in the background, so fmi2Discard.
///
/// # Safety
///
/// See the module.
pub unsafe fn get_string_status<S: Slave>(
    c: Pointer,
    kind: Choice,
    value: *mut *const c_char,
) -> Status {
    // SAFETY: by contract of the function.
    unsafe { status::<S, _>(c, Function::GetStringStatus, kind, value, |_| None) }
}

/// Any function of model exchange: refused in every state.
///
/// # Safety
///
/// See the module.
pub unsafe fn model_exchange<S: Slave>(c: Pointer, function: Function) -> Status {
    // SAFETY: by contract of the function.
    unsafe { call::<S>(c, function, |_| Ok(())) }
}
