//! Which solver finds gains, and how its progress is reported.

use std::fmt;

/// Which solver finds gains. Whatever it returns is certified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Solver {
    /// The interior-point method that uses the structure of (T1) and (T2); the general one where
    /// that falls short.
    #[default]
    Structured,
    /// The general conic solver (Clarabel) alone.
    General,
}

/// How far a synthesis has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Step {
    /// An iteration of the interior-point method.
    Iteration {
        /// Number of this iteration, from 0.
        number: usize,
        /// How many are usual.
        usual: usize,
        /// Unknowns that are left after elimination.
        unknowns: usize,
        /// What is solved.
        what: &'static str,
        /// First mode of the problem, from 1.
        mode: usize,
    },
    /// The interior-point method fell short; the general solver takes over.
    GeneralSolver,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Iteration {
                number,
                usual,
                unknowns,
                what,
                mode,
            } => write!(
                f,
                "{what} of mode {mode}, iteration {} of about {usual} ({unknowns} unknowns)",
                number + 1
            ),
            Self::GeneralSolver => write!(f, "the general solver"),
        }
    }
}

/// How a synthesis is run.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct Run<'a> {
    /// The solver.
    pub solver: Solver,
    /// Called at every step, from several threads where several are offered.
    pub watch: &'a (dyn Fn(Step) + Sync),
}

impl Default for Run<'_> {
    fn default() -> Self {
        Self {
            solver: Solver::Structured,
            watch: &|_| (),
        }
    }
}

impl fmt::Debug for Run<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Run")
            .field("solver", &self.solver)
            .finish_non_exhaustive()
    }
}
