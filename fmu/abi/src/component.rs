//! One instance of an FMU: what each C function does, in safe Rust.
//!
//! The C functions in [`crate::exported`] check pointers and the life cycle, call a method
//! here, and turn a [`Failure`] into a status and a message. No method here unwinds on bad
//! input, and none allocates on success between fmi2ExitInitializationMode and fmi2Terminate.

use crate::clock::{Clock, Event, MOST_TICKS, TimeError};
use crate::life_cycle::{Function, State, States};
use crate::logger::{Logger, UnknownCategory};
use crate::memory::{self, Reserve};
use crate::snapshot::{Snapshot, StateError};
use crate::types::{Status, ValueReference};
use crate::{Readiness, Refusal, Slave, Values};
use model_description::{Causality, Kind, Variability, Variable};

/// Why a call did not succeed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What the importer gets.
    pub status: Status,
    /// What its log gets.
    pub message: String,
}

impl Failure {
    /// A refused call.
    pub fn error(message: impl Into<String>) -> Self {
        Self {
            status: Status::Error,
            message: message.into(),
        }
    }

    /// Information that cannot be given.
    pub fn discard(message: impl Into<String>) -> Self {
        Self {
            status: Status::Discard,
            message: message.into(),
        }
    }

    /// No memory for what was asked.
    pub fn out_of_memory() -> Self {
        Self::error(OUT_OF_MEMORY)
    }
}

/// What the log gets when memory is short.
pub const OUT_OF_MEMORY: &str = "the system has no memory left; nothing was changed";

impl From<String> for Failure {
    fn from(message: String) -> Self {
        Self::error(message)
    }
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        Self::error(refusal.0)
    }
}

impl From<TimeError> for Failure {
    fn from(error: TimeError) -> Self {
        Self::error(error.to_string())
    }
}

impl From<StateError> for Failure {
    fn from(error: StateError) -> Self {
        Self::error(error.to_string())
    }
}

impl From<UnknownCategory> for Failure {
    fn from(error: UnknownCategory) -> Self {
        Self::error(error.to_string())
    }
}

/// What a call comes to.
pub type Outcome = Result<(), Failure>;

/// The three types that have values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// fmi2Real.
    Real,
    /// fmi2Integer.
    Integer,
    /// fmi2Boolean.
    Boolean,
}

/// What may be done with a variable: the table's row, made small for the hot path.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Access {
    base: Base,
    causality: Causality,
    settable: States,
    /// The range that a parameter must keep to.
    range: Option<(f64, f64)>,
}

impl Access {
    fn of(variable: &Variable) -> Self {
        let (base, min, max) = match variable.kind {
            Kind::Real { min, max, .. } => (Base::Real, min, max),
            Kind::Integer { min, max } => (Base::Integer, min.map(f64::from), max.map(f64::from)),
            Kind::Boolean => (Base::Boolean, None, None),
        };
        let parameter = variable.causality == Causality::Parameter;
        let bound = parameter && (min.is_some() || max.is_some());
        let range = (
            min.unwrap_or(f64::NEG_INFINITY),
            max.unwrap_or(f64::INFINITY),
        );
        Self {
            base,
            causality: variable.causality,
            // The standard would have inputs set from initialization mode on only; importers
            // set them before it too, and no harm is done.
            settable: match (variable.causality, variable.variability) {
                (Causality::Output, _) => States::NONE,
                (Causality::Parameter, Variability::Fixed) => States::BEFORE_START,
                _ => States::UNTIL_END,
            },
            range: bound.then_some(range),
        }
    }
}

/// What the usual call asks of a variable, one bit each: the states in which it may be set to whatever
/// value, its type, whether it is an input, whether it is latched.
#[derive(Clone, Copy, Debug)]
struct Mark(u16);

impl Mark {
    const INPUT: u16 = 1 << 12;
    const NOT_LATCHED: u16 = 1 << 13;

    fn of(access: &Access, latched: bool) -> Self {
        let settable = match access.range {
            None => access.settable.bits(),
            Some(_) => 0,
        };
        let input = match access.causality {
            Causality::Input => Self::INPUT,
            _ => 0,
        };
        let other = if latched { 0 } else { Self::NOT_LATCHED };
        Self(settable | Self::typed(access.base) | input | other)
    }

