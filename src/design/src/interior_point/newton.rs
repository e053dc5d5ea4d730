//! The Newton system: assembly over symmetric pairs, elimination of the unknowns without structure.
//!
//! For `F(Q) = sum_k s_k T_k Q T_k'` and the scaling matrix `W`, the entry of the Schur matrix at
//! (a, b) and (c, d) is `sum_kl s_k s_l (G_ac G_bd + G_ad G_bc)` with `G = T_k' W T_l`, times 1/2 for
//! each of the two pairs that lies on the diagonal, times 2. The unknowns without structure meet the symmetric ones, but
//! not each other, and are taken out one by one.

use super::dense::{Triangular, subtract_gram, times, transposed_times};
use super::problem::{Block, Gradient, Point, Problem, write_coordinates};
use nalgebra::{DMatrix, DVector};

/// A factored Newton matrix.
pub(super) struct Newton {
    /// Factor of each unknown without structure.
    eliminated: Vec<Triangular>,
    /// `L^-1 C`: what couples each of them to the reduced coordinates.
    coupling: Vec<DMatrix<f64>>,
    /// Factor of the equilibrated Schur complement.
    reduced: Triangular,
    /// Equilibration of the Schur complement.
    scale: DVector<f64>,
    /// `S^-1 a` and `a' S^-1 a` of the equation `a'q = total`.
    equation: Option<(DVector<f64>, DVector<f64>, f64)>,
}

/// The matrices `G` of one pair of symmetric unknowns, with their signs.
type Squares = Vec<(f64, DMatrix<f64>)>;

/// What is being assembled.
struct Assembly<'a> {
    problem: &'a Problem,
    /// Schur matrix of the reduced coordinates, lower triangle.
    reduced: DMatrix<f64>,
    /// Matrix of each unknown without structure.
    full: Vec<DMatrix<f64>>,
    /// Coupling of each to the reduced coordinates.
    coupling: Vec<DMatrix<f64>>,
    /// For each pair of symmetric unknowns (the larger index first).
    squares: Vec<Squares>,
}

impl Newton {
    /// Assembles and factors; `weights` are the scaling matrices of the blocks, `ratios` those of the
    /// bounds. `None` where the matrix is not positive definite to working precision.
    pub fn new(problem: &Problem, weights: &[&DMatrix<f64>], ratios: &[f64]) -> Option<Self> {
        let mut assembly = Assembly::new(problem);
        for (block, weight) in problem.blocks.iter().zip(weights) {
            assembly.add_block(block, weight);
        }
        assembly.add_squares();
        for (bound, ratio) in problem.bounds.iter().zip(ratios) {
            assembly.add_bound(&bound.traces, bound.scalar, *ratio);
        }
        assembly.factor()
    }

    /// Solves for the direction, and for the multiplier of the equation where there is one; `residual`
    /// is what the traces still lack.
    pub fn solve(&self, problem: &Problem, right: &Gradient, residual: f64) -> (Point, f64) {
        let mut eliminated = right.full.clone();
        let mut reduced = right.reduced.clone();
        for ((factor, coupling), part) in self
            .eliminated
            .iter()
            .zip(&self.coupling)
            .zip(&mut eliminated)
        {
            factor.solve_lower_vector(part);
            reduced -= coupling.tr_mul(&*part);
        }
        let mut solution = self.solve_reduced(reduced);
        let mut multiplier = 0.0;
        if let Some((equation, solved, square)) = &self.equation {
            multiplier = (equation.dot(&solution) - residual) / square;
            solution.axpy(-multiplier, solved, 1.0);
        }
        for ((factor, coupling), part) in self
            .eliminated
            .iter()
            .zip(&self.coupling)
            .zip(&mut eliminated)
        {
            *part -= coupling * &solution;
            factor.solve_upper_vector(part);
        }
        (problem.point(&solution, &eliminated), multiplier)
    }

    fn solve_reduced(&self, mut right: DVector<f64>) -> DVector<f64> {
        right.component_mul_assign(&self.scale);
        self.reduced.solve_lower_vector(&mut right);
        self.reduced.solve_upper_vector(&mut right);
        right.component_mul_assign(&self.scale);
        right
    }
}

impl<'a> Assembly<'a> {
    fn new(problem: &'a Problem) -> Self {
        let reduced = problem.reduced();
        let sizes = problem.full.iter().map(|&(rows, columns)| rows * columns);
        Self {
            problem,
            reduced: DMatrix::zeros(reduced, reduced),
            full: sizes
                .clone()
                .map(|size| DMatrix::zeros(size, size))
                .collect(),
            coupling: sizes.map(|size| DMatrix::zeros(size, reduced)).collect(),
            squares: vec![Vec::new(); problem.symmetric * (problem.symmetric + 1) / 2],
        }
    }

