//! The problem: linear matrix inequalities whose symmetric unknowns enter by signed congruences.

use super::dense::Operand::{Plain, Transposed};
use super::dense::{
    congruence, product, symmetric, times, transposed_congruence, transposed_times,
};
use nalgebra::{DMatrix, DVector};

/// `sign T Q T'`.
#[derive(Clone, Debug)]
pub(crate) struct Congruence {
    /// Which symmetric unknown `Q` is.
    pub unknown: usize,
    /// `+1` or `-1`.
    pub sign: f64,
    /// `T` (size x order).
    pub map: DMatrix<f64>,
}

/// `U Y V' + V Y' U'`.
#[derive(Clone, Debug)]
pub(crate) struct Product {
    /// Which unknown without structure `Y` is.
    pub unknown: usize,
    /// `U` (size x rows of `Y`).
    pub left: DMatrix<f64>,
    /// `V` (size x columns of `Y`).
    pub right: DMatrix<f64>,
}

/// `constant + congruences + product + x scalar`, to be positive semidefinite.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Symmetric (size x size).
    pub constant: DMatrix<f64>,
    /// How the symmetric unknowns enter.
    pub congruences: Vec<Congruence>,
    /// How one of the unknowns without structure enters.
    pub product: Option<Product>,
    /// How the scalar unknown `x` enters: symmetric (size x size).
    pub scalar: Option<DMatrix<f64>>,
}

/// `constant + sum_q traces[q] tr Q_q + scalar x >= 0`.
#[derive(Clone, Debug)]
pub(crate) struct Bound {
    pub constant: f64,
    /// One coefficient per symmetric unknown.
    pub traces: Vec<f64>,
    pub scalar: f64,
}

/// Maximise the scalar unknown `x` subject to all blocks, bounds and, if given, `sum_q tr Q_q = total`.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    /// Rows of every symmetric unknown.
    pub order: usize,
    /// How many symmetric unknowns there are.
    pub symmetric: usize,
    /// Rows and columns of each unknown without structure.
    pub full: Vec<(usize, usize)>,
    pub blocks: Vec<Block>,
    pub bounds: Vec<Bound>,
    /// What the traces of the symmetric unknowns add up to.
    pub total: Option<f64>,
}

/// A value of the unknowns, or a direction.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    pub symmetric: Vec<DMatrix<f64>>,
    pub full: Vec<DMatrix<f64>>,
    pub scalar: f64,
}

/// A linear functional of the unknowns in coordinates.
pub(super) struct Gradient {
    /// Coordinates of the symmetric unknowns, one after the other, then the scalar.
    pub reduced: DVector<f64>,
    /// Entries of each unknown without structure, row by row.
    pub full: Vec<DVector<f64>>,
}

impl Gradient {
    /// The largest coordinate.
    pub fn amax(&self) -> f64 {
        let full = self.full.iter().map(DVector::amax);
        full.fold(self.reduced.amax(), f64::max)
    }
}

impl Point {
    /// `self + step direction`.
    pub fn advance(&mut self, step: f64, direction: &Self) {
        for (value, change) in self.symmetric.iter_mut().zip(&direction.symmetric) {
            *value += step * change;
        }
        for (value, change) in self.full.iter_mut().zip(&direction.full) {
            *value += step * change;
        }
        self.scalar += step * direction.scalar;
    }
}

impl Block {
    /// Number of rows.
    pub fn size(&self) -> usize {
        self.constant.nrows()
    }

    /// The part that is linear in the unknowns.
    pub fn linear(&self, point: &Point) -> DMatrix<f64> {
        let size = self.size();
        let mut value = DMatrix::zeros(size, size);
        for term in &self.congruences {
            value += term.sign * congruence(&term.map, &point.symmetric[term.unknown]);
        }
        if let Some(term) = &self.product {
            let half = times(&term.left, &point.full[term.unknown]);
            let half = product((&half, Plain), (&term.right, Transposed));
            value += &half;
            value += half.transpose();
        }
        if let Some(coefficient) = &self.scalar {
            value += point.scalar * coefficient;
        }
        symmetric(value)
    }
}

impl Bound {
    pub fn linear(&self, point: &Point) -> f64 {
        let traces = self.traces.iter().zip(&point.symmetric);
        traces.map(|(c, q)| c * q.trace()).sum::<f64>() + self.scalar * point.scalar
    }
}

