//! Random sequences of calls with random arguments: no crash, and the same calls give the same
//! results on another instance.

use crate::host::*;
use fmu_abi::types::*;
use proptest::prelude::*;
use std::ptr::{null, null_mut};

/// One call of an importer out of its mind.
#[derive(Clone, Debug)]
enum Call {
    SetUp(f64, Option<f64>),
    Enter,
    Exit,
    Terminate,
    Reset,
    Step(Point, f64),
    GetReal(Vec<u32>, Shape),
    SetReal(Vec<u32>, f64, Shape),
    GetInteger(u32),
    SetInteger(u32, i32),
    GetBoolean(u32),
    SetBoolean(u32, i32),
    Save,
    Overwrite(usize),
    Restore(usize),
    Forget(usize),
    Bytes(usize, Option<(usize, u8)>),
    Derivative(u32, u32),
    Log(i32, usize),
    Status(i32),
    ModelExchange(f64),
}

/// A communication point: where time is, or anywhere.
#[derive(Clone, Debug)]
enum Point {
    Here,
    There(f64),
}

/// What is wrong with the pointers and counts of a call.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Good,
    NullReferences,
    NullValues,
    Huge,
}

fn number() -> impl Strategy<Value = f64> {
    // Not the two references at which the slave is made to fail.
    prop_oneof![
        4 => -10.0..10.0f64,
        1 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1e-320, 1e308,
        ]),
    ]
}

fn length() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => prop::sample::select(vec![0.1, 0.35, 0.1 / 7.0, 1e-16, 2.5]),
        1 => number(),
    ]
}

fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![
        8 => Just(Shape::Good),
        1 => Just(Shape::NullReferences),
        1 => Just(Shape::NullValues),
        1 => Just(Shape::Huge),
    ]
}

fn references() -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(prop_oneof![9 => 0..14u32, 1 => any::<u32>()], 0..5)
}

fn call() -> impl Strategy<Value = Call> {
    let point = prop_oneof![9 => Just(Point::Here), 1 => number().prop_map(Point::There)];
    let saved = 0..4usize;
    let damage = prop::option::of((any::<usize>(), 1..=255u8));
    prop_oneof![
        1 => (number(), prop::option::of(number())).prop_map(|(a, b)| Call::SetUp(a, b)),
        2 => Just(Call::SetUp(0.0, None)),
        4 => Just(Call::Enter),
        4 => Just(Call::Exit),
        1 => Just(Call::Terminate),
        1 => Just(Call::Reset),
        12 => (point, length()).prop_map(|(a, b)| Call::Step(a, b)),
        3 => (references(), shape()).prop_map(|(a, b)| Call::GetReal(a, b)),
        6 => (references(), number(), shape()).prop_map(|(a, b, c)| Call::SetReal(a, b, c)),
        1 => (0..14u32).prop_map(Call::GetInteger),
        1 => (0..14u32, -1..5i32).prop_map(|(a, b)| Call::SetInteger(a, b)),
        1 => (0..14u32).prop_map(Call::GetBoolean),
        1 => (0..14u32, any::<i32>()).prop_map(|(a, b)| Call::SetBoolean(a, b)),
        2 => Just(Call::Save),
        1 => saved.clone().prop_map(Call::Overwrite),
        2 => saved.clone().prop_map(Call::Restore),
        1 => saved.clone().prop_map(Call::Forget),
        2 => (saved, damage).prop_map(|(a, b)| Call::Bytes(a, b)),
        1 => (0..14u32, 0..14u32).prop_map(|(a, b)| Call::Derivative(a, b)),
        1 => (any::<i32>(), 0..3usize).prop_map(|(a, b)| Call::Log(a, b)),
        1 => any::<i32>().prop_map(Call::Status),
        1 => number().prop_map(Call::ModelExchange),
    ]
}

/// An instance, the importer's time, and the states it has saved.
struct Caller {
    it: Instance,
    time: f64,
    saved: Vec<(Pointer, f64)>,
}

/// What a call gave: its status and the bits of what it returned.
type Answer = (Status, Vec<u64>);

impl Caller {
    fn new(resources: &Resources) -> Self {
        Self {
            it: Instance::new(resources),
            time: 0.0,
            saved: Vec::new(),
        }
    }

