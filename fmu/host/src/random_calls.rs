//! An importer out of its mind: any call, with any arguments, in any order.

use crate::{Functions, Instance};
use arbitrary::Arbitrary;
use fmu_abi::types::*;
use std::ptr::{null, null_mut};

/// One call with arguments that need make no sense.
#[derive(Arbitrary, Clone, Debug)]
#[allow(
    missing_docs,
    reason = "the names are the standard's, the arguments too"
)]
pub enum Call {
    SetUp(f64, Option<f64>),
    Begin,
    Enter,
    Exit,
    Terminate,
    Reset,
    Step(Option<f64>, Length),
    GetReal(Array, bool),
    SetReal(Array, Vec<f64>, bool),
    GetInteger(u8),
    SetInteger(u8, i32),
    GetBoolean(u8),
    SetBoolean(u8, i32),
    Strings(usize),
    Save(Option<u8>),
    Restore(Result<u8, usize>),
    Forget(Result<u8, usize>),
    Bytes(u8, Option<(usize, u8)>, usize),
    Foreign(Vec<u8>),
    Derivative(Array, Array, Vec<f64>),
    InputDerivatives(Array),
    OutputDerivatives(Array, Vec<i32>),
    Inquire(i32),
    Cancel,
    Log(i32, u8),
}

/// A communication step.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub enum Length {
    /// One second.
    Whole,
    /// So many 256ths of it.
    Part(u8),
    /// So many times one and a half seconds.
    Many(u8),
    /// Any number, but none that would take minutes.
    Any(f64),
}

/// Value references and how they are handed over.
#[derive(Arbitrary, Clone, Debug)]
pub enum Array {
    /// References near those that exist.
    Good(Vec<u8>),
    /// Any references.
    Wild(Vec<u32>),
    /// A null pointer with a count.
    Null(usize),
    /// A count that is beyond reason.
    Huge(usize),
}

impl Array {
    /// The references behind the pointer.
    fn references(&self) -> Vec<u32> {
        match self {
            Self::Good(some) => some.iter().map(|&r| u32::from(r % 32)).collect(),
            Self::Wild(some) => some.clone(),
            Self::Null(_) | Self::Huge(_) => vec![0; 4],
        }
    }

    /// Pointer and count: a huge count must be refused before anything is read.
    fn hand_over(&self, references: &[u32]) -> (*const u32, usize) {
        match self {
            Self::Good(_) | Self::Wild(_) => (references.as_ptr(), references.len()),
            Self::Null(count) => (null(), *count),
            Self::Huge(count) => (references.as_ptr(), (*count).max(1 << 20)),
        }
    }
}

/// As many values as there may be references.
fn values(given: &[f64], count: usize) -> Vec<f64> {
    let mut values = given.to_vec();
    values.resize(count.max(4), 0.25);
    values
}

/// Makes a used instance as good as a fresh one, whatever state it is in.
pub fn fresh(it: &Instance) {
    it.messages.lock().unwrap().clear();
    assert_eq!(it.reset(), Status::Ok, "{}", it.last_message());
}

/// Plays the calls on an instance, and frees the states that are left.
pub fn play(it: &Instance, calls: &[Call]) {
    let mut caller = Caller {
        c: it.c,
        f: *it.functions(),
        time: 0.0,
        saved: Vec::new(),
    };
    for call in calls {
        assert_ne!(caller.play(call), Status::Fatal, "{}", it.last_message());
    }
    while let Some(last) = caller.saved.len().checked_sub(1) {
        assert_eq!(caller.forget_at(last), Status::Ok, "{}", it.last_message());
    }
}

struct Caller {
    c: Pointer,
    f: Functions,
    time: f64,
    saved: Vec<(Pointer, f64)>,
}