impl Problem {
    /// Coordinates of one symmetric unknown: entries (a, b), b <= a, row by row.
    pub fn coordinates(&self) -> usize {
        self.order * (self.order + 1) / 2
    }

    /// Coordinates that are left once the unknowns without structure are eliminated.
    pub fn reduced(&self) -> usize {
        self.symmetric * self.coordinates() + 1
    }

    /// Rows of all blocks and bounds.
    pub fn rows(&self) -> usize {
        self.blocks.iter().map(Block::size).sum::<usize>() + self.bounds.len()
    }

    /// What `blocks`, `bounds` (multipliers) make of each coordinate of the unknowns.
    pub(super) fn adjoint(&self, blocks: &[DMatrix<f64>], bounds: &[f64]) -> Gradient {
        let order = self.order;
        let mut matrices = vec![DMatrix::zeros(order, order); self.symmetric];
        let mut full: Vec<DMatrix<f64>> = self
            .full
            .iter()
            .map(|&(r, c)| DMatrix::zeros(r, c))
            .collect();
        let mut scalar = 0.0;
        for (block, multiplier) in self.blocks.iter().zip(blocks) {
            for term in &block.congruences {
                matrices[term.unknown] += term.sign * transposed_congruence(&term.map, multiplier);
            }
            if let Some(term) = &block.product {
                let half = transposed_times(&term.left, multiplier);
                full[term.unknown] += 2.0 * times(&half, &term.right);
            }
            if let Some(coefficient) = &block.scalar {
                scalar += coefficient.dot(multiplier);
            }
        }
        for (bound, multiplier) in self.bounds.iter().zip(bounds) {
            for (matrix, coefficient) in matrices.iter_mut().zip(&bound.traces) {
                for i in 0..order {
                    matrix[(i, i)] += coefficient * multiplier;
                }
            }
            scalar += bound.scalar * multiplier;
        }
        let mut reduced = DVector::zeros(self.reduced());
        for (index, matrix) in matrices.iter().enumerate() {
            let first = index * self.coordinates();
            write_coordinates(matrix, &mut reduced.as_mut_slice()[first..]);
        }
        reduced[self.reduced() - 1] = scalar;
        Gradient {
            reduced,
            full: full.iter().map(by_rows).collect(),
        }
    }

    /// The point with these coordinates.
    pub(super) fn point(&self, reduced: &DVector<f64>, full: &[DVector<f64>]) -> Point {
        let symmetric = (0..self.symmetric).map(|index| {
            let first = index * self.coordinates();
            matrix_of(&reduced.as_slice()[first..], self.order)
        });
        let full = self.full.iter().zip(full);
        Point {
            symmetric: symmetric.collect(),
            full: full
                .map(|(&(rows, columns), entries)| {
                    DMatrix::from_row_slice(rows, columns, entries.as_slice())
                })
                .collect(),
            scalar: reduced[self.reduced() - 1],
        }
    }

    /// The coefficients of `sum_q tr Q_q` on the reduced coordinates.
    pub(super) fn trace(&self) -> DVector<f64> {
        let mut trace = DVector::zeros(self.reduced());
        for index in 0..self.symmetric {
            for a in 0..self.order {
                trace[index * self.coordinates() + a * (a + 1) / 2 + a] = 1.0;
            }
        }
        trace
    }
}

/// The derivative along each coordinate of what is linear with the symmetric matrix `gradient`: a
/// coordinate off the diagonal stands for two entries.
pub(super) fn write_coordinates(gradient: &DMatrix<f64>, coordinates: &mut [f64]) {
    let mut at = 0;
    for a in 0..gradient.nrows() {
        for b in 0..=a {
            coordinates[at] = if a == b {
                gradient[(a, a)]
            } else {
                gradient[(a, b)] + gradient[(b, a)]
            };
            at += 1;
        }
    }
}

fn matrix_of(coordinates: &[f64], order: usize) -> DMatrix<f64> {
    DMatrix::from_fn(order, order, |r, c| {
        let (a, b) = (r.max(c), r.min(c));
        coordinates[a * (a + 1) / 2 + b]
    })
}

fn by_rows(matrix: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(matrix.len(), matrix.transpose().iter().copied())
}
