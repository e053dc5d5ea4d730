//! The boundary between the C interface and what an FMU computes.
//!
//! On this side: when something is computed (the life cycle, the clock), what may be set (the
//! table), how it is saved, refused and reported. On the other side: what is computed at a
//! tick. A slave sees neither C nor time in seconds, and cannot tell one importer from another.
//!
//! A slave is split in two. `Self` is the model, loaded once and never changed; `Self::State`
//! is plain data and holds *everything* that changes at run time. That split is what makes
//! saving, restoring, resetting and serialising a matter of cloning a value.

use crate::Values;
use crate::clock::Event;
use crate::resource::ResourceError;
use model_description::{Span, VariableTable};
use serde::{Serialize, de::DeserializeOwned};
use std::path::Path;

/// Why a slave was not loaded, or did not compute: one sentence for the importer's log, which names
/// the file, or the variable and its value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Refusal(pub String);

impl From<ResourceError> for Refusal {
    fn from(error: ResourceError) -> Self {
        Self(error.to_string())
    }
}

impl From<String> for Refusal {
    fn from(message: String) -> Self {
        Self(message)
    }
}

impl From<&str> for Refusal {
    fn from(message: &str) -> Self {
        Self(message.into())
    }
}

/// Whether inputs that make sense are complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Readiness {
    /// They are.
    Complete,
    /// The mode, whose value reference this is, has not been told: it and its twin are 0.
    ModeUntold(u32),
}

/// A sampled system behind the FMI 2.0 co-simulation interface.
///
/// # On line
///
/// Between [`Slave::initialize`] and the end of the run nothing may allocate: scratch memory
/// belongs into `State`, sized by [`Slave::initial_state`].
pub trait Slave: Sized + 'static {
    /// The file in the `resources` folder that [`Slave::load`] reads.
    const RESOURCE: &'static str;

    /// Everything that changes at run time, including scratch that a later tick reads.
    /// Its `clone_from` must copy in place: states are saved and tried between two ticks.
    type State: Clone + Serialize + DeserializeOwned + 'static;

    /// Loads the model from the FMU's unpacked `resources` folder.
    ///
    /// `guid` is what the importer read in the XML; compare it with
    /// [`crate::resource::read_verified`].
    ///
    /// # Errors
    /// A resource that is not this FMU's, or from which no model can be made.
    fn load(resources: &Path, guid: &str) -> Result<Self, Refusal>;

    /// The variables, whose positions are the value references.
    fn variables(&self) -> &VariableTable;

    /// `Te` in seconds, positive.
    fn sample_time(&self) -> f64;

    /// The state of a fresh instance, the same at every call.
    fn initial_state(&self) -> Self::State;

    /// Whether this variable is an input that counts when a tick begins only, and is checked before every
    /// one: setting it leaves the others [settled](Values::are_settled).
    fn is_latched(&self, _reference: u32) -> bool {
        false
    }

    /// Makes the state and the outputs at the start time from parameters and initial inputs,
    /// whatever `state` held before; allocates nothing.
    ///
    /// Called again whenever values were set in initialization mode, so only the last call
    /// before the first tick counts. An input whose source may not be initialised yet, such as
    /// a mode that still reads 0, is taken as best it can be: while [`Slave::check_inputs`]
    /// refuses it or finds no mode, all this is provisional, no tick of the slave is run, and
    /// it is done once more when the first one begins. A refusal changes nothing.
    fn initialize(&self, state: &mut Self::State, values: &mut Values) -> Result<(), Refusal>;

    /// Tick `k` begins: time goes beyond `k Te`. Inputs are sampled here; they are not `fresh`
    /// if none was set since another tick began, as in a step of many ticks.
    ///
    /// A controller computes and publishes here; a plant latches its inputs and computes, and
    /// publishes in [`Slave::end_tick`]. An error leaves the instance in the error state, from
    /// which reset, a restored state and free lead out; what can be told from the inputs alone
    /// belongs into [`Slave::check_inputs`].
    fn begin_tick(
        &self,
        state: &mut Self::State,
        values: &mut Values,
        k: u64,
        fresh: bool,
    ) -> Result<(), Refusal>;

    /// Tick `k` ends: time has reached `(k + 1) Te`.
    fn end_tick(
        &self,
        _state: &mut Self::State,
        _values: &mut Values,
        _k: u64,
    ) -> Result<(), Refusal> {
        Ok(())
    }

    /// Whether the inputs can be worked with, asked before a step in which a tick begins.
    ///
    /// A refusal is fmi2Error and nothing else happens: outputs keep their last values, no tick
    /// is run, and the importer may repeat the step or go on.
    fn check_inputs(&self, _values: &Values) -> Result<Readiness, Refusal> {
        Ok(Readiness::Complete)
    }

    /// The same for the inputs that [`Slave::end_tick`] reads, asked before a step in which a
    /// tick ends and none begins; else [`Slave::check_inputs`] answers for them, too.
    fn check_late_inputs(&self, _values: &Values) -> Result<(), Refusal> {
        Ok(())
    }

    /// What the importer should know of the run so far, besides its outputs; told once.
    fn notice(&self, _state: &Self::State) -> Option<&'static str> {
        None
    }

    /// Whether [`Slave::directional_derivative`] is available.
    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = false;

    /// The response of the outputs to a change of the inputs.
    ///
    /// `at` is the tick whose [`Slave::begin_tick`] or [`Slave::end_tick`] comes next, or none
    /// in initialization mode. `seed` and `response` have an element for each variable: `seed`
    /// holds the changes of the known variables and zero elsewhere; `response`, zero on entry,
    /// receives the changes of what the outputs will be after that event, or are after
    /// [`Slave::initialize`]. `trial` is a copy of the present state to be tried with; what
    /// is left in it does not matter.
    fn directional_derivative(
        &self,
        _trial: &mut Self::State,
        _values: &Values,
        _at: Option<Event>,
        _seed: &Values,
        _response: &mut Values,
    ) -> Result<(), Refusal> {
        Err("this model provides no directional derivatives".into())
    }

    /// Whether a deserialised state has the sizes of this model.
    ///
    /// Its bytes carry a checksum and this model's fingerprint, so they differ only where somebody altered
    /// them on purpose.
    /// On line, sizes are not looked at again, so every slave compares them here.
    fn fits(&self, state: &Self::State) -> bool;
}

