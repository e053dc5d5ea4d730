//! What no schema and no public checker sees: whether a table makes sense.

use crate::{Causality, Initial, Kind, Variability, Variable, VariableTable};
use std::collections::HashSet;

/// Every violation of the standard's rules in a table of variables, at least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", .violations.iter().map(Violation::to_string).collect::<Vec<_>>().join("; "))]
#[non_exhaustive]
pub struct TableError {
    /// In the order of the table.
    pub violations: Vec<Violation>,
}

/// A variable that violates a rule.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{variable}: {rule}")]
#[non_exhaustive]
pub struct Violation {
    /// Its name.
    pub variable: String,
    /// The rule.
    pub rule: Rule,
}

/// A rule of the standard on variables, or of this table, that is violated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Rule {
    /// Names are unique.
    #[error("the name is used twice")]
    UniqueName,
    /// Names are structured: `identifier`, `identifier[i]` or `identifier[i,j]`.
    #[error("the name does not follow structured naming")]
    StructuredName,
    /// The elements of a role are contiguous.
    #[error("the variables of its role are not side by side")]
    Contiguous,
    /// The standard allows the combination of causality, variability and initial.
    #[error("causality, variability and initial do not go together")]
    Combination,
    /// Only a Real is continuous.
    #[error("only a Real can be continuous")]
    ContinuousReal,
    /// Only outputs have dependencies.
    #[error("only outputs have dependencies")]
    DependenciesOfOutputs,
    /// Dependencies ascend.
    #[error("dependencies are not in ascending order")]
    AscendingDependencies,
    /// Outputs depend on inputs.
    #[error("an output depends on something that is no input")]
    DependsOnInputs,
    /// During initialization outputs depend on inputs and parameters.
    #[error("an initial output depends on something that is not known")]
    DependsOnKnowns,
    /// A nominal value is positive.
    #[error("nominal is not a positive number")]
    PositiveNominal,
    /// All numbers are finite.
    #[error("start, min and max must be finite")]
    Finite,
    /// `min <= max`.
    #[error("min is greater than max")]
    Range,
    /// `start` lies within `[min, max]`.
    #[error("start is not within [min, max]")]
    StartInRange,
    /// Integers and Booleans are exact.
    #[error("start is not a whole number")]
    WholeStart,
}

impl VariableTable {
    /// Checks the standard's rules on variables.
    ///
    /// # Errors
    /// Every [`Rule`] that a variable violates.
    pub fn check(&self) -> Result<(), TableError> {
        let mut violations = Vec::new();
        let mut names = HashSet::new();
        for (reference, variable) in self.iter() {
            let mut violated = |rule: Rule| {
                violations.push(Violation {
                    variable: variable.name.clone(),
                    rule,
                });
            };
            if !names.insert(&variable.name) {
                violated(Rule::UniqueName);
            }
            if !is_structured(&variable.name) {
                violated(Rule::StructuredName);
            }
            if !self
                .span(variable.role)
                .range()
                .contains(&(reference as usize))
            {
                violated(Rule::Contiguous);
            }
            range_rules(variable).into_iter().for_each(&mut violated);
            if !is_allowed(variable.causality, variable.variability, variable.initial()) {
                violated(Rule::Combination);
            }
            if variable.variability == Variability::Continuous
                && !matches!(variable.kind, Kind::Real { .. })
            {
                violated(Rule::ContinuousReal);
            }
            self.dependency_rules(variable)
                .into_iter()
                .for_each(&mut violated);
        }
        match violations.is_empty() {
            true => Ok(()),
            false => Err(TableError { violations }),
        }
    }

    fn dependency_rules(&self, variable: &Variable) -> Vec<Rule> {
        let mut violated = Vec::new();
        let is = |reference: u32, wanted: &[Causality]| {
            self.get(reference)
                .is_some_and(|known| wanted.contains(&known.causality))
        };
        let (running, starting) = (&variable.dependencies, &variable.initial_dependencies);
        if variable.causality != Causality::Output && !(running.is_empty() && starting.is_empty()) {
            violated.push(Rule::DependenciesOfOutputs);
        }
        if !(running.is_sorted_by(|a, b| a < b) && starting.is_sorted_by(|a, b| a < b)) {
            violated.push(Rule::AscendingDependencies);
        }
        if !running.iter().all(|&r| is(r, &[Causality::Input])) {
            violated.push(Rule::DependsOnInputs);
        }
        let knowns = [Causality::Input, Causality::Parameter];
        if !starting.iter().all(|&r| is(r, &knowns)) {
            violated.push(Rule::DependsOnKnowns);
        }
        violated
    }
}

fn range_rules(variable: &Variable) -> Vec<Rule> {
    let mut violated = Vec::new();
    let start = variable.start;
    let (min, max) = match variable.kind {
        Kind::Real {
            nominal, min, max, ..
        } => {
            if nominal.is_some_and(|nominal| !(nominal.is_finite() && nominal > 0.0)) {
                violated.push(Rule::PositiveNominal);
            }
            (min, max)
        }
        Kind::Integer { min, max } => (min.map(f64::from), max.map(f64::from)),
        Kind::Boolean => (Some(0.0), Some(1.0)),
    };
    if !(start.is_finite() && [min, max].iter().flatten().all(|bound| bound.is_finite())) {
        violated.push(Rule::Finite);
    }
    if min.zip(max).is_some_and(|(min, max)| min > max) {
        violated.push(Rule::Range);
    }
    if min.is_some_and(|min| start < min) || max.is_some_and(|max| start > max) {
        violated.push(Rule::StartInRange);
    }
    let exact = start.fract() == 0.0 && start.abs() <= f64::from(i32::MAX);
    if !matches!(variable.kind, Kind::Real { .. }) && !exact {
        violated.push(Rule::WholeStart);
    }
    violated
}

/// The standard's table of combinations (FMI 2.0, section 2.2.7), for the causalities in use.
fn is_allowed(causality: Causality, variability: Variability, initial: Option<Initial>) -> bool {
    use Variability::{Continuous, Discrete, Fixed, Tunable};
    match causality {
        Causality::Parameter => {
            matches!(variability, Fixed | Tunable) && initial == Some(Initial::Exact)
        }
        Causality::Input => matches!(variability, Discrete | Continuous) && initial.is_none(),
        Causality::Output => matches!(variability, Discrete | Continuous) && initial.is_some(),
    }
}

/// `identifier` or `identifier[i]` or `identifier[i,j]`, with indices from 1.
fn is_structured(name: &str) -> bool {
    let (identifier, indices) = match name.split_once('[') {
        None => (name, None),
        Some((identifier, rest)) => match rest.strip_suffix(']') {
            None => return false,
            Some(indices) => (identifier, Some(indices)),
        },
    };
    let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    let index = |text: &str| {
        !text.is_empty() && !text.starts_with('0') && text.bytes().all(|b| b.is_ascii_digit())
    };
    identifier.starts_with(letter)
        && identifier.chars().all(|c| letter(c) || c.is_ascii_digit())
        && indices.is_none_or(|indices| indices.split(',').all(index))
}