    /// A variable of this type.
    const fn typed(base: Base) -> u16 {
        match base {
            Base::Real => 1 << 9,
            Base::Integer => 1 << 10,
            Base::Boolean => 1 << 11,
        }
    }
}

/// What an instance has told the importer, once each; not part of a saved state.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    late_inputs: bool,
    notice: bool,
}

/// A state saved for the importer; its address is the importer's handle.
type Saved<T> = Box<Snapshot<T>>;

/// One instance.
pub struct Component<S: Slave> {
    /// The way to the importer.
    pub logger: Logger,
    /// Messages to be handed over once nothing of the instance is borrowed.
    pub messages: Vec<(Status, String)>,
    slave: S,
    guid: String,
    access: Box<[Access]>,
    marks: Box<[Mark]>,
    current: Snapshot<S::State>,
    /// The state after fmi2Instantiate.
    fresh: Snapshot<S::State>,
    /// Bytes of memory that a snapshot takes at most.
    footprint: usize,
    told: Told,
    saved: Vec<Saved<S::State>>,
    /// Scratch of directional derivatives.
    trial: S::State,
    seed: Values,
    response: Values,
}

impl<S: Slave> Component<S> {
    /// A fresh instance of a loaded model.
    ///
    /// # Errors
    /// A sample time that is not positive.
    pub fn new(slave: S, guid: &str, logger: Logger) -> Result<Self, Refusal> {
        let period = slave.sample_time();
        if !(period.is_finite() && period > 0.0) {
            return Err(Refusal(format!(
                "the sample time is {period}: it must be positive"
            )));
        }
        let start = Values::start(slave.variables());
        let (footprint, fresh) = memory::size_of_made(|| Snapshot::fresh(&slave));
        let variables = slave.variables().iter();
        let access: Box<[Access]> = variables.map(|(_, it)| Access::of(it)).collect();
        Ok(Self {
            logger,
            messages: Vec::new(),
            guid: guid.to_string(),
            marks: (0..)
                .zip(&access)
                .map(|(reference, access)| Mark::of(access, slave.is_latched(reference)))
                .collect(),
            access,
            current: fresh.clone(),
            footprint: footprint + size_of::<Snapshot<S::State>>(),
            trial: fresh.state.clone(),
            fresh,
            told: Told::default(),
            saved: Vec::new(),
            seed: start.clone(),
            response: start,
            slave,
        })
    }

    /// The state in the life cycle.
    pub fn phase(&self) -> State {
        self.current.phase
    }

    /// After a panic: only free is left.
    pub fn make_fatal(&mut self) {
        self.current.phase = State::Fatal;
    }

    /// The greatest count of values that makes sense in one call.
    pub fn most_values(&self) -> usize {
        self.access.len().max(1024)
    }

    /// fmi2SetupExperiment.
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Outcome {
        self.current.clock.set_up(start, stop)?;
        self.current.set_up = true;
        Ok(())
    }

    /// fmi2EnterInitializationMode.
    pub fn enter_initialization(&mut self) -> Outcome {
        if !self.current.set_up {
            return Err(Failure::error("call fmi2SetupExperiment first"));
        }
        (self.current.stale, self.current.provisional) = (true, false);
        self.enter(State::InitializationMode);
        Ok(())
    }

    /// fmi2ExitInitializationMode. Inputs that cannot be worked with yet are a warning in the
    /// log: masters initialise the FMUs one after the other, and have until the first step.
    pub fn exit_initialization(&mut self) -> Outcome {
        self.refresh()?;
        let why = match self.slave.check_inputs(&self.current.values) {
            Ok(Readiness::Complete) => None,
            Ok(Readiness::ModeUntold(mode)) => Some(format!(
                "{} is 0, not told yet; outputs rest at the operating point of mode 1 until it is",
                self.name(mode)
            )),
            Err(Refusal(why)) => Some(format!(
                "{why}; the outputs are provisional until the first step"
            )),
        };
        if let Some(why) = why {
            self.current.provisional = true;
            self.warn(Function::ExitInitializationMode, &why);
        }
        self.enter(State::StepComplete);
        Ok(())
    }

