//! The ordered table of variables.

use crate::{Causality, Role, Variable};

/// A contiguous range of value references: one vector of variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Span {
    /// Value reference of the first element.
    pub first: u32,
    /// Number of elements.
    pub len: u32,
}

impl Span {
    /// The positions of the elements in the table.
    #[inline]
    pub fn range(self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.len as usize
    }

    /// Whether there is no element.
    pub fn is_empty(self) -> bool {
        self.len == 0
    }
}

/// All variables of one FMU, in the order of their value references.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VariableTable {
    variables: Vec<Variable>,
}

impl VariableTable {
    /// An empty table.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends a variable and returns its value reference.
    pub fn push(&mut self, variable: Variable) -> u32 {
        self.variables.push(variable);
        self.variables.len() as u32 - 1
    }

    /// Appends a vector of variables of one role.
    pub fn extend(&mut self, variables: impl IntoIterator<Item = Variable>) -> Span {
        let first = self.variables.len() as u32;
        self.variables.extend(variables);
        Span {
            first,
            len: self.variables.len() as u32 - first,
        }
    }

    /// The variable with this value reference.
    pub fn get(&self, reference: u32) -> Option<&Variable> {
        self.variables.get(reference as usize)
    }

    /// The variables with their value references, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (u32, &Variable)> {
        self.variables
            .iter()
            .enumerate()
            .map(|(at, variable)| (at as u32, variable))
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.variables.len()
    }

    /// Whether the table has no variable.
    pub fn is_empty(&self) -> bool {
        self.variables.is_empty()
    }

    /// Where the variables of a role lie; empty if there are none.
    pub fn span(&self, role: Role) -> Span {
        self.span_where(|variable| variable.role == role)
    }

    /// Where a vector such as `y[1..p]` (or the scalar) of this base name lies.
    pub fn vector(&self, base: &str) -> Span {
        self.span_where(|variable| {
            let name = variable.name.as_str();
            name.split_once('[').map_or(name, |(front, _)| front) == base
        })
    }

    /// The outputs, in order.
    pub fn outputs(&self) -> impl Iterator<Item = (u32, &Variable)> {
        self.iter()
            .filter(|(_, variable)| variable.causality == Causality::Output)
    }

    /// Gives every output of a role what it depends on during initialization.
    ///
    /// `of(i)` lists the spans for element `i` of the vector, counted from 0.
    pub(crate) fn depend(&mut self, role: Role, of: impl Fn(u32) -> Vec<Span>) {
        for (element, at) in self.span(role).range().enumerate() {
            let mut references: Vec<u32> = of(element as u32)
                .into_iter()
                .flat_map(|span| span.first..span.first + span.len)
                .collect();
            references.sort_unstable();
            references.dedup();
            self.variables[at].initial_dependencies = references;
        }
    }

    fn span_where(&self, belongs: impl Fn(&Variable) -> bool) -> Span {
        let first = self.variables.iter().position(&belongs);
        first.map_or_else(Span::default, |first| Span {
            first: first as u32,
            len: self.variables[first..]
                .iter()
                .take_while(|variable| belongs(variable))
                .count() as u32,
        })
    }
}
