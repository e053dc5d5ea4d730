//! Every function in every state, against the standard's table written down once more.
//!
//! promise: legal-calls

use crate::host::*;
use crate::phases::*;
use fmu_abi::life_cycle::{Function, State};
use fmu_abi::types::*;
use std::ptr::null_mut;

/// FMI 2.0, section 4.2.4, state by state: the columns of the standard's table, read downwards.
/// "get" and "set" stand for the four types, "state" for fmi2SetFMUstate and the four functions
/// on saved states, "status" for the five inquiries.
fn column(state: State) -> &'static [&'static str] {
    match state {
        State::Instantiated => &[
            "SetDebugLogging",
            "FreeInstance",
            "SetupExperiment",
            "EnterInitializationMode",
            "Reset",
            "set",
            "GetFMUstate",
            "state",
            "SetRealInputDerivatives",
        ],
        State::InitializationMode => &[
            "SetDebugLogging",
            "FreeInstance",
            "ExitInitializationMode",
            "Reset",
            "get",
            "set",
            "GetFMUstate",
            "state",
            "GetDirectionalDerivative",
            "SetRealInputDerivatives",
        ],
        State::StepComplete => &[
            "SetDebugLogging",
            "FreeInstance",
            "Terminate",
            "Reset",
            "get",
            "set",
            "GetFMUstate",
            "state",
            "GetDirectionalDerivative",
            "SetRealInputDerivatives",
            "GetRealOutputDerivatives",
            "DoStep",
            "status",
        ],
        State::StepInProgress => &["SetDebugLogging", "CancelStep", "status"],
        State::StepFailed => &[
            "SetDebugLogging",
            "FreeInstance",
            "Terminate",
            "Reset",
            "get",
            "GetFMUstate",
            "state",
            "GetDirectionalDerivative",
            "GetRealOutputDerivatives",
            "status",
        ],
        State::StepCanceled => &[
            "SetDebugLogging",
            "FreeInstance",
            "Reset",
            "get",
            "GetFMUstate",
            "state",
            "GetDirectionalDerivative",
            "GetRealOutputDerivatives",
        ],
        State::Terminated => &[
            "SetDebugLogging",
            "FreeInstance",
            "Reset",
            "get",
            "GetFMUstate",
            "state",
            "GetDirectionalDerivative",
            "GetRealOutputDerivatives",
            "status",
        ],
        State::Error => &[
            "SetDebugLogging",
            "FreeInstance",
            "Reset",
            "get",
            "GetFMUstate",
            "state",
            "GetDirectionalDerivative",
            "GetRealOutputDerivatives",
        ],
        // The standard allows nothing; freeing is ours.
        State::Fatal => &["FreeInstance"],
    }
}

/// The name under which a function stands in [`column`].
fn group(name: &str) -> &str {
    match name {
        "GetReal" | "GetInteger" | "GetBoolean" | "GetString" => "get",
        "SetReal" | "SetInteger" | "SetBoolean" | "SetString" => "set",
        "SetFMUstate"
        | "FreeFMUstate"
        | "SerializedFMUstateSize"
        | "SerializeFMUstate"
        | "DeSerializeFMUstate" => "state",
        "GetStatus" | "GetRealStatus" | "GetIntegerStatus" | "GetBooleanStatus"
        | "GetStringStatus" => "status",
        other => other,
    }
}

const STATES: [State; 9] = [
    State::Instantiated,
    State::InitializationMode,
    State::StepComplete,
    State::StepInProgress,
    State::StepFailed,
    State::StepCanceled,
    State::Terminated,
    State::Error,
    State::Fatal,
];

#[test]
fn the_table_is_the_standards() {
    assert_eq!(
        Function::ALL.len(),
        41,
        "all but two inquiries and fmi2Instantiate"
    );
    for function in Function::ALL {
        let name = function.name().strip_prefix("fmi2").unwrap();
        for state in STATES {
            let expected = column(state).contains(&group(name));
            let allowed = function.allowed().contain(state);
            assert_eq!(allowed, expected, "{name} in {}", state.name());
        }
    }
}

type Call = fn(&Instance, Pointer) -> Status;

