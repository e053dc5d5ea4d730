//! The solver's form: minimise `q'x` subject to `b - A x` in a product of cones.

use super::expression::Affine;
use super::inequality::Inequality;
use crate::verdict::SolverFailure;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
    SupportedConeT::{NonnegativeConeT, PSDTriangleConeT, ZeroConeT},
};
#[cfg(feature = "lapack")]
use ftc_lapack as _;
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A conic problem under construction.
pub(super) struct Conic {
    /// One map per scalar: row to coefficient of `A`.
    columns: Vec<BTreeMap<usize, f64>>,
    constants: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

/// A solution with the traces of the semidefinite multipliers.
pub(super) struct Solved {
    pub primal: Vec<f64>,
    pub objective: f64,
    pub bound: f64,
    /// Trace of the dual matrix of each semidefinite constraint, in order.
    pub multipliers: Vec<f64>,
}

impl Conic {
    pub(super) fn new(scalars: usize) -> Self {
        Self {
            columns: vec![BTreeMap::new(); scalars],
            constants: Vec::new(),
            cones: Vec::new(),
        }
    }

    /// Adds `expression = 0` (1 x 1).
    pub(super) fn zero(&mut self, expression: &Affine) {
        self.single(expression);
        self.cones.push(ZeroConeT(1));
    }

    /// Adds `expression >= 0` (1 x 1).
    pub(super) fn nonnegative(&mut self, expression: &Affine) {
        self.single(expression);
        self.cones.push(NonnegativeConeT(1));
    }

    /// One row for a 1 x 1 expression.
    fn single(&mut self, expression: &Affine) {
        let row = self.constants.len();
        self.constants.push(expression.constant(0, 0));
        let columns = &mut self.columns;
        expression.for_each_coefficient(|scalar, _, _, value| {
            *columns[scalar].entry(row).or_default() -= value;
        });
    }

    /// Adds `inequality >= t I`, with `t` the scalar `margin` (zero when absent).
    pub(super) fn semidefinite(&mut self, inequality: &Inequality, margin: Option<usize>) {
        let first = self.constants.len();
        let size = inequality.size();
        self.constants.resize(first + size * (size + 1) / 2, 0.0);
        let (columns, constants) = (&mut self.columns, &mut self.constants);
        inequality.for_each_block(|block, below, right| {
            // The block lies on or below the diagonal; the solver stores the upper triangle by
            // columns, off-diagonal entries times sqrt(2).
            let position = |r: usize, c: usize| {
                let (row, column) = (below + r, right + c);
                (row >= column).then(|| {
                    let weight = if row == column { 1.0 } else { SQRT_2 };
                    (first + row * (row + 1) / 2 + column, weight)
                })
            };
            let (rows, width) = block.shape();
            for r in 0..rows {
                for c in 0..width {
                    if let Some((at, weight)) = position(r, c) {
                        constants[at] = weight * block.constant(r, c);
                    }
                }
            }
            block.for_each_coefficient(|scalar, r, c, value| {
                if let Some((at, weight)) = position(r, c) {
                    *columns[scalar].entry(at).or_default() -= weight * value;
                }
            });
        });
        if let Some(t) = margin {
            for i in 0..size {
                self.columns[t].insert(first + i * (i + 1) / 2 + i, 1.0);
            }
        }
        self.cones.push(PSDTriangleConeT(size));
    }

    /// Minimises `cost' x`. What comes back is a candidate, whatever the solver calls it.
    ///
    /// Now and then a factorisation breaks down in the very first iterations, for no fault of the
    /// problem: another way of factorising then goes through.
    pub(super) fn solve(self, cost: &[f64]) -> Result<Solved, SolverFailure> {
        let coefficients = self.coefficients();
        let mut failed = None;
        for settings in settings() {
            match self.attempt(cost, &coefficients, settings) {
                Ok(solved) => return Ok(solved),
                Err(failure) => failed = failed.or(Some(failure)),
            }
        }
        Err(failed.unwrap_or(SolverFailure::Refused))
    }