    /// fmi2Terminate.
    pub fn terminate(&mut self) -> Outcome {
        self.enter(State::Terminated);
        Ok(())
    }

    /// fmi2Reset: equals a fresh instance; saved states remain valid.
    pub fn reset(&mut self) -> Outcome {
        self.current.clone_from(&self.fresh);
        self.told = Told::default();
        self.enter(State::Instantiated);
        Ok(())
    }

    /// Reads values of one type into `out`, converted by `convert`; nothing from a bad call.
    pub fn read<T>(
        &mut self,
        base: Base,
        references: &[ValueReference],
        out: &mut [T],
        convert: impl Fn(f64) -> Option<T>,
    ) -> Outcome {
        self.refresh()?;
        if self.marks_of(references).0 & Mark::typed(base) == 0 {
            self.check_types(references, base)?;
        }
        for (&reference, slot) in references.iter().zip(out) {
            if let Some(value) = self.current.values.at(reference) {
                *slot = convert(value).ok_or_else(|| self.not_of(base, reference, value))?;
            }
        }
        Ok(())
    }

    /// Whether each of these variables exists and is of this type.
    #[cold]
    #[inline(never)]
    fn check_types(&self, references: &[ValueReference], base: Base) -> Outcome {
        for &reference in references {
            self.access(reference, base)?;
        }
        Ok(())
    }

    /// The marks that all of these variables have, none where one does not exist, and those that one has.
    #[inline]
    fn marks_of(&self, references: &[ValueReference]) -> (u16, u16) {
        let mark = |&reference| self.marks.get(reference as usize).map_or(0, |mark| mark.0);
        let marks = references.iter().map(mark);
        marks.fold((u16::MAX, 0), |(all, any), it| (all & it, any | it))
    }

    /// Sets values of one type; nothing is set from a call with one bad entry.
    pub fn write<T: Copy>(
        &mut self,
        base: Base,
        references: &[ValueReference],
        values: &[T],
        convert: impl Fn(T) -> f64,
    ) -> Outcome {
        let phase = self.phase();
        let free = Mark::typed(base) | phase as u16;
        let (all, any) = self.marks_of(references);
        if all & free != free {
            self.check_each(base, references, values, &convert)?;
        }
        for (&reference, &value) in references.iter().zip(values) {
            if let Some(slot) = self.current.values.slot(reference) {
                *slot = convert(value);
            }
        }
        self.current.handed_over |= any & Mark::INPUT != 0;
        if any & Mark::NOT_LATCHED != 0 {
            self.current.values.unsettle();
        }
        self.current.stale = phase == State::InitializationMode;
        Ok(())
    }

    /// Whether each of these values may be set.
    #[cold]
    #[inline(never)]
    fn check_each<T: Copy>(
        &self,
        base: Base,
        references: &[ValueReference],
        values: &[T],
        convert: impl Fn(T) -> f64,
    ) -> Outcome {
        for (&reference, &value) in references.iter().zip(values) {
            let access = self.access(reference, base)?;
            if !access.settable.contain(self.phase()) {
                return Err(self.not_settable(reference, access));
            }
            let value = convert(value);
            if let Some((min, max)) = access.range
                && !(value.is_finite() && (min..=max).contains(&value))
            {
                let advice = match max.is_finite() {
                    true => format!("from {min} to {max}"),
                    false => format!("from {min} on"),
                };
                let name = self.name(reference);
                return Err(Failure::error(format!(
                    "{name} is {value}: give a finite number {advice}"
                )));
            }
        }
        Ok(())
    }

