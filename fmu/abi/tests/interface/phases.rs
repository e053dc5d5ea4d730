//! Instances brought into each state that can be reached.

use crate::host::staircase::{FAIL, PANIC};
use crate::host::*;
use fmu_abi::life_cycle::State;
use fmu_abi::types::*;
use std::ptr::null_mut;

/// The states in which an instance can be; steps are synchronous.
pub const REACHABLE: [State; 7] = [
    State::Instantiated,
    State::InitializationMode,
    State::StepComplete,
    State::StepFailed,
    State::Terminated,
    State::Error,
    State::Fatal,
];

/// An instance in this state, with a state saved when it was fresh.
pub fn in_state(resources: &Resources, state: State) -> (Instance, Pointer) {
    let instance = Instance::new(resources);
    let saved = instance.save();
    let fail_with = |reference| {
        instance.start(0.0);
        assert_eq!(instance.set(REFERENCE, reference), Status::Ok);
        instance.step(0.0, 0.1)
    };
    match state {
        State::Instantiated => {}
        State::InitializationMode => unsafe {
            assert_eq!(
                fmi2SetupExperiment(instance.c, 0, 0.0, 0.0, 0, 0.0),
                Status::Ok
            );
            assert_eq!(fmi2EnterInitializationMode(instance.c), Status::Ok);
        },
        State::StepComplete => instance.start(0.0),
        State::StepFailed => {
            instance.start(0.0);
            assert_eq!(instance.step(0.0, 1e9), Status::Discard);
        }
        State::Terminated => {
            instance.start(0.0);
            assert_eq!(unsafe { fmi2Terminate(instance.c) }, Status::Ok);
        }
        State::Error => assert_eq!(fail_with(FAIL), Status::Error),
        State::Fatal => assert_eq!(fail_with(PANIC), Status::Fatal),
        _ => unreachable!("steps are synchronous"),
    }
    (instance, saved)
}

impl Instance {
    /// The bytes of a saved state.
    pub fn serialize(&self, state: Pointer) -> Vec<Byte> {
        let mut size = 0;
        let status = unsafe { fmi2SerializedFMUstateSize(self.c, state, &mut size) };
        assert_eq!(status, Status::Ok);
        let mut bytes = vec![0; size];
        let status = unsafe { fmi2SerializeFMUstate(self.c, state, bytes.as_mut_ptr(), size) };
        assert_eq!(status, Status::Ok);
        bytes
    }

    /// A new saved state from bytes, or null.
    pub fn deserialize(&self, bytes: &[Byte]) -> (Status, Pointer) {
        let mut state = null_mut();
        let (from, size) = (bytes.as_ptr(), bytes.len());
        let status = unsafe { fmi2DeSerializeFMUstate(self.c, from, size, &mut state) };
        (status, state)
    }
}

/// The bytes of the state of a fresh instance.
pub fn fresh_bytes(resources: &Resources) -> Vec<Byte> {
    let instance = Instance::new(resources);
    instance.serialize(instance.save())
}
