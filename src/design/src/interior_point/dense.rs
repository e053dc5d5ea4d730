//! Dense kernels at the speed of a matrix product: everything large goes through `matrixmultiply`.

use nalgebra::{DMatrix, DVector};

/// Width of the blocks of the factorisations.
const WIDTH: usize = 48;

/// Whether an operand is taken transposed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operand {
    Plain,
    Transposed,
}

/// A rectangular part of a matrix: first row, first column, rows, columns.
#[derive(Clone, Copy, Debug)]
struct Part {
    row: usize,
    column: usize,
    rows: usize,
    columns: usize,
}

impl Part {
    fn whole(matrix: &DMatrix<f64>) -> Self {
        Self {
            row: 0,
            column: 0,
            rows: matrix.nrows(),
            columns: matrix.ncols(),
        }
    }

    /// The entries of this part in a slice of columns of height `height`, up to the last one.
    fn of(self, entries: &[f64], height: usize) -> &[f64] {
        &entries[self.range(height, entries.len())]
    }

    fn range(self, height: usize, length: usize) -> core::ops::Range<usize> {
        assert!(self.row + self.rows <= height, "rows outside the matrix");
        if self.rows == 0 || self.columns == 0 {
            return 0..0;
        }
        let first = self.column * height + self.row;
        let end = first + (self.columns - 1) * height + self.rows;
        assert!(end <= length, "columns outside the matrix");
        first..end
    }
}

/// `c <- c + alpha op(a) op(b)` on slices of columns with their heights.
fn accumulate(
    (c, c_height, c_part): (&mut [f64], usize, Part),
    alpha: f64,
    (a, a_height, a_part, a_is): (&[f64], usize, Part, Operand),
    (b, b_height, b_part, b_is): (&[f64], usize, Part, Operand),
) {
    let shape = |part: Part, is: Operand| match is {
        Operand::Plain => (part.rows, part.columns),
        Operand::Transposed => (part.columns, part.rows),
    };
    let ((m, k), (k2, n)) = (shape(a_part, a_is), shape(b_part, b_is));
    assert_eq!((c_part.rows, c_part.columns, k), (m, n, k2), "shapes");
    if m == 0 || n == 0 || k == 0 {
        return;
    }
    let strides = |height: usize, is: Operand| match is {
        Operand::Plain => (1, height as isize),
        Operand::Transposed => (height as isize, 1),
    };
    let (a_row, a_column) = strides(a_height, a_is);
    let (b_row, b_column) = strides(b_height, b_is);
    let a = a_part.of(a, a_height);
    let b = b_part.of(b, b_height);
    let c_range = c_part.range(c_height, c.len());
    let c = &mut c[c_range];
    // SAFETY: `Part::range` has checked that every entry the shapes and strides reach lies in its
    // slice; `c` is borrowed alone.
    unsafe {
        matrixmultiply::dgemm(
            m,
            k,
            n,
            alpha,
            a.as_ptr(),
            a_row,
            a_column,
            b.as_ptr(),
            b_row,
            b_column,
            1.0,
            c.as_mut_ptr(),
            1,
            c_height as isize,
        );
    }
}

/// `op(a) op(b)`.
pub(super) fn product(
    (a, a_is): (&DMatrix<f64>, Operand),
    (b, b_is): (&DMatrix<f64>, Operand),
) -> DMatrix<f64> {
    let rows = if a_is == Operand::Plain {
        a.nrows()
    } else {
        a.ncols()
    };
    let columns = if b_is == Operand::Plain {
        b.ncols()
    } else {
        b.nrows()
    };
    let mut c = DMatrix::zeros(rows, columns);
    let whole = Part::whole(&c);
    accumulate(
        (c.as_mut_slice(), rows, whole),
        1.0,
        (a.as_slice(), a.nrows(), Part::whole(a), a_is),
        (b.as_slice(), b.nrows(), Part::whole(b), b_is),
    );
    c
}

/// `a b`.
pub(super) fn times(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    product((a, Operand::Plain), (b, Operand::Plain))
}

/// `a' b`.
pub(super) fn transposed_times(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    product((a, Operand::Transposed), (b, Operand::Plain))
}