    fn play(&mut self, call: &Call) -> Answer {
        let c = self.it.c;
        let mut bits = Vec::new();
        let status = unsafe {
            match call {
                Call::SetUp(start, stop) => {
                    let status = fmi2SetupExperiment(
                        c,
                        0,
                        0.0,
                        *start,
                        stop.is_some().into(),
                        stop.unwrap_or(0.0),
                    );
                    if status == Status::Ok {
                        self.time = *start;
                    }
                    status
                }
                Call::Enter => fmi2EnterInitializationMode(c),
                Call::Exit => fmi2ExitInitializationMode(c),
                Call::Terminate => fmi2Terminate(c),
                Call::Reset => fmi2Reset(c),
                Call::Step(point, length) => {
                    let from = match point {
                        Point::Here => self.time,
                        Point::There(time) => *time,
                    };
                    let status = fmi2DoStep(c, from, *length, 1);
                    if status == Status::Ok {
                        self.time = from + length;
                    }
                    status
                }
                Call::GetReal(references, shape) => {
                    let mut out = vec![0.0; references.len()];
                    let (vr, n, values) = shape.spoil(references, out.as_mut_ptr().cast_const());
                    let status = fmi2GetReal(c, vr, n, values.cast_mut());
                    bits.extend(out.iter().map(|value| value.to_bits()));
                    status
                }
                Call::SetReal(references, value, shape) => {
                    let values = vec![*value; references.len()];
                    let (vr, n, values) = shape.spoil(references, values.as_ptr());
                    fmi2SetReal(c, vr, n, values)
                }
                Call::GetInteger(reference) => {
                    let mut value = 0;
                    let status = fmi2GetInteger(c, reference, 1, &mut value);
                    bits.push(value as u64);
                    status
                }
                Call::SetInteger(reference, value) => fmi2SetInteger(c, reference, 1, value),
                Call::GetBoolean(reference) => {
                    let mut value = 0;
                    let status = fmi2GetBoolean(c, reference, 1, &mut value);
                    bits.push(value as u64);
                    status
                }
                Call::SetBoolean(reference, value) => fmi2SetBoolean(c, reference, 1, value),
                Call::Save => {
                    let mut state = null_mut();
                    let status = fmi2GetFMUstate(c, &mut state);
                    if !state.is_null() {
                        self.saved.push((state, self.time));
                    }
                    status
                }
                Call::Overwrite(which) => match self.saved.get_mut(*which) {
                    Some((state, time)) => {
                        *time = self.time;
                        fmi2GetFMUstate(c, state)
                    }
                    None => fmi2GetFMUstate(c, null_mut()),
                },
                Call::Restore(which) => {
                    let known = self.saved.get(*which);
                    let (state, time) = known.copied().unwrap_or((null_mut(), self.time));
                    let status = fmi2SetFMUstate(c, state);
                    if status == Status::Ok {
                        self.time = time;
                    }
                    status
                }
                Call::Forget(which) if *which < self.saved.len() => {
                    let (mut state, _) = self.saved.remove(*which);
                    fmi2FreeFMUstate(c, &mut state)
                }
                Call::Forget(_) => fmi2FreeFMUstate(c, null_mut()),
                Call::Bytes(which, damage) => self.bytes(*which, *damage),
                Call::Derivative(unknown, known) => {
                    let mut out = 0.0;
                    let status =
                        fmi2GetDirectionalDerivative(c, unknown, 1, known, 1, &1.0, &mut out);
                    bits.push(out.to_bits());
                    status
                }
                Call::Log(on, count) => {
                    let names = [c"logAll".as_ptr(), c"logNonsense".as_ptr()];
                    fmi2SetDebugLogging(c, *on, *count, names.as_ptr())
                }
                Call::Status(kind) => {
                    let (mut real, mut boolean) = (0.0, 0);
                    fmi2GetStringStatus(c, *kind, null_mut());
                    let time = fmi2GetRealStatus(c, *kind, &mut real);
                    bits.push(real.to_bits());
                    time.max(fmi2GetBooleanStatus(c, *kind, &mut boolean))
                }
                Call::ModelExchange(time) => {
                    fmi2GetDerivatives(c, null_mut(), usize::MAX);
                    fmi2SetTime(c, *time)
                }
            }
        };
        (status, bits)
    }

    /// Serialises a saved state, damages the bytes or not, and reads them back.
    fn bytes(&mut self, which: usize, damage: Option<(usize, u8)>) -> Status {
        let Some(&(state, time)) = self.saved.get(which) else {
            return Status::Ok;
        };
        let c = self.it.c;
        let mut size = 0;
        let status = unsafe { fmi2SerializedFMUstateSize(c, state, &mut size) };
        if status != Status::Ok {
            return status;
        }
        let mut bytes = vec![0; size];
        let status = unsafe { fmi2SerializeFMUstate(c, state, bytes.as_mut_ptr(), size) };
        assert_eq!(status, Status::Ok);
        if let Some((at, mask)) = damage {
            bytes[at % size] ^= mask as Byte;
        }
        let mut read = null_mut();
        let status = unsafe { fmi2DeSerializeFMUstate(c, bytes.as_ptr(), size, &mut read) };
        assert_eq!(status == Status::Ok, damage.is_none());
        if !read.is_null() {
            self.saved.push((read, time));
        }
        status
    }
}

impl Shape {
    fn spoil(self, vr: &[u32], values: *const f64) -> (*const u32, usize, *const f64) {
        match self {
            Self::Good => (vr.as_ptr(), vr.len(), values),
            Self::NullReferences => (null(), vr.len(), values),
            Self::NullValues => (vr.as_ptr(), vr.len(), null()),
            Self::Huge => (vr.as_ptr(), usize::MAX - vr.len(), values),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn nothing_crashes_and_instances_agree(calls in prop::collection::vec(call(), 1..120)) {
        let resources = Resources::new(0.1);
        let mut callers = [Caller::new(&resources), Caller::new(&resources)];
        for call in &calls {
            let [one, other] = callers.each_mut().map(|caller| caller.play(call));
            prop_assert_ne!(one.0, Status::Fatal);
            prop_assert_eq!(one, other);
        }
    }
}
