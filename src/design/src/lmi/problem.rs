//! Problems over linear matrix inequalities, and the margin problem that decides feasibility.

use super::conic::{self, Conic};
use super::expression::{Affine, Variable};
use super::inequality::Inequality;
use crate::blocks::BlockName;
use crate::verdict::SolverFailure;
use nalgebra::DMatrix;

/// Unknowns, inequalities and linear equations between scalars.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    pub(super) scalars: usize,
    pub(super) variables: Vec<Variable>,
    pub(super) inequalities: Vec<Inequality>,
    pub(super) equations: Vec<Affine>,
    pub(super) bounds: Vec<Affine>,
    /// The unknowns whose traces add up to a given value, and that value; `None` in the place of an
    /// expression that is no unknown alone.
    pub(super) normalised: Option<(Vec<Option<Variable>>, f64)>,
}

/// What the solver returned, not yet verified.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Candidate {
    /// The scalars of the problem, to be read through [`Variable::value`].
    pub scalars: Vec<f64>,
    /// The objective's value at these.
    pub objective: f64,
    /// The dual bound on the objective.
    pub bound: f64,
}

/// The largest margin by which all inequalities hold at once.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Margin {
    /// `t*`: every inequality holds with `>= t* I`.
    pub margin: f64,
    /// The unknowns that reach it.
    pub scalars: Vec<f64>,
    /// Each inequality and its share (0 to 1) of the dual multiplier: how much it limits the margin.
    pub weights: Vec<(BlockName, f64)>,
}

impl Problem {
    /// No unknowns yet.
    pub fn new() -> Self {
        Self::default()
    }

    fn register(&mut self, variable: Variable) -> Variable {
        self.scalars += variable.count();
        self.variables.push(variable);
        variable
    }

    /// A new symmetric unknown (size x size).
    pub fn symmetric(&mut self, size: usize) -> Variable {
        self.register(Variable::symmetric(self.scalars, size))
    }

    /// A new unknown matrix without structure.
    pub fn full(&mut self, rows: usize, columns: usize) -> Variable {
        self.register(Variable::full(self.scalars, rows, columns))
    }

    /// A new unknown number.
    pub fn scalar(&mut self) -> Variable {
        self.full(1, 1)
    }

    /// Demands that a block matrix be positive definite.
    pub fn require(&mut self, inequality: Inequality) {
        self.inequalities.push(inequality);
    }

    /// Demands that the sum of the diagonals of these square expressions equal `value`.
    pub fn require_trace(&mut self, expressions: &[Affine], value: f64) {
        let unknowns = expressions.iter().map(Affine::as_variable).collect();
        self.normalised = Some((unknowns, value));
        self.equations.push(trace(expressions) - number(value));
    }

    /// Demands that the sum of the diagonals of these square expressions be at most `value`.
    pub fn require_trace_below(&mut self, expressions: &[Affine], value: f64) {
        self.bounds.push(number(value) - trace(expressions));
    }

    /// Demands that an unknown number be at least `value`.
    pub fn require_at_least(&mut self, variable: &Variable, value: f64) {
        self.bounds.push(variable.expression() - number(value));
    }

    /// Minimises a number (1 x 1).
    ///
    /// # Errors
    /// When the solver returns nothing that could be a solution.
    pub fn minimise(&self, objective: impl Into<Affine>) -> Result<Candidate, SolverFailure> {
        let objective = objective.into();
        let mut cost = vec![0.0; self.scalars];
        objective.for_each_coefficient(|scalar, _, _, value| cost[scalar] += value);
        let solved = self.conic(None).solve(&cost)?;
        let constant = objective.constant(0, 0);
        Ok(Candidate {
            scalars: solved.primal,
            objective: solved.objective + constant,
            bound: solved.bound + constant,
        })
    }

    /// [`Problem::margin`] by the general solver alone.
    ///
    /// # Errors
    /// When the solver returns nothing that could be a solution.
    pub fn margin_by_general_solver(&self) -> Result<Margin, SolverFailure> {
        let t = self.scalars;
        let mut cost = vec![0.0; t + 1];
        cost[t] = -1.0;
        let mut solved = self.conic(Some(t)).solve(&cost)?;
        solved.primal.truncate(t);
        let total: f64 = solved.multipliers.iter().sum();
        let names = self.inequalities.iter().map(|i| i.name.clone());
        let shares = solved.multipliers.iter().map(|w| w / total);
        Ok(Margin {
            margin: -solved.objective,
            scalars: solved.primal,
            weights: names.zip(shares).collect(),
        })
    }

    /// The problem in the solver's form; `margin` is the scalar `t` of `>= t I`.
    fn conic(&self, margin: Option<usize>) -> Conic {
        let mut conic = conic::Conic::new(self.scalars + usize::from(margin.is_some()));
        for equation in &self.equations {
            conic.zero(equation);
        }
        for bound in &self.bounds {
            conic.nonnegative(bound);
        }
        for inequality in &self.inequalities {
            conic.semidefinite(inequality, margin);
        }
        conic
    }
}

/// A constant number as an expression.
fn number(value: f64) -> Affine {
    DMatrix::from_element(1, 1, value).into()
}

/// The sum of all diagonals, 1 x 1.
pub fn trace(expressions: &[Affine]) -> Affine {
    let mut sum = number(0.0);
    for expression in expressions {
        let size = expression.shape().0;
        for i in 0..size {
            let unit = DMatrix::from_fn(size, 1, |r, _| f64::from(u8::from(r == i)));
            sum = sum + &unit.transpose() * expression.clone() * &unit;
        }
    }
    sum
}