/// The active mode, counted from 0, from its Integer variable and its Real twin.
///
/// Either may be 0, which means that it is not connected, or not told yet; where both are,
/// there is no mode, unless there is but one. Errors name the variables and their values.
pub fn selected_mode(
    table: &VariableTable,
    values: &Values,
    [integer, real]: [Span; 2],
    modes: usize,
) -> Result<Option<usize>, Refusal> {
    let numbers = [integer, real].map(|span| values.scalar(span));
    let (span, number) = match numbers {
        [0.0, 0.0] => return Ok((modes == 1).then_some(0)),
        [number, 0.0] => (integer, number),
        [0.0, number] => (real, number),
        [number, twin] if number == twin => (integer, number),
        [number, twin] => {
            let names = [integer, real].map(|span| name(table, span.first));
            return Err(Refusal(format!(
                "{} is {number}, but {} is {twin}: connect one of them and leave the other at 0, \
                 or let them agree",
                names[0], names[1]
            )));
        }
    };
    if number.fract() == 0.0 && number >= 1.0 && number <= modes as f64 {
        return Ok(Some(number as usize - 1));
    }
    let name = name(table, span.first);
    Err(Refusal(format!(
        "{name} is {number}, but the modes are the whole numbers from 1 to {modes}"
    )))
}

/// The mode nearest to the number given, counted from 0: where to start while the mode's source
/// is not initialised.
#[inline]
pub fn nearest_mode(values: &Values, [integer, real]: [Span; 2], modes: usize) -> usize {
    let twin = values.scalar(real);
    let number = if twin == 0.0 {
        values.scalar(integer)
    } else {
        twin
    };
    (number.clamp(1.0, modes.max(1) as f64) as usize).saturating_sub(1)
}

/// Refuses a vector with an element that is NaN or infinite, and names the element.
#[inline]
pub fn require_finite(table: &VariableTable, values: &Values, span: Span) -> Result<(), Refusal> {
    if values.are_finite(span) {
        return Ok(());
    }
    refuse_infinite(table, values, span)
}

#[cold]
fn refuse_infinite(table: &VariableTable, values: &Values, span: Span) -> Result<(), Refusal> {
    match (span.first..)
        .zip(values.get(span))
        .find(|(_, value)| !value.is_finite())
    {
        None => Ok(()),
        Some((reference, value)) => Err(Refusal(format!(
            "{} is {value}: give a finite number",
            name(table, reference)
        ))),
    }
}

fn name(table: &VariableTable, reference: u32) -> &str {
    table
        .get(reference)
        .map_or("an unknown variable", |variable| &variable.name)
}