    fn add_block(&mut self, block: &Block, weight: &DMatrix<f64>) {
        let weighted: Vec<_> = block
            .congruences
            .iter()
            .map(|term| times(weight, &term.map))
            .collect();
        for (k, own) in block.congruences.iter().enumerate() {
            for (l, other) in block.congruences[..=k].iter().enumerate() {
                let sign = own.sign * other.sign;
                let square = transposed_times(&own.map, &weighted[l]);
                let (high, low) = (
                    own.unknown.max(other.unknown),
                    own.unknown.min(other.unknown),
                );
                let squares = &mut self.squares[high * (high + 1) / 2 + low];
                if high == low && k != l {
                    squares.push((sign, square.transpose()));
                }
                let turned = own.unknown < other.unknown;
                squares.push((sign, if turned { square.transpose() } else { square }));
            }
        }
        if block.product.is_some() {
            self.add_product(block, weight, &weighted);
        }
        if let Some(coefficient) = &block.scalar {
            self.add_scalar(block, coefficient, weight, &weighted);
        }
    }

    /// The unknown without structure of a block: with itself and with the symmetric unknowns.
    fn add_product(&mut self, block: &Block, weight: &DMatrix<f64>, weighted: &[DMatrix<f64>]) {
        let Some(term) = &block.product else { return };
        let weighted_left = times(weight, &term.left);
        let left = transposed_times(&term.left, &weighted_left);
        let right = transposed_times(&term.right, &times(weight, &term.right));
        let mixed = transposed_times(&term.right, &weighted_left);
        add_own(&mut self.full[term.unknown], &left, &right, &mixed);
        let coordinates = self.problem.coordinates();
        for (congruence, weighted) in block.congruences.iter().zip(weighted) {
            let to_left = transposed_times(weighted, &term.left);
            let to_right = transposed_times(&term.right, weighted);
            let first = congruence.unknown * coordinates;
            let coupling = &mut self.coupling[term.unknown];
            add_coupling(coupling, first, 2.0 * congruence.sign, &to_left, &to_right);
        }
    }

    /// The scalar unknown of a block: with itself and with all others.
    fn add_scalar(
        &mut self,
        block: &Block,
        coefficient: &DMatrix<f64>,
        weight: &DMatrix<f64>,
        weighted: &[DMatrix<f64>],
    ) {
        let last = self.problem.reduced() - 1;
        let half = times(coefficient, weight);
        self.reduced[(last, last)] += times(weight, &half).dot(coefficient);
        let mut line = vec![0.0; self.problem.coordinates()];
        for (term, weighted) in block.congruences.iter().zip(weighted) {
            let through = times(coefficient, weighted);
            write_coordinates(&transposed_times(weighted, &through), &mut line);
            let first = term.unknown * line.len();
            for (at, value) in line.iter().enumerate() {
                self.reduced[(last, first + at)] += term.sign * value;
            }
        }
        if let Some(term) = &block.product {
            let left = transposed_times(&term.left, &times(weight, &half));
            let value = 2.0 * times(&left, &term.right);
            let entries = value.transpose();
            let coupling = &mut self.coupling[term.unknown];
            for (at, value) in entries.iter().enumerate() {
                coupling[(at, last)] += value;
            }
        }
    }

    fn add_bound(&mut self, traces: &[f64], scalar: f64, ratio: f64) {
        let coordinates = self.problem.coordinates();
        let mut entries = Vec::new();
        for (index, &trace) in traces
            .iter()
            .enumerate()
            .filter(|(_, trace)| **trace != 0.0)
        {
            let first = index * coordinates;
            entries.extend((0..self.problem.order).map(|a| (first + a * (a + 1) / 2 + a, trace)));
        }
        if scalar != 0.0 {
            entries.push((self.problem.reduced() - 1, scalar));
        }
        for (at, &(row, value)) in entries.iter().enumerate() {
            for &(column, other) in &entries[..=at] {
                self.reduced[(row, column)] += ratio * value * other;
            }
        }
    }

