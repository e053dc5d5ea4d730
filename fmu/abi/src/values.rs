//! The values of all variables, one flat array indexed by value reference.

use model_description::{Span, VariableTable};
use serde::{Deserialize, Serialize};

/// Current values. Integers and Booleans are held exactly as doubles.
///
/// The slave reads inputs and parameters and writes outputs, by [`Span`]. A span that does not
/// fit reads as empty and is not written: nothing here can panic.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Values {
    slots: Box<[f64]>,
    /// See [`Values::are_settled`]; no saved byte tells it.
    #[serde(skip)]
    settled: bool,
}

impl Clone for Values {
    fn clone(&self) -> Self {
        Self {
            slots: self.slots.clone(),
            settled: self.settled,
        }
    }

    /// Copies in place.
    fn clone_from(&mut self, source: &Self) {
        self.slots.clone_from(&source.slots);
        self.settled = source.settled;
    }
}

impl Values {
    /// The start values of a table.
    pub fn start(table: &VariableTable) -> Self {
        Self {
            slots: table.iter().map(|(_, variable)| variable.start).collect(),
            settled: false,
        }
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there is no variable.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The elements of a vector.
    #[inline]
    pub fn get(&self, span: Span) -> &[f64] {
        self.slots.get(span.range()).unwrap_or_default()
    }

    /// The elements of a vector, to be written.
    #[inline]
    pub fn get_mut(&mut self, span: Span) -> &mut [f64] {
        self.slots.get_mut(span.range()).unwrap_or_default()
    }

    /// Writes a vector; elements without a partner are left alone.
    #[inline]
    pub fn set(&mut self, span: Span, values: &[f64]) {
        match (self.get_mut(span), values) {
            // Most vectors are short: calling for a copy would cost more than copying.
            ([slot], [value]) => *slot = *value,
            ([first, second], [one, two]) => (*first, *second) = (*one, *two),
            (slots, values) => copy(slots, values),
        }
    }

    /// Whether every element of a vector is a finite number.
    #[inline]
    pub fn are_finite(&self, span: Span) -> bool {
        // No difference of infinities: a host may have traps enabled.
        let finite = |all: bool, value: &f64| all & value.is_finite();
        self.get(span).iter().fold(true, finite)
    }

    /// The value of a scalar; 0 if the span is empty.
    #[inline]
    pub fn scalar(&self, span: Span) -> f64 {
        self.get(span).first().copied().unwrap_or_default()
    }

    /// The value of a Boolean scalar.
    #[inline]
    pub fn flag(&self, span: Span) -> bool {
        self.scalar(span) != 0.0
    }

    /// Whether all that has been set since the slave last settled them is
    /// [latched](crate::Slave::is_latched); never in a state that was read from bytes.
    #[inline]
    pub fn are_settled(&self) -> bool {
        self.settled
    }

    /// Notes that the slave has checked and used what was set so far.
    #[inline]
    pub fn settle(&mut self) {
        self.settled = true;
    }

    /// Notes that something was set.
    #[inline]
    pub(crate) fn unsettle(&mut self) {
        self.settled = false;
    }

    /// Gives every variable the same value.
    pub(crate) fn fill(&mut self, value: f64) {
        self.slots.fill(value);
    }

    /// The value behind a value reference.
    #[inline]
    pub(crate) fn at(&self, reference: u32) -> Option<f64> {
        self.slots.get(reference as usize).copied()
    }

    /// The slot behind a value reference.
    #[inline]
    pub(crate) fn slot(&mut self, reference: u32) -> Option<&mut f64> {
        self.slots.get_mut(reference as usize)
    }
}

fn copy(slots: &mut [f64], values: &[f64]) {
    for (slot, value) in slots.iter_mut().zip(values) {
        *slot = *value;
    }
}