    /// One run of the solver.
    fn attempt(
        &self,
        cost: &[f64],
        coefficients: &CscMatrix<f64>,
        settings: DefaultSettings<f64>,
    ) -> Result<Solved, SolverFailure> {
        let quadratic = CscMatrix::zeros((cost.len(), cost.len()));
        let mut solver = DefaultSolver::new(
            &quadratic,
            cost,
            coefficients,
            &self.constants,
            &self.cones,
            settings,
        )
        .map_err(|_| SolverFailure::Refused)?;
        // The solver panics where a factorisation fails on numbers that have broken down.
        catch_unwind(AssertUnwindSafe(|| solver.solve()))
            .map_err(|_| SolverFailure::NumericalTrouble)?;
        let solution = &solver.solution;
        let fits = solution.x.iter().all(|value| value.is_finite())
            && solution.r_prim.max(solution.r_dual) < LARGEST_RESIDUAL;
        match solution.status {
            SolverStatus::Solved
            | SolverStatus::AlmostSolved
            | SolverStatus::InsufficientProgress
            | SolverStatus::NumericalError
            | SolverStatus::MaxIterations
                if fits =>
            {
                Ok(Solved {
                    multipliers: traces(&self.cones, &solution.z),
                    primal: solution.x.clone(),
                    objective: solution.obj_val,
                    bound: solution.obj_val_dual,
                })
            }
            status => Err(failure(status)),
        }
    }

    /// `A` in compressed columns.
    fn coefficients(&self) -> CscMatrix<f64> {
        let mut starts = vec![0];
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for column in &self.columns {
            for (&row, &value) in column.iter().filter(|(_, value)| **value != 0.0) {
                rows.push(row);
                values.push(value);
            }
            starts.push(rows.len());
        }
        CscMatrix::new(
            self.constants.len(),
            self.columns.len(),
            starts,
            rows,
            values,
        )
    }
}

/// Relative residuals above this mean that the solver stopped on its way, wherever it was.
const LARGEST_RESIDUAL: f64 = 1e-5;

/// The ways to solve, in the order they are tried. One thread, so that the same problem gives the
/// same bits; tight tolerances, since strict inequalities depend on the last digits.
fn settings() -> [DefaultSettings<f64>; 3] {
    let usual = DefaultSettings {
        verbose: false,
        direct_solve_method: "qdldl".into(),
        max_threads: 1,
        chordal_decomposition_enable: true,
        tol_gap_abs: 1e-10,
        tol_gap_rel: 1e-9,
        tol_feas: 1e-9,
        ..DefaultSettings::default()
    };
    let undecomposed = DefaultSettings {
        chordal_decomposition_enable: false,
        ..usual.clone()
    };
    let unequilibrated = DefaultSettings {
        equilibrate_enable: false,
        ..undecomposed.clone()
    };
    [usual, undecomposed, unequilibrated]
}

/// What a status without a candidate means to the user.
fn failure(status: SolverStatus) -> SolverFailure {
    match status {
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
            SolverFailure::Contradiction
        }
        SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => {
            SolverFailure::Unbounded
        }
        SolverStatus::MaxIterations | SolverStatus::MaxTime => SolverFailure::TooManyIterations,
        SolverStatus::NumericalError | SolverStatus::InsufficientProgress => {
            SolverFailure::NumericalTrouble
        }
        _ => SolverFailure::Refused,
    }
}

/// The trace of each semidefinite cone's part of a dual vector.
fn traces(cones: &[SupportedConeT<f64>], dual: &[f64]) -> Vec<f64> {
    let mut first = 0;
    let mut traces = Vec::new();
    for cone in cones {
        match cone {
            PSDTriangleConeT(size) => {
                let trace = (0..*size).map(|i| dual[first + i * (i + 1) / 2 + i]).sum();
                traces.push(trace);
                first += size * (size + 1) / 2;
            }
            ZeroConeT(size) | NonnegativeConeT(size) => first += size,
            _ => {}
        }
    }
    traces
}