/// Each function with arguments that are right where the function is allowed; the pointer is a
/// state saved before.
#[rustfmt::skip]
const CALLS: &[(&str, Call)] = &[
    ("SetDebugLogging", |it, _| unsafe { fmi2SetDebugLogging(it.c, 1, 0, null_mut()) }),
    ("SetupExperiment", |it, _| unsafe { fmi2SetupExperiment(it.c, 0, 0.0, 0.0, 0, 0.0) }),
    ("EnterInitializationMode", |it, _| unsafe {
        // Needs fmi2SetupExperiment, which is refused elsewhere.
        fmi2SetupExperiment(it.c, 1, 1e-6, 0.0, 1, 10.0);
        fmi2EnterInitializationMode(it.c)
    }),
    ("ExitInitializationMode", |it, _| unsafe { fmi2ExitInitializationMode(it.c) }),
    ("Terminate", |it, _| unsafe { fmi2Terminate(it.c) }),
    ("Reset", |it, _| unsafe { fmi2Reset(it.c) }),
    ("GetReal", |it, _| unsafe { fmi2GetReal(it.c, &LATE[0], 1, &mut 0.0) }),
    ("GetInteger", |it, _| unsafe { fmi2GetInteger(it.c, &TICKS, 1, &mut 0) }),
    ("GetBoolean", |it, _| unsafe { fmi2GetBoolean(it.c, &ODD, 1, &mut 0) }),
    ("GetString", |it, _| unsafe { fmi2GetString(it.c, null_mut(), 0, null_mut()) }),
    ("SetReal", |it, _| unsafe { fmi2SetReal(it.c, &INPUT[0], 1, &1.0) }),
    ("SetInteger", |it, _| unsafe { fmi2SetInteger(it.c, &MODE, 1, &1) }),
    ("SetBoolean", |it, _| unsafe { fmi2SetBoolean(it.c, null_mut(), 0, null_mut()) }),
    ("SetString", |it, _| unsafe { fmi2SetString(it.c, null_mut(), 0, null_mut()) }),
    ("GetFMUstate", |it, _| unsafe { fmi2GetFMUstate(it.c, &mut null_mut()) }),
    ("SetFMUstate", |it, saved| unsafe { fmi2SetFMUstate(it.c, saved) }),
    ("FreeFMUstate", |it, mut saved| unsafe { fmi2FreeFMUstate(it.c, &mut saved) }),
    ("SerializedFMUstateSize", |it, saved| unsafe {
        fmi2SerializedFMUstateSize(it.c, saved, &mut 0)
    }),
    ("SerializeFMUstate", |it, saved| unsafe {
        let mut bytes = fresh_bytes(&Resources::new(0.1));
        fmi2SerializeFMUstate(it.c, saved, bytes.as_mut_ptr(), bytes.len())
    }),
    ("DeSerializeFMUstate", |it, _| unsafe {
        let bytes = fresh_bytes(&Resources::new(0.1));
        fmi2DeSerializeFMUstate(it.c, bytes.as_ptr(), bytes.len(), &mut null_mut())
    }),
    ("GetDirectionalDerivative", |it, _| unsafe {
        fmi2GetDirectionalDerivative(it.c, &LATE[0], 1, &INPUT[0], 1, &1.0, &mut 0.0)
    }),
    ("SetRealInputDerivatives", |it, _| unsafe {
        fmi2SetRealInputDerivatives(it.c, null_mut(), 0, null_mut(), null_mut())
    }),
    ("GetRealOutputDerivatives", |it, _| unsafe {
        fmi2GetRealOutputDerivatives(it.c, &LATE[0], 1, &1, &mut 0.0)
    }),
    ("DoStep", |it, _| it.step(0.0, 0.1)),
    ("CancelStep", |it, _| unsafe { fmi2CancelStep(it.c) }),
    ("GetStatus", |it, _| unsafe { fmi2GetStatus(it.c, 0, &mut 0) }),
    ("GetRealStatus", |it, _| unsafe { fmi2GetRealStatus(it.c, LAST_SUCCESSFUL_TIME, &mut 0.0) }),
    ("GetIntegerStatus", |it, _| unsafe { fmi2GetIntegerStatus(it.c, 0, &mut 0) }),
    ("GetBooleanStatus", |it, _| unsafe { fmi2GetBooleanStatus(it.c, TERMINATED, &mut 0) }),
    ("GetStringStatus", |it, _| unsafe { fmi2GetStringStatus(it.c, 1, &mut null_mut::<i8>().cast_const()) }),
    ("EnterEventMode", |it, _| unsafe { fmi2EnterEventMode(it.c) }),
    ("NewDiscreteStates", |it, _| unsafe { fmi2NewDiscreteStates(it.c, null_mut()) }),
    ("EnterContinuousTimeMode", |it, _| unsafe { fmi2EnterContinuousTimeMode(it.c) }),
    ("CompletedIntegratorStep", |it, _| unsafe {
        fmi2CompletedIntegratorStep(it.c, 1, &mut 0, &mut 0)
    }),
    ("SetTime", |it, _| unsafe { fmi2SetTime(it.c, 0.0) }),
    ("SetContinuousStates", |it, _| unsafe { fmi2SetContinuousStates(it.c, null_mut(), 0) }),
    ("GetDerivatives", |it, _| unsafe { fmi2GetDerivatives(it.c, null_mut(), 0) }),
    ("GetEventIndicators", |it, _| unsafe { fmi2GetEventIndicators(it.c, null_mut(), 0) }),
    ("GetContinuousStates", |it, _| unsafe { fmi2GetContinuousStates(it.c, null_mut(), 0) }),
    ("GetNominalsOfContinuousStates", |it, _| unsafe {
        fmi2GetNominalsOfContinuousStates(it.c, null_mut(), 0)
    }),
];

