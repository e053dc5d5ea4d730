//! Unknown matrices and expressions that are affine in them.

use nalgebra::DMatrix;
use std::ops::{Add, Mul, Neg, Sub};

/// How the scalars of an unknown matrix are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// Every entry is a scalar of its own.
    Full,
    /// Square; entry (r, c) is the scalar of entry (c, r).
    Symmetric,
}

/// A handle to an unknown matrix of a [`Problem`](super::Problem).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variable {
    first: usize,
    rows: usize,
    columns: usize,
    shape: Shape,
}

impl Variable {
    /// An unknown symmetric matrix whose scalars start at `first`.
    pub(super) fn symmetric(first: usize, size: usize) -> Self {
        Self {
            first,
            rows: size,
            columns: size,
            shape: Shape::Symmetric,
        }
    }

    /// An unknown matrix without structure whose scalars start at `first`.
    pub(super) fn full(first: usize, rows: usize, columns: usize) -> Self {
        Self {
            first,
            rows,
            columns,
            shape: Shape::Full,
        }
    }

    /// Rows and columns.
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Whether entry (r, c) is the scalar of entry (c, r).
    pub(super) fn is_symmetric(&self) -> bool {
        self.shape == Shape::Symmetric
    }

    /// How many scalars it has.
    pub(super) fn count(&self) -> usize {
        match self.shape {
            Shape::Full => self.rows * self.columns,
            Shape::Symmetric => self.rows * (self.rows + 1) / 2,
        }
    }

    /// The scalar that stands at (row, column).
    pub(super) fn scalar(&self, row: usize, column: usize) -> usize {
        match self.shape {
            Shape::Full => self.first + column * self.rows + row,
            Shape::Symmetric => {
                let (low, high) = (row.min(column), row.max(column));
                self.first + high * (high + 1) / 2 + low
            }
        }
    }

    /// Its value, given all scalars of the problem.
    pub fn value(&self, scalars: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows, self.columns, |r, c| scalars[self.scalar(r, c)])
    }

    /// The expression that is this unknown alone.
    pub fn expression(&self) -> Affine {
        Affine {
            constant: DMatrix::zeros(self.rows, self.columns),
            terms: vec![Term {
                left: DMatrix::identity(self.rows, self.rows),
                variable: *self,
                transposed: false,
                right: DMatrix::identity(self.columns, self.columns),
            }],
        }
    }

    /// The expression `x I` (size x size) of an unknown scalar `x` (a 1 x 1 unknown).
    pub fn times_identity(&self, size: usize) -> Affine {
        debug_assert_eq!((self.rows, self.columns), (1, 1));
        let unit = |i: usize| DMatrix::from_fn(size, 1, |r, _| f64::from(u8::from(r == i)));
        Affine {
            constant: DMatrix::zeros(size, size),
            terms: (0..size)
                .map(|i| Term {
                    left: unit(i),
                    variable: *self,
                    transposed: false,
                    right: unit(i).transpose(),
                })
                .collect(),
        }
    }
}

/// `left X right` or `left X' right` for an unknown `X`.
#[derive(Clone, Debug, PartialEq)]
struct Term {
    left: DMatrix<f64>,
    variable: Variable,
    transposed: bool,
    right: DMatrix<f64>,
}

/// A matrix that is affine in the unknowns: a constant plus terms `L X R` and `L X' R`.
#[derive(Clone, Debug, PartialEq)]
pub struct Affine {
    constant: DMatrix<f64>,
    terms: Vec<Term>,
}

