//! What no schema and no public checker sees: whether a table makes sense.

use crate::{Causality, Initial, Kind, Variability, Variable, VariableTable};
use std::collections::HashSet;

impl VariableTable {
    /// Every violation of the standard's rules on variables, one sentence each.
    ///
    /// Names are unique and structured; start values lie within `[min, max]`, `min <= max`;
    /// Integers and Booleans are exact; causality, variability and initial are a combination
    /// the standard allows; dependencies name inputs (and, during initialization, parameters)
    /// of this table in ascending order; the elements of a role are contiguous.
    pub fn check(&self) -> Result<(), Vec<String>> {
        let mut problems = Vec::new();
        let mut names = HashSet::new();
        for (reference, variable) in self.iter() {
            let name = &variable.name;
            let mut say = |problem: &str| problems.push(format!("{name}: {problem}"));
            if !names.insert(name) {
                say("the name is used twice");
            }
            if !is_structured(name) {
                say("the name does not follow structured naming");
            }
            if !self
                .span(variable.role)
                .range()
                .contains(&(reference as usize))
            {
                say("the variables of its role are not side by side");
            }
            range_problems(variable).into_iter().for_each(&mut say);
            if !is_allowed(variable.causality, variable.variability, variable.initial()) {
                say("causality, variability and initial do not go together");
            }
            if variable.variability == Variability::Continuous
                && !matches!(variable.kind, Kind::Real { .. })
            {
                say("only a Real can be continuous");
            }
            self.dependency_problems(variable)
                .into_iter()
                .for_each(&mut say);
        }
        if problems.is_empty() {
            Ok(())
        } else {
            Err(problems)
        }
    }

    fn dependency_problems(&self, variable: &Variable) -> Vec<&'static str> {
        let mut problems = Vec::new();
        let is = |reference: u32, wanted: &[Causality]| {
            self.get(reference)
                .is_some_and(|known| wanted.contains(&known.causality))
        };
        let (running, starting) = (&variable.dependencies, &variable.initial_dependencies);
        if variable.causality != Causality::Output && !(running.is_empty() && starting.is_empty()) {
            problems.push("only outputs have dependencies");
        }
        if !(running.is_sorted_by(|a, b| a < b) && starting.is_sorted_by(|a, b| a < b)) {
            problems.push("dependencies are not in ascending order");
        }
        if !running.iter().all(|&r| is(r, &[Causality::Input])) {
            problems.push("an output depends on something that is no input");
        }
        let knowns = [Causality::Input, Causality::Parameter];
        if !starting.iter().all(|&r| is(r, &knowns)) {
            problems.push("an initial output depends on something that is not known");
        }
        problems
    }
}

fn range_problems(variable: &Variable) -> Vec<&'static str> {
    let mut problems = Vec::new();
    let start = variable.start;
    let (min, max) = match variable.kind {
        Kind::Real {
            nominal, min, max, ..
        } => {
            if nominal.is_some_and(|nominal| !(nominal.is_finite() && nominal > 0.0)) {
                problems.push("nominal is not a positive number");
            }
            (min, max)
        }
        Kind::Integer { min, max } => (min.map(f64::from), max.map(f64::from)),
        Kind::Boolean => (Some(0.0), Some(1.0)),
    };
    if !(start.is_finite() && [min, max].iter().flatten().all(|bound| bound.is_finite())) {
        problems.push("start, min and max must be finite");
    }
    if min.zip(max).is_some_and(|(min, max)| min > max) {
        problems.push("min is greater than max");
    }
    if min.is_some_and(|min| start < min) || max.is_some_and(|max| start > max) {
        problems.push("start is not within [min, max]");
    }
    let exact = start.fract() == 0.0 && start.abs() <= f64::from(i32::MAX);
    if !matches!(variable.kind, Kind::Real { .. }) && !exact {
        problems.push("start is not a whole number");
    }
    problems
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