/// What an allowed call returns: only the inquiries for steps in the background cannot tell.
fn success(name: &str) -> Status {
    match name {
        "GetStatus" | "GetIntegerStatus" | "GetStringStatus" => Status::Discard,
        _ => Status::Ok,
    }
}

#[test]
fn every_function_in_every_state() {
    assert_eq!(
        CALLS.len() + 1,
        Function::ALL.len(),
        "all but fmi2FreeInstance"
    );
    let resources = Resources::new(0.1);
    for state in REACHABLE {
        for (name, call) in CALLS {
            let (instance, saved) = in_state(&resources, state);
            let logged = instance.messages.lock().unwrap().len();
            let status = call(&instance, saved);
            let place = format!("{name} in {}", state.name());
            if column(state).contains(&group(name)) {
                assert_eq!(
                    status,
                    success(name),
                    "{place}: {}",
                    instance.last_message()
                );
            } else {
                assert_eq!(status, Status::Error, "{place}");
                assert!(instance.messages.lock().unwrap().len() > logged, "{place}");
                let message = instance.last_message();
                let reasons = ["not allowed in state", "not for model exchange"];
                let named = message.starts_with(&format!("fmi2{name}: "));
                let told = reasons.iter().any(|reason| message.contains(reason));
                assert!(named && told, "{place}: {message}");
            }
        }
    }
}

#[test]
fn a_refused_call_does_no_harm() {
    let resources = Resources::new(0.1);
    let (instance, saved) = in_state(&resources, State::StepComplete);
    let untouched = Instance::started(&resources, 0.0);
    for (name, call) in CALLS {
        if !column(State::StepComplete).contains(&group(name)) {
            assert_eq!(call(&instance, saved), Status::Error, "{name}");
        }
    }
    for it in [&instance, &untouched] {
        assert_eq!(it.set(INPUT[0], 2.0), Status::Ok);
        assert_eq!(it.step(0.0, 0.1), Status::Ok);
    }
    assert_eq!(instance.bits(), untouched.bits());
}

#[test]
fn freeing_is_possible_in_any_state() {
    let resources = Resources::new(0.1);
    for state in REACHABLE {
        drop(in_state(&resources, state));
    }
    unsafe { fmi2FreeInstance(null_mut()) };
}

#[test]
fn initialization_needs_an_experiment() {
    let resources = Resources::new(0.1);
    let instance = Instance::new(&resources);
    assert_eq!(
        unsafe { fmi2EnterInitializationMode(instance.c) },
        Status::Error
    );
    assert!(instance.last_message().contains("fmi2SetupExperiment"));
    instance.start(0.0);
}

#[test]
fn a_null_instance_is_an_error() {
    let nobody = std::mem::ManuallyDrop::new(Instance {
        c: null_mut(),
        messages: Box::default(),
    });
    for (name, call) in CALLS {
        assert_eq!(call(&nobody, null_mut()), Status::Error, "{name}");
    }
}

#[test]
fn after_a_panic_only_free_is_left() {
    let resources = Resources::new(0.1);
    let (instance, _) = in_state(&resources, State::Fatal);
    let messages = instance.messages.lock().unwrap();
    let (status, category, text) = messages.last().unwrap();
    assert_eq!(
        (*status, category.as_str()),
        (Status::Fatal, "logStatusFatal")
    );
    assert!(
        text.starts_with("fmi2DoStep: ") && text.contains("asked to panic"),
        "{text}"
    );
    assert!(!text.contains('%'), "{text}");
}

#[test]
fn after_an_error_amid_a_step_reset_and_restore_lead_on() {
    let resources = Resources::new(0.1);
    let fresh = Instance::started(&resources, 0.0);
    let (instance, saved) = in_state(&resources, State::Error);
    assert!(instance.last_message().contains("asked to fail"));
    assert_eq!(unsafe { fmi2SetFMUstate(instance.c, saved) }, Status::Ok);
    unsafe { fmi2Reset(instance.c) };
    instance.start(0.0);
    assert_eq!(instance.bits(), fresh.bits());
}