    /// fmi2DoStep: runs the ticks of the step.
    ///
    /// A step that is refused, by the clock or for its inputs, changes nothing. One of too many
    /// ticks is done in part and then discarded.
    pub fn step(&mut self, from: f64, length: f64) -> Outcome {
        let before = self.current.clock;
        self.current.clock.advance(from, length)?;
        let waits = match self.prepare() {
            Ok(waits) => waits,
            Err(failure) => {
                self.current.clock = before;
                self.current.clock.refuse(from, length);
                return Err(failure);
            }
        };
        let late = self.run_ticks(waits, &before)?;
        if let Some(k) = late {
            self.tell_late_inputs(&before, k, length);
        }
        if !self.told.notice
            && let Some(text) = self.slave.notice(&self.current.state)
        {
            self.told.notice = true;
            self.warn(Function::DoStep, text);
        }
        let (now, te) = (self.current.clock.now(), before.sample_time());
        if from + length - now <= 0.5 * te {
            return Ok(());
        }
        self.current.phase = State::StepFailed;
        Err(too_long(length, te, now))
    }

    /// Warns, once, of inputs from before the tick that they were for.
    #[cold]
    fn tell_late_inputs(&mut self, before: &Clock, k: u64, length: f64) {
        if !std::mem::replace(&mut self.told.late_inputs, true) {
            let text = late_inputs(before, k, length);
            self.warn(Function::DoStep, &text);
        }
    }

    /// Checks the inputs that the coming ticks read; says whether the mode is still untold.
    fn prepare(&mut self) -> Result<bool, Failure> {
        let current = &mut self.current;
        if !current.clock.begins_tick() {
            if current.clock.ends_tick() && !current.provisional {
                self.slave.check_late_inputs(&current.values)?;
            }
            return Ok(current.provisional);
        }
        match self.slave.check_inputs(&current.values)? {
            Readiness::Complete => Ok(false),
            Readiness::ModeUntold(_) if current.provisional => Ok(true),
            Readiness::ModeUntold(mode) => Err(self.untold(mode)),
        }
    }

    #[cold]
    fn untold(&self, mode: ValueReference) -> Failure {
        Failure::error(format!(
            "{} is 0, which means not told yet, after a mode had been told: the modes are the \
             whole numbers from 1 on",
            self.name(mode)
        ))
    }

    /// Runs the ticks up to the clock's time; while the slave `waits` for its mode they pass and
    /// nothing is computed. Returns the first tick that began within the step.
    fn run_ticks(&mut self, waits: bool, before: &Clock) -> Result<Option<u64>, Failure> {
        let current = &mut self.current;
        let mut late = None;
        while let Some(event) = current.clock.next_event() {
            let fresh = match event {
                Event::Begin(k) => {
                    late = late.or_else(|| before.begins_within(k).then_some(k));
                    std::mem::take(&mut current.handed_over)
                }
                Event::End(_) => false,
            };
            if waits {
                continue;
            }
            let (state, values) = (&mut current.state, &mut current.values);
            let ran = match event {
                // A tick that passed while the mode was untold has nothing to publish.
                Event::End(_) if current.provisional => Ok(()),
                Event::End(k) => self.slave.end_tick(state, values, k),
                Event::Begin(k) => {
                    let begun = std::mem::take(&mut current.provisional);
                    let ready = if begun {
                        self.slave.initialize(state, values)
                    } else {
                        Ok(())
                    };
                    ready.and_then(|()| self.slave.begin_tick(state, values, k, fresh))
                }
            };
            if let Err(refusal) = ran {
                current.phase = State::Error;
                return Err(refusal.into());
            }
        }
        Ok(late)
    }

    /// The end of the last step that succeeded.
    pub fn last_successful_time(&self) -> f64 {
        self.current.clock.now()
    }

    /// fmi2GetRealOutputDerivatives: outputs are held between ticks, so all derivatives are 0.
    pub fn output_derivatives(
        &self,
        references: &[ValueReference],
        orders: &[i32],
        out: &mut [f64],
    ) -> Outcome {
        for (&reference, &order) in references.iter().zip(orders) {
            let access = self.access(reference, Base::Real)?;
            let name = self.name(reference);
            if access.causality != Causality::Output {
                return Err(Failure::error(format!("{name} is no output")));
            }
            if order < 1 {
                return Err(Failure::error(format!(
                    "the order of a derivative of {name} is {order}: orders start at 1"
                )));
            }
        }
        out.fill(0.0);
        Ok(())
    }