impl Affine {
    /// The zero matrix.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        DMatrix::zeros(rows, columns).into()
    }

    /// Rows and columns.
    pub fn shape(&self) -> (usize, usize) {
        self.constant.shape()
    }

    /// The transposed expression.
    pub fn transpose(&self) -> Self {
        let terms = self.terms.iter().map(|term| Term {
            left: term.right.transpose(),
            variable: term.variable,
            transposed: !term.transposed,
            right: term.left.transpose(),
        });
        Self {
            constant: self.constant.transpose(),
            terms: terms.collect(),
        }
    }

    /// The unknown this is, if it is an unknown and nothing else.
    pub(super) fn as_variable(&self) -> Option<Variable> {
        let [term] = self.terms.as_slice() else {
            return None;
        };
        let plain = *self == Self::from(&term.variable);
        plain.then_some(term.variable)
    }

    /// The terms `left X right`, or `left X' right` where the flag says so.
    pub(super) fn products(
        &self,
    ) -> impl Iterator<Item = (Variable, bool, &DMatrix<f64>, &DMatrix<f64>)> {
        let terms = self.terms.iter();
        terms.map(|term| (term.variable, term.transposed, &term.left, &term.right))
    }

    /// The constant part of entry (row, column).
    pub(super) fn constant(&self, row: usize, column: usize) -> f64 {
        self.constant[(row, column)]
    }

    /// Calls `visit(scalar, row, column, coefficient)` for every non-zero coefficient; a scalar may
    /// be visited more than once for the same entry.
    pub(super) fn for_each_coefficient(&self, mut visit: impl FnMut(usize, usize, usize, f64)) {
        for term in &self.terms {
            for i in 0..term.variable.rows {
                for j in 0..term.variable.columns {
                    let scalar = term.variable.scalar(i, j);
                    // Entry (i, j) of X multiplies column i of L and row j of R; X' swaps them.
                    let (from, to) = if term.transposed { (j, i) } else { (i, j) };
                    for (row, left) in term.left.column(from).iter().enumerate() {
                        if *left == 0.0 {
                            continue;
                        }
                        for (column, right) in term.right.row(to).iter().enumerate() {
                            if *right != 0.0 {
                                visit(scalar, row, column, left * right);
                            }
                        }
                    }
                }
            }
        }
    }

    /// Multiplies by constant matrices from both sides.
    fn between(mut self, left: &DMatrix<f64>, right: &DMatrix<f64>) -> Self {
        self.constant = left * self.constant * right;
        for term in &mut self.terms {
            term.left = left * &term.left;
            term.right = &term.right * right;
        }
        self
    }
}

impl From<DMatrix<f64>> for Affine {
    fn from(constant: DMatrix<f64>) -> Self {
        Self {
            constant,
            terms: Vec::new(),
        }
    }
}

impl From<&Variable> for Affine {
    fn from(variable: &Variable) -> Self {
        variable.expression()
    }
}

impl Add for Affine {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self.constant += other.constant;
        self.terms.extend(other.terms);
        self
    }
}

impl Sub for Affine {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Affine {
    type Output = Self;

    fn neg(self) -> Self {
        -1.0 * self
    }
}

impl Mul<Affine> for f64 {
    type Output = Affine;

    fn mul(self, mut expression: Affine) -> Affine {
        expression.constant *= self;
        for term in &mut expression.terms {
            term.left *= self;
        }
        expression
    }
}

impl Mul<Affine> for &DMatrix<f64> {
    type Output = Affine;

    fn mul(self, expression: Affine) -> Affine {
        let columns = expression.constant.ncols();
        expression.between(self, &DMatrix::identity(columns, columns))
    }
}

impl Mul<&DMatrix<f64>> for Affine {
    type Output = Affine;

    fn mul(self, right: &DMatrix<f64>) -> Affine {
        let rows = self.constant.nrows();
        self.between(&DMatrix::identity(rows, rows), right)
    }
}

impl Mul<&Variable> for &DMatrix<f64> {
    type Output = Affine;

    fn mul(self, variable: &Variable) -> Affine {
        self * variable.expression()
    }
}

impl Mul<&DMatrix<f64>> for &Variable {
    type Output = Affine;

    fn mul(self, right: &DMatrix<f64>) -> Affine {
        self.expression() * right
    }
}
