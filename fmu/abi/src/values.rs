//! The values of all variables, one flat array indexed by value reference.

use model_description::{Span, VariableTable};
use serde::{Deserialize, Serialize};

/// Current values. Integers and Booleans are held exactly as doubles.
///
/// The slave reads inputs and parameters and writes outputs, by [`Span`]. A span that does not
/// fit reads as empty and is not written: nothing here can panic.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Values(Box<[f64]>);

impl Clone for Values {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }

    /// Copies in place.
    fn clone_from(&mut self, source: &Self) {
        self.0.clone_from(&source.0);
    }
}

impl Values {
    /// The start values of a table.
    pub fn start(table: &VariableTable) -> Self {
        Self(table.iter().map(|(_, variable)| variable.start).collect())
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is no variable.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The elements of a vector.
    pub fn get(&self, span: Span) -> &[f64] {
        self.0.get(span.range()).unwrap_or_default()
    }

    /// The elements of a vector, to be written.
    pub fn get_mut(&mut self, span: Span) -> &mut [f64] {
        self.0.get_mut(span.range()).unwrap_or_default()
    }

    /// Writes a vector; elements without a partner are left alone.
    pub fn set(&mut self, span: Span, values: &[f64]) {
        for (slot, value) in self.get_mut(span).iter_mut().zip(values) {
            *slot = *value;
        }
    }

    /// The value of a scalar; 0 if the span is empty.
    pub fn scalar(&self, span: Span) -> f64 {
        self.get(span).first().copied().unwrap_or_default()
    }

    /// The value of a Boolean scalar.
    pub fn flag(&self, span: Span) -> bool {
        self.scalar(span) != 0.0
    }

    /// Gives every variable the same value.
    pub(crate) fn fill(&mut self, value: f64) {
        self.0.fill(value);
    }

    /// The value behind a value reference.
    pub(crate) fn at(&self, reference: u32) -> Option<f64> {
        self.0.get(reference as usize).copied()
    }

    /// The slot behind a value reference.
    pub(crate) fn slot(&mut self, reference: u32) -> Option<&mut f64> {
        self.0.get_mut(reference as usize)
    }
}
