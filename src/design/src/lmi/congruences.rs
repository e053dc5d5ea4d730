//! The margin problem for the interior-point method that uses its structure.

use super::expression::{Affine, Variable};
use super::inequality::Inequality;
use super::problem::{Margin, Problem};
use crate::interior_point::Problem as Structured;
use crate::interior_point::{Block, Congruence, Product, Settings, maximise};
use crate::verdict::SolverFailure;
use nalgebra::DMatrix;

impl Problem {
    /// Maximises `t` subject to every inequality `>= t I` and the equations. With the unknowns
    /// normalised (see [`Problem::require_trace`]) this problem always has a strictly feasible point,
    /// and a negative or vanishing optimum means that the inequalities conflict.
    ///
    /// Solved by the interior-point method that uses the structure where there is one, else by the
    /// general solver.
    ///
    /// # Errors
    /// When the solver returns nothing that could be a solution.
    pub fn margin(&self) -> Result<Margin, SolverFailure> {
        margin(self).map_or_else(|| self.margin_by_general_solver(), Ok)
    }
}

/// The margin, if every inequality is a sum of congruences of symmetric unknowns of one size and of at
/// most one product with an unknown without structure, the traces of the symmetric ones being
/// given, and if the method converges.
fn margin(problem: &Problem) -> Option<Margin> {
    let translation = Translation::of(problem)?;
    let solution = maximise(&translation.problem, SETTINGS, &mut |_| ())?;
    if !solution.converged {
        return None;
    }
    let total: f64 = solution.multipliers.iter().sum();
    let names = problem
        .inequalities
        .iter()
        .map(|inequality| inequality.name.clone());
    let shares = solution.multipliers.iter().map(|weight| weight / total);
    let mut scalars = vec![0.0; problem.scalars];
    let symmetric = translation.symmetric.iter().zip(&solution.point.symmetric);
    let full = translation.full.iter().zip(&solution.point.full);
    for (variable, value) in symmetric.chain(full) {
        for row in 0..value.nrows() {
            for column in 0..value.ncols() {
                scalars[variable.scalar(row, column)] = value[(row, column)];
            }
        }
    }
    Some(Margin {
        margin: solution.value,
        scalars,
        weights: names.zip(shares).collect(),
    })
}

const SETTINGS: Settings = Settings {
    gap: 1e-4,
    absolute_gap: 1e-10,
    enough: f64::INFINITY,
    iterations: 60,
};

/// A problem in the method's form, and which unknown is which.
struct Translation {
    problem: Structured,
    symmetric: Vec<Variable>,
    full: Vec<Variable>,
}

impl Translation {
    fn of(problem: &Problem) -> Option<Self> {
        let (symmetric, full): (Vec<Variable>, Vec<Variable>) = problem
            .variables
            .iter()
            .partition(|variable| variable.is_symmetric());
        let order = symmetric.first()?.shape().0;
        let (normalised, total) = problem.normalised.as_ref()?;
        let all_normalised = normalised.len() == symmetric.len()
            && symmetric
                .iter()
                .all(|variable| normalised.contains(&Some(*variable)));
        let plain = problem.bounds.is_empty() && problem.equations.len() == 1;
        if !(plain && all_normalised && symmetric.iter().all(|v| v.shape().0 == order)) {
            return None;
        }
        let mut translation = Self {
            problem: Structured {
                order,
                symmetric: symmetric.len(),
                full: full.iter().map(Variable::shape).collect(),
                blocks: Vec::new(),
                bounds: Vec::new(),
                total: Some(*total),
            },
            symmetric,
            full,
        };
        for inequality in &problem.inequalities {
            let block = translation.block(inequality)?;
            translation.problem.blocks.push(block);
        }
        Some(translation)
    }

    fn block(&self, inequality: &Inequality) -> Option<Block> {
        let size = inequality.size();
        let mut block = Block {
            constant: DMatrix::zeros(size, size),
            congruences: Vec::new(),
            product: None,
            scalar: Some(-DMatrix::identity(size, size)),
        };
        let mut fits = true;
        inequality.for_each_block(|expression, below, right| {
            fits &= self.add(&mut block, expression, below, right).is_some();
        });
        fits.then_some(block)
    }

    /// Adds an expression that stands at (below, right), on or below the diagonal.
    fn add(
        &self,
        block: &mut Block,
        expression: &Affine,
        below: usize,
        right: usize,
    ) -> Option<()> {
        let (rows, columns) = expression.shape();
        for r in 0..rows {
            for c in 0..columns {
                block.constant[(below + r, right + c)] = expression.constant(r, c);
                block.constant[(right + c, below + r)] = expression.constant(r, c);
            }
        }
        let size = block.size();
        let placed = |matrix: &DMatrix<f64>, at: usize| {
            let mut map = DMatrix::zeros(size, matrix.ncols());
            map.rows_mut(at, matrix.nrows()).copy_from(matrix);
            map
        };
        for (variable, transposed, left, other) in expression.products() {
            let (left, other) = (placed(left, below), placed(&other.transpose(), right));
            // Off the diagonal the transposed block adds the other half.
            let share = if below == right { 0.5 } else { 1.0 };
            match self.symmetric.iter().position(|known| *known == variable) {
                Some(unknown) => add_symmetric(block, unknown, share, &left, &other),
                None => {
                    let unknown = self.full.iter().position(|known| *known == variable)?;
                    let (left, right) = if transposed {
                        (other, left)
                    } else {
                        (left, other)
                    };
                    let right = share * right;
                    if !join(block.product.as_mut(), unknown, &left, &right) {
                        if block.product.is_some() {
                            return None;
                        }
                        block.product = Some(Product {
                            unknown,
                            left,
                            right,
                        });
                    }
                }
            }
        }
        Some(())
    }
}

/// Adds a product to one with the same unknown and the same factor on one side; `false` where that
/// cannot be.
fn join(
    product: Option<&mut Product>,
    unknown: usize,
    left: &DMatrix<f64>,
    right: &DMatrix<f64>,
) -> bool {
    let Some(product) = product.filter(|product| product.unknown == unknown) else {
        return false;
    };
    if product.left == *left {
        product.right += right;
    } else if product.right == *right {
        product.left += left;
    } else {
        return false;
    }
    true
}

/// Adds `share (U Q V' + V Q U')` as congruences of `Q`.
fn add_symmetric(
    block: &mut Block,
    unknown: usize,
    share: f64,
    left: &DMatrix<f64>,
    right: &DMatrix<f64>,
) {
    let mut push = |sign: f64, map: DMatrix<f64>| {
        if map.amax() > 0.0 {
            block.congruences.push(Congruence { unknown, sign, map });
        }
    };
    if left == right || *left == -right {
        let sign = if left == right { 1.0 } else { -1.0 };
        return push(sign, (2.0 * share).sqrt() * left);
    }
    let root = (0.5 * share).sqrt();
    push(1.0, root * (left + right));
    push(-1.0, root * (left - right));
}
