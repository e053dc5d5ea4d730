//! One instance of an FMU: what each C function does, in safe Rust.
//!
//! The C functions in [`crate::exported`] check pointers and the life cycle, call a method
//! here, and turn a [`Failure`] into a status and a message. No method here unwinds on bad
//! input, and none allocates on success between fmi2ExitInitializationMode and fmi2Terminate.

use crate::clock::Event;
use crate::life_cycle::{Function, State, States};
use crate::logger::Logger;
use crate::snapshot::Snapshot;
use crate::types::{Status, ValueReference};
use crate::{Refusal, Slave, Values};
use model_description::{Causality, Kind, Variability, Variable};
use std::collections::BTreeMap;

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
}

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
#[derive(Clone, Copy, Debug)]
struct Access {
    base: Base,
    causality: Causality,
    settable: States,
}

impl Access {
    fn of(variable: &Variable) -> Self {
        Self {
            base: match variable.kind {
                Kind::Real { .. } => Base::Real,
                Kind::Integer { .. } => Base::Integer,
                Kind::Boolean => Base::Boolean,
            },
            causality: variable.causality,
            // The standard would have inputs set from initialization mode on only; importers
            // set them before it too, and no harm is done.
            settable: match (variable.causality, variable.variability) {
                (Causality::Output, _) => States::NONE,
                (Causality::Parameter, Variability::Fixed) => States::BEFORE_START,
                _ => States::UNTIL_END,
            },
        }
    }
}

/// One instance.
pub struct Component<S: Slave> {
    /// Messages to the importer.
    pub logger: Logger,
    slave: S,
    guid: String,
    access: Box<[Access]>,
    current: Snapshot<S::State>,
    /// States saved for the importer, by their address, which is its handle.
    saved: BTreeMap<usize, Box<Snapshot<S::State>>>,
    /// Scratch of directional derivatives.
    trial: S::State,
    seed: Values,
    response: Values,
}

impl<S: Slave> Component<S> {
    /// A fresh instance of a loaded model.
    pub fn new(slave: S, guid: &str, logger: Logger) -> Result<Self, String> {
        let period = slave.sample_time();
        if !(period.is_finite() && period > 0.0) {
            return Err(format!("the sample time is {period}: it must be positive"));
        }
        let start = Values::start(slave.variables());
        Ok(Self {
            logger,
            guid: guid.to_string(),
            access: slave
                .variables()
                .iter()
                .map(|(_, v)| Access::of(v))
                .collect(),
            current: Snapshot::fresh(&slave),
            saved: BTreeMap::new(),
            trial: slave.initial_state(),
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
    pub fn give_up(&mut self) {
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
        if let Err(Refusal(why)) = self.slave.check_inputs(&self.current.values) {
            self.current.provisional = true;
            let name = Function::ExitInitializationMode.name();
            let text = format!("{name}: {why}; the outputs are provisional until the first step");
            self.logger.log(Status::Warning, &text);
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
        self.current = Snapshot::fresh(&self.slave);
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
        for &reference in references {
            self.access(reference, base)?;
        }
        for (&reference, slot) in references.iter().zip(out) {
            let value = self.current.values.at(reference).unwrap_or_default();
            *slot = convert(value).ok_or_else(|| {
                Failure::error(format!(
                    "{} is {value}, which is no {base:?}",
                    self.name(reference)
                ))
            })?;
        }
        Ok(())
    }

    /// Sets values of one type; nothing is set from a call with one bad entry.
    pub fn write<T: Copy>(
        &mut self,
        base: Base,
        references: &[ValueReference],
        values: &[T],
        convert: impl Fn(T) -> f64,
    ) -> Outcome {
        for &reference in references {
            let access = self.access(reference, base)?;
            if !access.settable.contain(self.phase()) {
                return Err(self.not_settable(reference, access));
            }
        }
        for (&reference, &value) in references.iter().zip(values) {
            if let Some(slot) = self.current.values.slot(reference) {
                *slot = convert(value);
            }
        }
        self.current.stale = self.phase() == State::InitializationMode;
        Ok(())
    }

    /// fmi2DoStep: runs the ticks of the step.
    ///
    /// A step that is refused, by the clock or for its inputs, changes nothing.
    pub fn step(&mut self, from: f64, length: f64) -> Outcome {
        let current = &mut self.current;
        let next = current.clock.advanced(from, length)?;
        if next.begins_tick() {
            if let Err(refusal) = self.slave.check_inputs(&current.values) {
                current.clock.refuse(from, length);
                return Err(refusal.into());
            }
            if std::mem::take(&mut current.provisional) {
                let (state, values) = (&mut current.state, &mut current.values);
                self.slave.initialize(state, values)?;
            }
        }
        current.clock = next;
        while let Some(event) = current.clock.next_event() {
            let (state, values) = (&mut current.state, &mut current.values);
            let ran = match event {
                Event::Begin(k) => self.slave.begin_tick(state, values, k),
                Event::End(k) => self.slave.end_tick(state, values, k),
            };
            if let Err(refusal) = ran {
                current.phase = State::Error;
                return Err(refusal.into());
            }
        }
        Ok(())
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
        if self.current.phase != State::InitializationMode {
            self.slave.check_inputs(values)?;
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
            return Ok(self.keep(self.current.clone()));
        }
        let saved = self.saved.get_mut(&handle).ok_or_else(unknown_state)?;
        saved.as_mut().clone_from(&self.current);
        Ok(handle)
    }

    /// fmi2SetFMUstate.
    pub fn restore(&mut self, handle: usize) -> Outcome {
        let saved = self.saved.get(&handle).ok_or_else(unknown_state)?;
        self.current.clone_from(saved);
        Ok(())
    }

    /// fmi2FreeFMUstate; nothing to do for 0.
    pub fn forget(&mut self, handle: usize) -> Outcome {
        if handle == 0 || self.saved.remove(&handle).is_some() {
            Ok(())
        } else {
            Err(unknown_state())
        }
    }

    /// fmi2SerializeFMUstate, and the size of its bytes.
    pub fn serialize(&self, handle: usize) -> Result<Vec<u8>, Failure> {
        Ok(self.saved(handle)?.to_bytes(&self.guid)?)
    }

    /// fmi2DeSerializeFMUstate: the handle of a new saved state.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<usize, Failure> {
        let snapshot = Snapshot::from_bytes(bytes, &self.guid, &self.slave)?;
        Ok(self.keep(snapshot))
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
            self.logger.log(Status::Ok, &message);
        }
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
            format!("{causality:?}").to_lowercase()
        )))
    }

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

    fn saved(&self, handle: usize) -> Result<&Snapshot<S::State>, Failure> {
        let saved = self.saved.get(&handle).ok_or_else(unknown_state)?;
        Ok(saved)
    }

    fn keep(&mut self, snapshot: Snapshot<S::State>) -> usize {
        let snapshot = Box::new(snapshot);
        let handle = &raw const *snapshot as usize;
        self.saved.insert(handle, snapshot);
        handle
    }
}

fn unknown_state() -> Failure {
    Failure::error("the FMU state is none that this instance has saved and not freed")
}