/// `a x a'`, symmetric where `x` is.
pub(super) fn congruence(a: &DMatrix<f64>, x: &DMatrix<f64>) -> DMatrix<f64> {
    product((&times(a, x), Operand::Plain), (a, Operand::Transposed))
}

/// `a' x a`.
pub(super) fn transposed_congruence(a: &DMatrix<f64>, x: &DMatrix<f64>) -> DMatrix<f64> {
    transposed_times(a, &times(x, a))
}

/// The symmetric part of a square matrix.
pub(super) fn symmetric(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    for column in 0..matrix.ncols() {
        for row in column + 1..matrix.nrows() {
            let mean = 0.5 * (matrix[(row, column)] + matrix[(column, row)]);
            matrix[(row, column)] = mean;
            matrix[(column, row)] = mean;
        }
    }
    matrix
}

/// Subtracts `y' y` from the lower triangle of `c` (whole blocks on the diagonal).
pub(super) fn subtract_gram(c: &mut DMatrix<f64>, y: &DMatrix<f64>) {
    const COLUMNS: usize = 128;
    let (size, height, depth) = (c.nrows(), c.nrows(), y.nrows());
    let part = |first: usize, columns: usize| Part {
        row: 0,
        column: first,
        rows: depth,
        columns,
    };
    for first in (0..size).step_by(COLUMNS) {
        let width = COLUMNS.min(size - first);
        let target = Part {
            row: first,
            column: first,
            rows: size - first,
            columns: width,
        };
        accumulate(
            (c.as_mut_slice(), height, target),
            -1.0,
            (
                y.as_slice(),
                depth,
                part(first, size - first),
                Operand::Transposed,
            ),
            (y.as_slice(), depth, part(first, width), Operand::Plain),
        );
    }
}

/// A lower triangular factor `L` with `L L' = A`; what lies above its diagonal is not read.
pub(super) struct Triangular(DMatrix<f64>);

impl Triangular {
    /// Factors a symmetric matrix of which the lower triangle is read; `None` where it is not
    /// positive definite to working precision.
    pub fn factor(mut a: DMatrix<f64>) -> Option<Self> {
        let size = a.nrows();
        for first in (0..size).step_by(WIDTH) {
            let width = WIDTH.min(size - first);
            factor_panel(a.as_mut_slice(), size, first, width)?;
            update_behind(a.as_mut_slice(), size, first, width);
        }
        Some(Self(a))
    }

    /// The factor with zeros above its diagonal.
    pub fn lower(mut self) -> DMatrix<f64> {
        self.0.fill_upper_triangle(0.0, 1);
        self.0
    }

    /// `b <- L^-1 b` for many columns at once.
    pub fn solve_lower(&self, b: &mut DMatrix<f64>) {
        let (size, columns) = (self.0.nrows(), b.ncols());
        for first in (0..size).step_by(WIDTH) {
            let width = WIDTH.min(size - first);
            for mut column in b.column_iter_mut() {
                let column = column.as_mut_slice();
                substitute(&self.0, &mut column[first..first + width], first);
            }
            let rest = first + width;
            if rest == size {
                break;
            }
            // Rows below the block take its part off; source and target rows do not overlap, but share
            // the columns of `b`, so the source is copied.
            let solved = b.rows(first, width).into_owned();
            let target = Part {
                row: rest,
                column: 0,
                rows: size - rest,
                columns,
            };
            let left = Part {
                row: rest,
                column: first,
                rows: size - rest,
                columns: width,
            };
            accumulate(
                (b.as_mut_slice(), size, target),
                -1.0,
                (self.0.as_slice(), size, left, Operand::Plain),
                (
                    solved.as_slice(),
                    width,
                    Part::whole(&solved),
                    Operand::Plain,
                ),
            );
        }
    }

    /// `b <- L^-1 b`.
    pub fn solve_lower_vector(&self, b: &mut DVector<f64>) {
        let size = self.0.nrows();
        substitute(&self.0, &mut b.as_mut_slice()[..size], 0);
    }