    /// Adds the squares of all blocks, column by column.
    fn add_squares(&mut self) {
        let (order, coordinates) = (self.problem.order, self.problem.coordinates());
        let height = self.reduced.nrows();
        let entries = self.reduced.as_mut_slice();
        for high in 0..self.problem.symmetric {
            for low in 0..=high {
                let squares = &self.squares[high * (high + 1) / 2 + low];
                let mut at = 0;
                for c in 0..order {
                    for d in 0..=c {
                        let start = (low * coordinates + at) * height + high * coordinates;
                        let column = &mut entries[start..start + coordinates];
                        let from = if high == low { c } else { 0 };
                        add_column(column, squares, order, (c, d), from);
                        at += 1;
                    }
                }
            }
        }
    }

    fn factor(mut self) -> Option<Newton> {
        let mut eliminated = Vec::new();
        for (full, coupling) in self.full.drain(..).zip(&mut self.coupling) {
            let factor = regularised(full, 1e-14)?;
            factor.solve_lower(coupling);
            subtract_gram(&mut self.reduced, coupling);
            eliminated.push(factor);
        }
        let scale = self
            .reduced
            .diagonal()
            .map(|value| if value > 0.0 { 1.0 / value.sqrt() } else { 1.0 });
        for (k, mut column) in self.reduced.column_iter_mut().enumerate() {
            column.component_mul_assign(&scale);
            column.scale_mut(scale[k]);
        }
        let mut newton = Newton {
            eliminated,
            coupling: self.coupling,
            reduced: regularised(self.reduced, 1e-15)?,
            scale,
            equation: None,
        };
        if self.problem.total.is_some() {
            let trace = self.problem.trace();
            let solved = newton.solve_reduced(trace.clone());
            let square = trace.dot(&solved);
            newton.equation = Some((trace, solved, square));
        }
        Some(newton)
    }
}

/// Factors a matrix that rounding may have robbed of its definiteness, or that is singular where an
/// unknown has no effect: its diagonal is raised by a fraction `least`, and where that is not enough by
/// more, and by some of its largest entry.
fn regularised(matrix: DMatrix<f64>, least: f64) -> Option<Triangular> {
    const LARGEST: f64 = 1e-6;
    const SMALL: f64 = 1e-2;
    let largest = matrix.diagonal().amax();
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let mut raise = least;
    while raise <= LARGEST {
        let mut raised = matrix.clone();
        for k in 0..raised.nrows() {
            let floor = if raise > least { SMALL * largest } else { 0.0 };
            raised[(k, k)] += raise * (raised[(k, k)] + floor);
        }
        if let Some(factor) = Triangular::factor(raised) {
            return Some(factor);
        }
        raise *= 100.0;
    }
    None
}

/// One column of the squares: rows (a, b), `b <= a`, from row block `from` on.
fn add_column(
    column: &mut [f64],
    squares: &Squares,
    order: usize,
    (c, d): (usize, usize),
    from: usize,
) {
    let weight = if c == d { 1.0 } else { 2.0 };
    for (sign, square) in squares {
        let entries = square.as_slice();
        let left = &entries[c * order..(c + 1) * order];
        let right = &entries[d * order..(d + 1) * order];
        for a in from..order {
            let first = a * (a + 1) / 2;
            let rows = &mut column[first..=first + a];
            let (to_right, to_left) = (sign * weight * left[a], sign * weight * right[a]);
            for ((row, l), r) in rows.iter_mut().zip(left).zip(right) {
                *row += to_right * r + to_left * l;
            }
            // The diagonal coordinate stands for one entry, not for two.
            let excess = 0.5 * (to_right * right[a] + to_left * left[a]);
            rows[a] -= excess;
        }
    }
}

/// `2 (U'WU (x) V'WV + ...)` for entries (j, k) of `Y`, k fast.
fn add_own(
    full: &mut DMatrix<f64>,
    left: &DMatrix<f64>,
    right: &DMatrix<f64>,
    mixed: &DMatrix<f64>,
) {
    let (rows, columns) = (left.nrows(), right.nrows());
    for l in 0..rows {
        for i in 0..columns {
            let mut column = full.column_mut(l * columns + i);
            let column = column.as_mut_slice();
            let (right, mixed_l) = (right.column(i), mixed.column(l));
            for j in 0..rows {
                let (square, cross) = (2.0 * left[(j, l)], 2.0 * mixed[(i, j)]);
                let target = &mut column[j * columns..(j + 1) * columns];
                for ((value, v), p) in target.iter_mut().zip(right.iter()).zip(mixed_l.iter()) {
                    *value += square * v + cross * p;
                }
            }
        }
    }
}

