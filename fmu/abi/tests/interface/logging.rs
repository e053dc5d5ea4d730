//! What the importer is told, and when it is left in peace.
//!
//! promise: error-messages

use crate::host::*;
use fmu_abi::types::*;
use std::ptr::{null, null_mut};

#[test]
fn platform_and_version() {
    let text = |text: Text| unsafe { std::ffi::CStr::from_ptr(text) };
    assert_eq!(text(unsafe { fmi2GetVersion() }), c"2.0");
    assert_eq!(text(unsafe { fmi2GetTypesPlatform() }), c"default");
}

#[test]
fn categories_are_switched_one_by_one() {
    let it = Instance::started(&Resources::new(0.1), 0.0);
    let heard = |call: &dyn Fn() -> Status| {
        it.messages.lock().unwrap().clear();
        call();
        let messages = it.messages.lock().unwrap();
        messages
            .iter()
            .map(|(_, category, _)| category.clone())
            .collect::<Vec<_>>()
    };
    let switch =
        |on, names: &[Text]| unsafe { fmi2SetDebugLogging(it.c, on, names.len(), names.as_ptr()) };
    let error = || it.step(99.0, 1.0);
    let discard = || unsafe { fmi2GetStatus(it.c, 0, &mut 0) };
    let event = || unsafe { fmi2Reset(it.c) };
    assert_eq!(heard(&event), ["logEvents"]);
    assert_eq!(switch(0, &[c"logEvents".as_ptr()]), Status::Ok);
    assert_eq!(heard(&event), Vec::<String>::new());
    assert_eq!(switch(1, &[c"logAll".as_ptr()]), Status::Ok);
    assert_eq!(heard(&event), ["logEvents"]);
    // What was refused is heard, whatever is switched.
    for names in [
        &[][..],
        &[c"logStatusError".as_ptr(), c"logStatusDiscard".as_ptr()],
    ] {
        assert_eq!(switch(0, names), Status::Ok);
        assert_eq!(heard(&error), ["logStatusError"]);
        it.start(0.0);
        assert_eq!(heard(&discard), ["logStatusDiscard"]);
        assert_eq!(heard(&event), Vec::<String>::new());
    }
}

#[test]
fn refusals_and_warnings_are_heard_with_logging_off() {
    let resources = Resources::new(0.1);
    let it = Instance::made(&resources, callbacks, 0);
    it.set_mode(0);
    it.start(0.0);
    assert_eq!(it.step(0.0, -1.0), Status::Error);
    let messages = it.messages.lock().unwrap();
    let categories: Vec<_> = messages
        .iter()
        .map(|(_, category, _)| category.as_str())
        .collect();
    assert_eq!(categories, ["logStatusWarning", "logStatusError"]);
    assert!(messages[1].2.contains("communicationStepSize is -1"));
}

/// What a logger that calls the FMU needs: the instance, and what it saw.
#[derive(Default)]
struct Caller {
    instance: Pointer,
    heard: Vec<String>,
    frees: bool,
}

unsafe extern "C" fn call_back(to: Pointer, _: Text, _: Status, _: Text, message: Text) {
    let caller = unsafe { &mut *to.cast::<Caller>() };
    let text = unsafe { std::ffi::CStr::from_ptr(message) };
    caller.heard.push(text.to_string_lossy().into_owned());
    if caller.instance.is_null() || caller.heard.len() > 3 {
        return;
    }
    let (mut value, mut state) = (0.0, null_mut());
    unsafe {
        assert_eq!(
            fmi2GetReal(caller.instance, &LATE[0], 1, &mut value),
            Status::Ok
        );
        assert_eq!(fmi2GetFMUstate(caller.instance, &mut state), Status::Ok);
        assert_eq!(fmi2FreeFMUstate(caller.instance, &mut state), Status::Ok);
        // Refused, so the logger is called within itself.
        assert_eq!(
            fmi2SetReal(caller.instance, &LATE[0], 1, &value),
            Status::Error
        );
        if caller.frees {
            fmi2FreeInstance(caller.instance);
            caller.instance = null_mut();
        }
    }
}