    /// fmi2GetDirectionalDerivative.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        changes: &[f64],
        out: &mut [f64],
    ) -> Outcome {
        if !S::PROVIDES_DIRECTIONAL_DERIVATIVE {
            return Err(Failure::error(
                "this model provides no directional derivatives",
            ));
        }
        self.refresh()?;
        for &reference in unknowns {
            self.expect(reference, Causality::Output)?;
        }
        for &reference in knowns {
            self.expect(reference, Causality::Input)?;
        }
        self.seed.fill(0.0);
        self.response.fill(0.0);
        for (&reference, &change) in knowns.iter().zip(changes) {
            if let Some(slot) = self.seed.slot(reference) {
                *slot += change;
            }
        }
        let Snapshot { state, values, .. } = &self.current;
        if self.current.phase != State::InitializationMode
            && let Readiness::ModeUntold(_) = self.slave.check_inputs(values)?
        {
            // At rest until the mode is told: nothing moves the outputs.
            out.fill(0.0);
            return Ok(());
        }
        self.trial.clone_from(state);
        if self.current.provisional {
            self.response.clone_from(values);
            self.slave.initialize(&mut self.trial, &mut self.response)?;
            self.response.fill(0.0);
        }
        self.slave.directional_derivative(
            &mut self.trial,
            values,
            self.current.upcoming(),
            &self.seed,
            &mut self.response,
        )?;
        for (&reference, slot) in unknowns.iter().zip(out) {
            *slot = self.response.at(reference).unwrap_or_default();
        }
        Ok(())
    }

    /// fmi2GetFMUstate: saves into the state behind `handle`, or into a new one if it is 0.
    pub fn save(&mut self, handle: usize) -> Result<usize, Failure> {
        if handle == 0 {
            return self.keep(|it| Ok(it.current.clone()), 0);
        }
        let at = self.position(handle)?;
        self.saved[at].as_mut().clone_from(&self.current);
        Ok(handle)
    }

    /// fmi2SetFMUstate.
    pub fn restore(&mut self, handle: usize) -> Outcome {
        let at = self.position(handle)?;
        self.current.clone_from(&self.saved[at]);
        Ok(())
    }

    /// fmi2FreeFMUstate; nothing to do for 0.
    pub fn forget(&mut self, handle: usize) -> Outcome {
        if handle != 0 {
            self.saved.swap_remove(self.position(handle)?);
        }
        Ok(())
    }

    /// The size of what [`Component::serialize`] writes, in bytes.
    pub fn serialized_size(&self, handle: usize) -> Result<usize, Failure> {
        let at = self.position(handle)?;
        Ok(self.saved[at].size_in_bytes(&self.guid)?)
    }

    /// fmi2SerializeFMUstate: fills `out`, which must have the right size.
    pub fn serialize(&self, handle: usize, out: &mut [u8]) -> Outcome {
        let at = self.position(handle)?;
        Ok(self.saved[at].write_bytes(&self.guid, out)?)
    }

    /// fmi2DeSerializeFMUstate: the handle of a new saved state.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<usize, Failure> {
        // A state has fewer bytes than it takes memory; others would be read for nothing.
        if bytes.len() > 2 * self.footprint + self.guid.len() + 1024 {
            return Err(Failure::error(
                "the bytes are too many for a state of this FMU",
            ));
        }
        let read = |it: &Self| Snapshot::from_bytes(bytes, &it.guid, &it.slave).map_err(Into::into);
        self.keep(read, bytes.len() * READING)
    }

    /// Computes the outputs of initialization mode if values were set since.
    fn refresh(&mut self) -> Outcome {
        let current = &mut self.current;
        if current.phase != State::InitializationMode || !current.stale {
            return Ok(());
        }
        self.slave
            .initialize(&mut current.state, &mut current.values)?;
        current.stale = false;
        Ok(())
    }

    /// Goes to another state, and says so.
    fn enter(&mut self, phase: State) {
        self.current.phase = phase;
        if self.logger.hears(Status::Ok) {
            let time = self.current.clock.now();
            let message = format!("{} at time {time}", phase.name());
            self.messages.push((Status::Ok, message));
        }
    }

    /// Leaves a warning for the importer.
    fn warn(&mut self, function: Function, text: &str) {
        let message = format!("{}: {text}", function.name());
        self.messages.push((Status::Warning, message));
    }

    /// The access to a variable that must exist and be of this type.
    fn access(&self, reference: ValueReference, base: Base) -> Result<Access, Failure> {
        match self.access.get(reference as usize) {
            Some(access) if access.base == base => Ok(*access),
            Some(access) => Err(Failure::error(format!(
                "{} is of type {:?}, not {base:?}",
                self.name(reference),
                access.base
            ))),
            None => Err(Failure::error(format!(
                "there is no variable with value reference {reference}"
            ))),
        }
    }

    /// A Real of this causality.
    fn expect(&self, reference: ValueReference, causality: Causality) -> Outcome {
        if self.access(reference, Base::Real)?.causality == causality {
            return Ok(());
        }
        Err(Failure::error(format!(
            "{} is no {}: derivatives are of outputs by inputs",
            self.name(reference),
            causality.word()
        )))
    }

    #[cold]
    #[inline(never)]
    fn not_settable(&self, reference: ValueReference, access: Access) -> Failure {
        let name = self.name(reference);
        Failure::error(match access.causality {
            Causality::Output => format!("{name} is an output and cannot be set"),
            _ => format!("{name} is fixed and cannot be set after initialization"),
        })
    }

    fn name(&self, reference: ValueReference) -> &str {
        let variable = self.slave.variables().get(reference);
        variable.map_or("an unknown variable", |variable| &variable.name)
    }

    /// Refuses a value that is none of the type asked for.
    #[cold]
    #[inline(never)]
    fn not_of(&self, base: Base, reference: ValueReference, value: f64) -> Failure {
        let name = self.name(reference);
        Failure::error(format!("{name} is {value}, which is no {base:?}"))
    }

    /// Where the saved state of this handle lies.
    fn position(&self, handle: usize) -> Result<usize, Failure> {
        let known = |saved: &Saved<S::State>| address(saved) == handle;
        self.saved.iter().position(known).ok_or_else(|| {
            Failure::error("the FMU state is none that this instance has saved and not freed")
        })
    }

    /// Keeps a new snapshot, the making of which may take `more` bytes than the snapshot; not
    /// if memory is short.
    fn keep(
        &mut self,
        make: impl FnOnce(&Self) -> Result<Snapshot<S::State>, Failure>,
        more: usize,
    ) -> Result<usize, Failure> {
        let mark = memory::mark();
        let Some(_reserve) = Reserve::take(2 * self.footprint + more) else {
            return Err(Failure::out_of_memory());
        };
        let kept = make(self).map(Box::new);
        let room = self.saved.try_reserve(1);
        if memory::short_of_memory(mark) || room.is_err() {
            // The list may have grown into the reserve.
            self.saved.shrink_to_fit();
            return Err(Failure::out_of_memory());
        }
        let kept = kept?;
        let handle = address(&kept);
        self.saved.push(kept);
        Ok(handle)
    }
}

/// Bytes of memory that reading one byte of a saved state may take: an empty vector is one byte.
const READING: usize = 128;

fn address<T>(saved: &Saved<T>) -> usize {
    &raw const **saved as usize
}

/// A number of six digits, for a sentence.
fn shortened(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// A step of more ticks than are run at once.
#[cold]
fn too_long(length: f64, te: f64, now: f64) -> Failure {
    Failure::discard(format!(
        "a step of {length} s runs more than {MOST_TICKS} ticks of {te} s and was done up to \
         {now} s; make steps of at most {} s",
        MOST_TICKS as f64 * te
    ))
}

/// The warning that a tick ran on inputs from before it began.
fn late_inputs(before: &Clock, k: u64, length: f64) -> String {
    let te = before.sample_time();
    let (from, age) = (before.now(), shortened(before.until(k) * te));
    format!(
        "in the step of {length} s from {from} s a tick began {age} s after the inputs were set, \
         and ran on these old inputs: the sample time is {te} s, make steps of just that, or of a \
         whole fraction of it (told once)"
    )
}