    /// `b <- L'^-1 b`.
    pub fn solve_upper_vector(&self, b: &mut DVector<f64>) {
        let size = self.0.nrows();
        let entries = self.0.as_slice();
        for row in (0..size).rev() {
            let column = &entries[row * size..(row + 1) * size];
            let below: f64 = column[row + 1..]
                .iter()
                .zip(&b.as_slice()[row + 1..])
                .map(|(l, x)| l * x)
                .sum();
            b[row] = (b[row] - below) / column[row];
        }
    }
}

/// Forward substitution with the square block of `lower` whose diagonal starts at `first`.
fn substitute(lower: &DMatrix<f64>, b: &mut [f64], first: usize) {
    let (height, entries) = (lower.nrows(), lower.as_slice());
    for k in 0..b.len() {
        let start = (first + k) * height + first;
        let column = &entries[start..start + b.len()];
        let x = b[k] / column[k];
        b[k] = x;
        for (value, l) in b[k + 1..].iter_mut().zip(&column[k + 1..]) {
            *value -= l * x;
        }
    }
}

/// Factors columns `first .. first + width`, whose earlier columns have been taken off already.
fn factor_panel(a: &mut [f64], size: usize, first: usize, width: usize) -> Option<()> {
    for k in first..first + width {
        let (done, rest) = a.split_at_mut(k * size);
        let column = &mut rest[k..size];
        for j in first..k {
            let earlier = &done[j * size + k..(j + 1) * size];
            let factor = earlier[0];
            for (value, l) in column.iter_mut().zip(earlier) {
                *value -= factor * l;
            }
        }
        let pivot = column[0];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        for value in column.iter_mut() {
            *value /= root;
        }
    }
    Some(())
}

/// Takes the panel off the columns behind it.
fn update_behind(a: &mut [f64], size: usize, first: usize, width: usize) {
    let rest = first + width;
    if rest == size {
        return;
    }
    let (panel, behind) = a.split_at_mut(rest * size);
    for start in (rest..size).step_by(2 * WIDTH) {
        let columns = (2 * WIDTH).min(size - start);
        let target = Part {
            row: start,
            column: start - rest,
            rows: size - start,
            columns,
        };
        let left = Part {
            row: start,
            column: first,
            rows: size - start,
            columns: width,
        };
        let right = Part {
            row: start,
            column: first,
            rows: columns,
            columns: width,
        };
        accumulate(
            (behind, size, target),
            -1.0,
            (panel, size, left, Operand::Plain),
            (panel, size, right, Operand::Transposed),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
        let mut state = seed;
        DMatrix::from_fn(rows, columns, |_, _| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        })
    }

    #[test]
    fn the_blocked_factor_reproduces_the_matrix_and_solves_with_it() {
        for size in [1, 5, WIDTH, WIDTH + 1, 3 * WIDTH + 7] {
            let root = random(size, size + 3, 7 + size as u64);
            let a = &root * root.transpose() + DMatrix::identity(size, size);
            let factor = Triangular::factor(a.clone()).unwrap();
            let right = random(size, 5, 3);
            let mut solved = right.clone();
            factor.solve_lower(&mut solved);
            let mut whole = DVector::from_column_slice(right.column(2).as_slice());
            factor.solve_lower_vector(&mut whole);
            assert!((&whole - solved.column(2)).norm() < 1e-10);
            factor.solve_upper_vector(&mut whole);
            assert!((&a * whole - right.column(2)).norm() < 1e-9 * size as f64);
            let lower = factor.lower();
            assert!((&lower * lower.transpose() - &a).norm() < 1e-12 * a.norm() * size as f64);
            assert!((&lower * solved - right).norm() < 1e-10);
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut a = DMatrix::<f64>::identity(70, 70);
        a[(60, 60)] = -1e-3;
        assert!(Triangular::factor(a).is_none());
    }

    #[test]
    fn the_gram_matrix_is_taken_off_the_lower_triangle() {
        let y = random(9, 200, 1);
        let mut c = DMatrix::zeros(200, 200);
        subtract_gram(&mut c, &y);
        let gram = y.transpose() * &y;
        assert!((c + gram).lower_triangle().norm() < 1e-12);
    }
}