#[test]
fn a_logger_may_call_the_fmu_and_even_free_it() {
    type Fixed = unsafe extern "C" fn(Pointer, Text, Status, Text, Text);
    let resources = Resources::new(0.1);
    for frees in [false, true] {
        let mut caller = Caller::default();
        let functions = CallbackFunctions {
            logger: Some(unsafe { std::mem::transmute::<Fixed, LoggerCallback>(call_back) }),
            component_environment: (&raw mut caller).cast(),
            ..callbacks(&Messages::default())
        };
        let it = Instance::made(&resources, |_| functions, 0);
        it.start(0.0);
        let c = it.c;
        (caller.instance, caller.frees) = (c, frees);
        assert_eq!(unsafe { fmi2DoStep(c, 0.0, -1.0, 1) }, Status::Error);
        assert!(caller.heard.len() >= 2, "{:?}", caller.heard);
        assert!(caller.heard[0].contains("communicationStepSize is -1"));
        assert!(caller.heard[1].contains("late[1] is an output"));
        if frees {
            std::mem::forget(it);
        }
    }
}

#[test]
fn an_unknown_category_is_refused_and_nothing_is_switched() {
    let it = Instance::new(&Resources::new(0.1));
    let names = [c"logEvents".as_ptr(), c"logNonsense 100%".as_ptr()];
    let status = unsafe { fmi2SetDebugLogging(it.c, 0, 2, names.as_ptr()) };
    assert_eq!(status, Status::Error);
    let message = it.last_message();
    assert!(
        message.contains("logNonsense") && !message.contains('%'),
        "{message}"
    );
    let names = [c"logEvents".as_ptr(), null()];
    assert_eq!(
        unsafe { fmi2SetDebugLogging(it.c, 0, 2, names.as_ptr()) },
        Status::Error
    );
    assert_eq!(unsafe { fmi2Reset(it.c) }, Status::Ok);
    assert!(
        it.last_message().contains("instantiated"),
        "events are still heard"
    );
}

#[test]
fn every_refusal_names_its_function() {
    let it = Instance::started(&Resources::new(0.1), 0.0);
    it.messages.lock().unwrap().clear();
    unsafe {
        fmi2CancelStep(it.c);
        fmi2SetTime(it.c, 0.0);
        fmi2GetReal(it.c, &99, 1, &mut 0.0);
        fmi2SetFMUstate(it.c, null_mut());
        fmi2GetStringStatus(it.c, 1, null_mut());
    }
    let messages = it.messages.lock().unwrap();
    let functions: Vec<_> = messages
        .iter()
        .map(|(_, _, text)| text.split(':').next().unwrap().to_string())
        .collect();
    let expected = "fmi2CancelStep fmi2SetTime fmi2GetReal fmi2SetFMUstate fmi2GetStringStatus";
    assert_eq!(functions.join(" "), expected);
}

#[test]
fn an_instance_without_logger_is_as_good() {
    let resources = Resources::new(0.1);
    let silent = CallbackFunctions {
        logger: None,
        ..callbacks(&Messages::default())
    };
    let silent = CallbackFunctions {
        component_environment: null_mut(),
        ..silent
    };
    let (name, guid, uri) = (c"dir/sub dir", resources.guid.as_ptr(), resources.uri());
    let c = unsafe {
        fmi2Instantiate(
            name.as_ptr(),
            CO_SIMULATION,
            guid,
            uri.as_ptr(),
            &silent,
            1,
            1,
        )
    };
    assert!(!c.is_null());
    let it = Instance {
        c,
        messages: Box::default(),
    };
    it.start(0.0);
    assert_eq!(it.step(0.0, -1.0), Status::Error);
    assert_eq!(it.step(0.0, 0.1), Status::Ok);
    assert_eq!(it.ticks(), 1);
}
