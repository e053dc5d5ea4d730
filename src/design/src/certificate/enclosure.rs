//! Matrices known up to rounding: a midpoint and an entrywise bound of the error.

use nalgebra::DMatrix;
use std::ops::{Add, Mul, Sub};

/// Unit roundoff of a double.
const ROUNDOFF: f64 = f64::EPSILON / 2.0;

/// Covers what underflow can cost in one operation, generously.
const UNDERFLOW: f64 = f64::MIN_POSITIVE;

/// All matrices `X` with `|X - mid| <= rad`, entry by entry.
#[derive(Clone, Debug)]
pub struct Enclosure {
    mid: DMatrix<f64>,
    rad: DMatrix<f64>,
}

impl Enclosure {
    /// A matrix of doubles taken at their word.
    pub fn exact(mid: DMatrix<f64>) -> Self {
        let rad = DMatrix::zeros(mid.nrows(), mid.ncols());
        Self { mid, rad }
    }

    /// A matrix each entry of which carries the rounding of one product (and possible underflow).
    pub fn rounded(mid: DMatrix<f64>) -> Self {
        let rad = mid.map(|value| 2.0 * ROUNDOFF * value.abs() + 4.0 * UNDERFLOW);
        Self { mid, rad }
    }

    /// The zero matrix.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self::exact(DMatrix::zeros(rows, columns))
    }

    /// The square of a number, times the identity.
    pub fn square_times_identity(value: f64, size: usize) -> Self {
        let square = DMatrix::from_diagonal_element(size, size, value * value);
        Self::rounded(square)
    }

    /// The transposed enclosure.
    pub fn transpose(&self) -> Self {
        Self {
            mid: self.mid.transpose(),
            rad: self.rad.transpose(),
        }
    }

    /// The midpoints.
    pub fn midpoint(&self) -> &DMatrix<f64> {
        &self.mid
    }

    /// The bounds on the distance from the midpoints.
    pub fn radius(&self) -> &DMatrix<f64> {
        &self.rad
    }

    /// The midpoint, when the radius no longer matters.
    pub(crate) fn into_midpoint(self) -> DMatrix<f64> {
        self.mid
    }

    /// Contains `(X + X') / 2` for every member `X`, hence every symmetric member; its own midpoint is
    /// exactly symmetric.
    pub fn symmetric_part(&self) -> Self {
        let sum = self + &self.transpose();
        Self {
            mid: 0.5 * sum.mid,
            rad: sum.rad.map(|radius| 0.5 * radius + UNDERFLOW),
        }
    }

    /// Rows and columns.
    pub fn shape(&self) -> (usize, usize) {
        self.mid.shape()
    }

    /// The symmetric matrix with these blocks on and below its diagonal.
    pub fn symmetric_blocks(rows: &[Vec<Self>]) -> Self {
        let sizes = rows.iter().map(|row| row.last().map_or(0, |d| d.shape().0));
        let total = sizes.sum();
        let mut whole = Self::zeros(total, total);
        let mut below = 0;
        for row in rows {
            let mut right = 0;
            for block in row {
                for (into, from) in [(&mut whole.mid, &block.mid), (&mut whole.rad, &block.rad)] {
                    into.view_mut((below, right), block.shape()).copy_from(from);
                    into.view_mut((right, below), (block.shape().1, block.shape().0))
                        .copy_from(&from.transpose());
                }
                right += block.shape().1;
            }
            below += row.last().map_or(0, |diagonal| diagonal.shape().0);
        }
        whole
    }

    /// The matrix with these blocks, row by row; the blocks of a row are equally high, and every row
    /// is equally wide.
    pub fn blocks(rows: &[Vec<&Self>]) -> Self {
        let heights = rows
            .iter()
            .map(|row| row.first().map_or(0, |b| b.shape().0));
        let widths = rows
            .iter()
            .map(|row| row.iter().map(|block| block.shape().1).sum());
        let mut whole = Self::zeros(heights.sum(), widths.max().unwrap_or(0));
        let mut below = 0;
        for row in rows {
            let mut right = 0;
            for block in row {
                let at = (below, right);
                whole.mid.view_mut(at, block.shape()).copy_from(&block.mid);
                whole.rad.view_mut(at, block.shape()).copy_from(&block.rad);
                right += block.shape().1;
            }
            below += row.first().map_or(0, |block| block.shape().0);
        }
        whole
    }

    /// The rows from `first` on, `count` of them.
    pub fn rows(&self, first: usize, count: usize) -> Self {
        Self {
            mid: self.mid.rows(first, count).into_owned(),
            rad: self.rad.rows(first, count).into_owned(),
        }
    }

    /// Each row and each column multiplied by a power of two.
    pub fn in_units(&self, rows: &[f64], columns: &[f64]) -> Self {
        let scaled = |matrix: &DMatrix<f64>, floor: f64| {
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |r, c| {
                matrix[(r, c)] * (rows[r] * columns[c]) + floor
            })
        };
        Self {
            mid: scaled(&self.mid, 0.0),
            rad: scaled(&self.rad, 2.0 * UNDERFLOW),
        }
    }

    /// The negative of every member.
    pub fn negative(&self) -> Self {
        Self {
            mid: -&self.mid,
            rad: self.rad.clone(),
        }
    }

    /// Whether every symmetric matrix in the enclosure is positive definite: `true` is a proof,
    /// `false` says nothing.
    ///
    /// Floating-point Cholesky of the midpoint, shifted down by more than everything that can have
    /// gone wrong: the rounding of the factorisation itself (at most
    /// `gamma(n+1) / (1 - gamma(n+1))` times the trace, S. M. Rump, *Verification of positive
    /// definiteness*, BIT 46, 2006), underflow, and the radius (whose norm its row sums bound).
    pub fn is_positive_definite(&self) -> bool {
        let n = self.mid.nrows();
        let symmetric = n == self.mid.ncols() && self.mid == self.mid.transpose();
        let finite = self.mid.iter().chain(&self.rad).all(|v| v.is_finite());
        if !(symmetric && finite) {
            return false;
        }
        let diagonal = self.mid.diagonal();
        let largest = diagonal.amax();
        let trace: f64 = diagonal.iter().map(|value| value.abs()).sum();
        let radius = self
            .rad
            .row_iter()
            .map(|row| row.iter().sum::<f64>())
            .fold(0.0, f64::max);
        let size = n as f64;
        // Twice the bound of the rounding errors also covers those made in this very formula and in
        // subtracting the shift.
        let shift = 2.0 * (size + 3.0) * ROUNDOFF * trace
            + (1.0 + 1e-9) * radius
            + 8.0 * size * (2.0 * (size + 2.0) + largest) * UNDERFLOW;
        cholesky_succeeds(self.mid.clone(), shift)
    }
}

