//! Linear matrix inequalities: unknown matrices, affine block matrices with names, and a solver.
//!
//! A theorem is written as it is read: [`Problem::symmetric`] and [`Problem::full`] make unknowns,
//! [`Affine`] expressions combine them with constant matrices, [`Inequality`] arranges expressions
//! in a symmetric block matrix that must be positive definite. [`Problem::minimise`] optimises a
//! scalar; [`Problem::margin`] decides feasibility, which an interior-point solver alone does not
//! do on strict inequalities.

mod congruences;
mod conic;
mod expression;
mod inequality;
mod problem;

pub use expression::{Affine, Variable};
pub use inequality::Inequality;
pub use problem::{Candidate, Margin, Problem, trace};