impl Caller {
    fn play(&mut self, call: &Call) -> Status {
        let (c, f) = (self.c, self.f);
        // SAFETY: every pointer is null, good for its count, or comes with a count that is absurd.
        unsafe {
            match call {
                Call::SetUp(start, stop) => {
                    let (defined, stop) = (stop.is_some(), stop.unwrap_or(0.0));
                    let status = (f.setup_experiment)(c, 0, 0.0, *start, defined.into(), stop);
                    if status == Status::Ok {
                        self.time = *start;
                    }
                    status
                }
                Call::Begin => {
                    self.time = 0.0;
                    (f.setup_experiment)(c, 0, 0.0, 0.0, 0, 0.0);
                    (f.enter_initialization_mode)(c);
                    (f.exit_initialization_mode)(c)
                }
                Call::Enter => (f.enter_initialization_mode)(c),
                Call::Exit => (f.exit_initialization_mode)(c),
                Call::Terminate => (f.terminate)(c),
                Call::Reset => (f.reset)(c),
                Call::Step(point, length) => self.step(*point, *length),
                Call::GetReal(array, good) => {
                    let references = array.references();
                    let mut out = values(&[], references.len());
                    let (vr, count) = array.hand_over(&references);
                    (f.get_real)(
                        c,
                        vr,
                        count,
                        if *good { out.as_mut_ptr() } else { null_mut() },
                    )
                }
                Call::SetReal(array, given, good) => {
                    let references = array.references();
                    let given = values(given, references.len());
                    let (vr, count) = array.hand_over(&references);
                    (f.set_real)(c, vr, count, if *good { given.as_ptr() } else { null() })
                }
                Call::GetInteger(r) => (f.get_integer)(c, &u32::from(*r), 1, &mut 0),
                Call::SetInteger(r, value) => (f.set_integer)(c, &u32::from(*r), 1, value),
                Call::GetBoolean(r) => (f.get_boolean)(c, &u32::from(*r), 1, &mut 0),
                Call::SetBoolean(r, value) => (f.set_boolean)(c, &u32::from(*r), 1, value),
                Call::Strings(count) => {
                    (f.get_string)(c, null(), *count, null_mut());
                    (f.set_string)(c, null(), *count, null())
                }
                Call::Save(which) => self.save(*which),
                Call::Restore(which) => {
                    let (state, time) = self.state(*which);
                    let status = (f.set_fmu_state)(c, state);
                    if status == Status::Ok {
                        self.time = time;
                    }
                    status
                }
                Call::Forget(which) => self.forget(*which),
                Call::Bytes(which, damage, size) => self.bytes(*which, *damage, *size),
                Call::Foreign(bytes) => {
                    let (bytes, size) = (bytes.as_ptr().cast(), bytes.len());
                    (f.deserialize_fmu_state)(c, bytes, size, &mut null_mut())
                }
                Call::Derivative(unknowns, knowns, changes) => {
                    let (to, by) = (unknowns.references(), knowns.references());
                    let changes = values(changes, by.len());
                    let mut out = values(&[], to.len());
                    let (u, nu) = unknowns.hand_over(&to);
                    let (k, nk) = knowns.hand_over(&by);
                    let (changes, out) = (changes.as_ptr(), out.as_mut_ptr());
                    (f.get_directional_derivative)(c, u, nu, k, nk, changes, out)
                }
                Call::InputDerivatives(array) => {
                    let references = array.references();
                    let (vr, count) = array.hand_over(&references);
                    (f.set_real_input_derivatives)(c, vr, count, null(), null())
                }
                Call::OutputDerivatives(array, orders) => {
                    let references = array.references();
                    let mut orders = orders.clone();
                    orders.resize(references.len().max(4), 1);
                    let mut out = values(&[], references.len());
                    let (vr, count) = array.hand_over(&references);
                    (f.get_real_output_derivatives)(c, vr, count, orders.as_ptr(), out.as_mut_ptr())
                }
                Call::Inquire(kind) => {
                    (f.get_status)(c, *kind, &mut 0);
                    (f.get_integer_status)(c, *kind, &mut 0);
                    (f.get_boolean_status)(c, *kind, &mut 0);
                    (f.get_string_status)(c, *kind, null_mut());
                    (f.get_real_status)(c, *kind, null_mut())
                }
                Call::Cancel => (f.cancel_step)(c),
                Call::Log(on, count) => {
                    let names = [c"logAll".as_ptr(), c"".as_ptr(), null()];
                    (f.set_debug_logging)(c, *on, usize::from(count % 4), names.as_ptr())
                }
            }
        }
    }

    fn step(&mut self, point: Option<f64>, length: Length) -> Status {
        let from = point.unwrap_or(self.time);
        let length = match length {
            Length::Whole => 1.0,
            Length::Part(of) => f64::from(of) / 256.0,
            Length::Many(times) => f64::from(times) * 1.5,
            // The longest step that is done at all takes a good while.
            Length::Any(any) if any > 1e3 => 1e3,
            Length::Any(any) => any,
        };
        // SAFETY: the instance lives.
        let status = unsafe { (self.f.do_step)(self.c, from, length, 1) };
        if status == Status::Ok {
            self.time = from + length;
        }
        status
    }

    fn state(&self, which: Result<u8, usize>) -> (Pointer, f64) {
        let wild = |address: usize| (address as Pointer, self.time);
        match which {
            Ok(at) => self.saved.get(usize::from(at)).copied().unwrap_or(wild(0)),
            Err(address) => wild(address),
        }
    }

    fn save(&mut self, which: Option<u8>) -> Status {
        let known = which.and_then(|at| self.saved.get(usize::from(at)));
        let mut state = known.map_or(null_mut(), |(state, _)| *state);
        // SAFETY: a good place for the state.
        let status = unsafe { (self.f.get_fmu_state)(self.c, &mut state) };
        match self.saved.iter_mut().find(|(known, _)| *known == state) {
            Some((_, time)) if status == Status::Ok => *time = self.time,
            None if !state.is_null() => self.saved.push((state, self.time)),
            _ => {}
        }
        status
    }

    fn forget(&mut self, which: Result<u8, usize>) -> Status {
        let (mut state, _) = self.state(which);
        let known = state;
        // SAFETY: a good place for the state; unknown ones are refused.
        let status = unsafe { (self.f.free_fmu_state)(self.c, &mut state) };
        if status == Status::Ok {
            self.saved.retain(|(saved, _)| *saved != known);
        }
        status
    }

    fn forget_at(&mut self, at: usize) -> Status {
        let (mut state, _) = self.saved.remove(at);
        // SAFETY: a good place for the state.
        unsafe { (self.f.free_fmu_state)(self.c, &mut state) }
    }

    fn bytes(&mut self, which: u8, damage: Option<(usize, u8)>, wrong: usize) -> Status {
        let (state, time) = self.state(Ok(which));
        let (mut size, mut read) = (0, null_mut());
        // SAFETY: the buffer has the size that is asked for, or the size is wrong and refused.
        unsafe {
            let status = (self.f.serialized_fmu_state_size)(self.c, state, &mut size);
            if status != Status::Ok {
                return status;
            }
            let mut bytes = vec![0; size];
            if wrong != size {
                (self.f.serialize_fmu_state)(self.c, state, bytes.as_mut_ptr(), wrong);
            }
            (self.f.serialize_fmu_state)(self.c, state, bytes.as_mut_ptr(), size);
            if let Some((at, mask)) = damage {
                bytes[at % size] ^= mask as Byte;
            }
            let status = (self.f.deserialize_fmu_state)(self.c, bytes.as_ptr(), size, &mut read);
            if !read.is_null() {
                self.saved.push((read, time));
            }
            status
        }
    }
}