/// Whether the floating-point Cholesky factorisation of `a - shift I` meets positive pivots only.
fn cholesky_succeeds(mut a: DMatrix<f64>, shift: f64) -> bool {
    for column in 0..a.ncols() {
        for row in 0..=column {
            let known = a
                .view((0, row), (row, 1))
                .dot(&a.view((0, column), (row, 1)));
            if row < column {
                a[(row, column)] = (a[(row, column)] - known) / a[(row, row)];
            } else {
                let pivot = (a[(row, row)] - shift) - known;
                // Written so that a NaN fails.
                if !(pivot > 0.0 && pivot.is_finite()) {
                    return false;
                }
                a[(row, row)] = pivot.sqrt();
            }
        }
    }
    true
}

impl Mul for &Enclosure {
    type Output = Enclosure;

    /// Contains every product of members.
    fn mul(self, other: &Enclosure) -> Enclosure {
        let terms = self.mid.ncols() as f64;
        let (left, right) = (self.mid.abs(), other.mid.abs());
        let spread = &left * &other.rad + &self.rad * (&right + &other.rad);
        let rounding = (terms + 2.0) * ROUNDOFF * (left * right);
        // All summands are non-negative, so a relative inflation covers the rounding of the radius.
        let inflation = 1.0 + 8.0 * (terms + 8.0) * ROUNDOFF;
        let underflow = 4.0 * (terms + 1.0) * UNDERFLOW;
        Enclosure {
            mid: &self.mid * &other.mid,
            rad: (spread + rounding).map(|radius| inflation * radius + underflow),
        }
    }
}

impl Add for &Enclosure {
    type Output = Enclosure;

    /// Contains every sum of members.
    fn add(self, other: &Enclosure) -> Enclosure {
        let mid = &self.mid + &other.mid;
        let inflation = 1.0 + 8.0 * ROUNDOFF;
        let rad = DMatrix::from_fn(mid.nrows(), mid.ncols(), |r, c| {
            inflation * (self.rad[(r, c)] + other.rad[(r, c)] + ROUNDOFF * f64::abs(mid[(r, c)]))
        });
        Enclosure { mid, rad }
    }
}

impl Sub for &Enclosure {
    type Output = Enclosure;

    /// Contains every difference of members.
    #[allow(clippy::suspicious_arithmetic_impl)]
    fn sub(self, other: &Enclosure) -> Enclosure {
        self + &other.negative()
    }
}
