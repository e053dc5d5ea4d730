//! Quadratic programmes under bounds, by the conic solver that the gains are made with: its code is then
//! compiled once.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};
use ftc_control::parameters::Limits;
use nalgebra::DMatrix;

/// Minimises `x' H x / 2 + q' x` subject to bounds on each `x`; prepared once, solved for many `q`.
pub struct QuadraticProgram {
    solver: DefaultSolver<f64>,
}

/// The solver refuses a programme; why, in its words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the quadratic programme was refused: {0}")]
#[non_exhaustive]
pub struct RefusedProgram(String);

impl QuadraticProgram {
    /// With the positive definite `hessian` `H` (N x N) and the bounds of each variable (N).
    ///
    /// # Errors
    /// A programme the solver refuses.
    pub fn new(hessian: &DMatrix<f64>, bounds: &[Limits]) -> Result<Self, RefusedProgram> {
        let size = hessian.nrows();
        let sides = bounds.iter().enumerate().flat_map(|(variable, limits)| {
            [(1.0, limits.max), (-1.0, limits.min)]
                .into_iter()
                .filter_map(move |(sign, bound)| Some((variable, sign, sign * bound?)))
        });
        let sides: Vec<(usize, f64, f64)> = sides.collect();
        let mut coefficients = DMatrix::zeros(sides.len(), size);
        for (row, &(variable, sign, _)) in sides.iter().enumerate() {
            coefficients[(row, variable)] = sign;
        }
        let settings = DefaultSettings {
            verbose: false,
            presolve_enable: false,
            chordal_decomposition_enable: false,
            ..DefaultSettings::default()
        };
        let solver = DefaultSolver::new(
            &sparse(&hessian.upper_triangle()),
            &vec![0.0; size],
            &sparse(&coefficients),
            &sides.iter().map(|side| side.2).collect::<Vec<_>>(),
            &[SupportedConeT::NonnegativeConeT(sides.len())],
            settings,
        );
        let solver = solver.map_err(|why| RefusedProgram(why.to_string()))?;
        Ok(Self { solver })
    }

    /// The minimiser (N) for the linear term `q` (N); none where the solver fails.
    pub fn minimise(&mut self, linear: &[f64]) -> Option<&[f64]> {
        self.solver.update_q(&linear.to_vec()).ok()?;
        self.solver.solve();
        let found = &self.solver.solution.x;
        let finite = found.iter().all(|value| value.is_finite());
        finite.then_some(&found[..])
    }
}

fn sparse(matrix: &DMatrix<f64>) -> CscMatrix<f64> {
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for (column, entries) in matrix.column_iter().enumerate() {
        for (row, &value) in entries.iter().enumerate() {
            if value != 0.0 {
                rows.push(row);
                columns.push(column);
                values.push(value);
            }
        }
    }
    CscMatrix::new_from_triplets(matrix.nrows(), matrix.ncols(), rows, columns, values)
}