/// The coupling of `Y` to the coordinates of one congruence: `to_left = T'WU`, `to_right = V'WT`.
fn add_coupling(
    coupling: &mut DMatrix<f64>,
    first: usize,
    factor: f64,
    to_left: &DMatrix<f64>,
    to_right: &DMatrix<f64>,
) {
    let (order, rows) = to_left.shape();
    let columns = to_right.nrows();
    let mut at = first;
    for a in 0..order {
        for b in 0..=a {
            let weight = if a == b { 0.5 * factor } else { factor };
            let mut column = coupling.column_mut(at);
            let column = column.as_mut_slice();
            let (right_a, right_b) = (to_right.column(a), to_right.column(b));
            for j in 0..rows {
                let (left_a, left_b) = (weight * to_left[(a, j)], weight * to_left[(b, j)]);
                let target = &mut column[j * columns..(j + 1) * columns];
                for ((value, x), y) in target.iter_mut().zip(right_a.iter()).zip(right_b.iter()) {
                    *value += left_b * x + left_a * y;
                }
            }
            at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior_point::{Bound, Congruence, Product};
    use proptest::prelude::*;

    fn matrices(entries: &[f64], shapes: &[(usize, usize)]) -> Vec<DMatrix<f64>> {
        let mut entries = entries.iter().copied().cycle();
        let matrix = |&(rows, columns): &(usize, usize)| {
            DMatrix::from_iterator(rows, columns, entries.by_ref().take(rows * columns))
        };
        shapes.iter().map(matrix).collect()
    }

    fn block(entries: &[f64], (first, second): (usize, usize), product: usize) -> Block {
        let shapes = [(5, 3), (5, 3), (5, 3), (5, 2), (5, 3), (5, 5)];
        let mut parts = matrices(entries, &shapes);
        let scalar = parts.swap_remove(5);
        let (right, left) = (parts.swap_remove(4), parts.swap_remove(3));
        let terms = [(first, 1.0), (second, 1.0), (first, -1.0)];
        let congruences = terms.into_iter().zip(parts);
        Block {
            constant: DMatrix::zeros(5, 5),
            congruences: congruences
                .map(|((unknown, sign), map)| Congruence { unknown, sign, map })
                .collect(),
            product: Some(Product {
                unknown: product,
                left,
                right,
            }),
            scalar: Some(&scalar + scalar.transpose()),
        }
    }

    proptest! {
        /// The factored matrix is the one that the inequalities and their adjoint define.
        #[test]
        fn the_newton_matrix_is_that_of_the_inequalities(
            entries in prop::collection::vec(-1.0..1.0f64, 400),
        ) {
            let (one, rest) = entries.split_at(83);
            let (two, rest) = rest.split_at(89);
            let (three, rest) = rest.split_at(97);
            let problem = Problem {
                order: 3,
                symmetric: 2,
                full: vec![(2, 3), (2, 3)],
                blocks: vec![block(one, (0, 1), 0), block(two, (1, 0), 1), block(three, (1, 1), 1)],
                bounds: vec![
                    Bound { constant: 0.0, traces: vec![-1.0, 0.5], scalar: 0.3 },
                    Bound { constant: 0.0, traces: vec![0.0, 0.0], scalar: -1.0 },
                ],
                total: None,
            };
            let roots = matrices(rest, &[(5, 5), (5, 5), (5, 5)]);
            let weights: Vec<_> = roots.iter()
                .map(|root| root * root.transpose() + DMatrix::identity(5, 5)).collect();
            let ratios = [0.7, 1.9];
            let wanted = {
                let parts = matrices(&rest[75..], &[(3, 3), (3, 3), (2, 3), (2, 3)]);
                Point {
                    symmetric: parts[..2].iter().map(|q| q + q.transpose()).collect(),
                    full: parts[2..].to_vec(),
                    scalar: rest[111],
                }
            };
            let pulled: Vec<_> = problem.blocks.iter().zip(&weights)
                .map(|(block, weight)| weight * block.linear(&wanted) * weight).collect();
            let bounds: Vec<_> = problem.bounds.iter().zip(ratios)
                .map(|(bound, ratio)| ratio * bound.linear(&wanted)).collect();
            let right = problem.adjoint(&pulled, &bounds);
            let newton = Newton::new(&problem, &weights.iter().collect::<Vec<_>>(), &ratios);
            prop_assume!(newton.is_some());
            let (found, _) = newton.unwrap().solve(&problem, &right, 0.0);
            let again: Vec<_> = problem.blocks.iter().map(|block| block.linear(&found)).collect();
            for (block, found) in problem.blocks.iter().zip(&again) {
                let error = (block.linear(&wanted) - found).amax();
                prop_assert!(error < 1e-5, "{error}");
            }
        }
    }
}
