//! Small dense algebra on rows, in a fixed order, without allocation.
//!
//! Rows that are added to each other many times are padded to a multiple of [`LANES`] with zeros: sums
//! of whole rows then need no remainder, and stay in registers.

use alloc::vec::Vec;

/// Entries of a row that are computed side by side.
pub const LANES: usize = 4;

/// The length of a padded row with `entries` entries.
pub const fn padded(entries: usize) -> usize {
    entries.next_multiple_of(LANES)
}

/// The entries other than zero of matrices that stand side by side, row after row.
#[derive(Clone, Debug)]
pub struct Sparse {
    parts: usize,
    /// Where each part of each row begins among the entries, and where the last one ends.
    starts: Vec<usize>,
    /// Column and value.
    entries: Vec<(usize, f64)>,
}

impl Sparse {
    /// From parts given row after row, each with the column at which it begins; `rows` of them.
    pub fn new<const PARTS: usize>(rows: usize, parts: [(usize, &[f64]); PARTS]) -> Self {
        let mut starts = Vec::new();
        let mut entries = Vec::new();
        for row in 0..rows {
            for (from, matrix) in parts {
                starts.push(entries.len());
                let width = matrix.len() / rows.max(1);
                let columns = (from..).zip(&matrix[row * width..(row + 1) * width]);
                entries.extend(
                    columns
                        .filter(|(_, value)| **value != 0.0)
                        .map(|(at, &value)| (at, value)),
                );
            }
        }
        starts.push(entries.len());
        Self {
            parts: PARTS,
            starts,
            entries,
        }
    }

    /// All parts of a row.
    pub fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row * self.parts]..self.starts[(row + 1) * self.parts]]
    }

    /// One part of a row.
    pub fn part(&self, row: usize, part: usize) -> &[(usize, f64)] {
        let at = row * self.parts + part;
        &self.entries[self.starts[at]..self.starts[at + 1]]
    }
}

/// Inner product with entries other than zero.
#[inline]
pub fn sparse_dot(entries: &[(usize, f64)], vector: &[f64]) -> f64 {
    let mut sum = 0.0;
    for &(at, value) in entries {
        sum += value * vector[at];
    }
    sum
}

/// Runs `$body` for each block of columns of rows that are `$width` long: `$from` is the first column of
/// the block, `$W` how many there are, known to the compiler, so that sums over them stay in registers.
macro_rules! blocks {
    ($width:expr, |$from:ident, $W:ident| $body:expr) => {{
        let mut $from = 0;
        while $from < $width {
            match $width - $from {
                4 => {
                    const $W: usize = 4;
                    $body
                }
                8 => {
                    const $W: usize = 8;
                    $body
                }
                12 => {
                    const $W: usize = 12;
                    $body
                }
                _ => {
                    const $W: usize = 16;
                    $body
                }
            }
            $from += 16;
        }
    }};
}

/// `out = sum of factor * row`, over rows of a matrix with padded rows of length `stride`, in the order
/// given.
#[inline]
pub fn combine(
    out: &mut [f64],
    matrix: &[f64],
    stride: usize,
    terms: impl Iterator<Item = (usize, f64)> + Clone,
) {
    blocks!(out.len(), |from, W| {
        let mut sums = [0.0; W];
        terms.clone().for_each(|(row, factor)| {
            if let Some(values) = matrix[row * stride + from..].first_chunk::<W>() {
                add(&mut sums, factor, values);
            }
        });
        out[from..from + W].copy_from_slice(&sums);
    });
}

/// `out += factor * vector`, for padded rows.
#[inline]
pub fn add_row(out: &mut [f64], factor: f64, vector: &[f64]) {
    blocks!(out.len(), |from, W| {
        if let Some(out) = out[from..].first_chunk_mut::<W>()
            && let Some(values) = vector[from..].first_chunk::<W>()
        {
            add(out, factor, values);
        }
    });
}

/// `matrix -= rows' rows` for the first `count` rows of a matrix and their first `width` columns; all
/// rows are padded to `stride`.
pub fn subtract_squares(
    matrix: &mut [f64],
    rows: &[f64],
    stride: usize,
    count: usize,
    width: usize,
) {
    blocks!(width, |from, W| {
        for (k, target) in matrix.chunks_exact_mut(stride).take(count).enumerate() {
            let Some(target) = target[from..].first_chunk_mut::<W>() else {
                return;
            };
            for row in rows.chunks_exact(stride) {
                if let Some(values) = row[from..].first_chunk::<W>() {
                    add(target, -row[k], values);
                }
            }
        }
    });
}

#[inline(always)]
fn add<const W: usize>(out: &mut [f64; W], factor: f64, values: &[f64; W]) {
    for (sum, value) in out.iter_mut().zip(values) {
        *sum += factor * value;
    }
}

/// `out = left right`, with `inner` columns of `left`.
pub fn multiply(out: &mut [f64], left: &[f64], right: &[f64], inner: usize) {
    out.fill(0.0);
    if inner == 0 || left.is_empty() {
        return;
    }
    let columns = right.len() / inner;
    if columns == 0 {
        return;
    }
    for (row, coefficients) in out.chunks_exact_mut(columns).zip(left.chunks_exact(inner)) {
        for (&factor, other) in coefficients.iter().zip(right.chunks_exact(columns)) {
            axpy(row, factor, other);
        }
    }
}

/// `out = left right'`, both with `inner` columns.
pub fn multiply_transposed(out: &mut [f64], left: &[f64], right: &[f64], inner: usize) {
    out.fill(0.0);
    if inner == 0 || right.is_empty() {
        return;
    }
    let columns = right.len() / inner;
    for (row, l) in out.chunks_exact_mut(columns).zip(left.chunks_exact(inner)) {
        for (value, r) in row.iter_mut().zip(right.chunks_exact(inner)) {
            *value = dot(l, r);
        }
    }
}

/// `out += factor * vector`.
#[inline]
pub fn axpy(out: &mut [f64], factor: f64, vector: &[f64]) {
    for (o, &v) in out.iter_mut().zip(vector) {
        *o += factor * v;
    }
}

/// Inner product.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (x, y) in a.iter().zip(b) {
        sum += x * y;
    }
    sum
}

/// Cholesky factor of the symmetric `s` (p x p) in its lower half, in place; false where it is not positive.
pub fn factor(s: &mut [f64], p: usize) -> bool {
    for i in 0..p {
        let (above, from) = s.split_at_mut(i * p);
        let mut own = 0.0;
        for j in 0..i {
            let other = &above[j * p..j * p + j + 1];
            let value = (from[j] - dot(&other[..j], from)) / other[j];
            from[j] = value;
            own += value * value;
        }
        let pivot = from[i] - own;
        if pivot <= 0.0 || !pivot.is_finite() {
            return false;
        }
        from[i] = libm::sqrt(pivot);
    }
    true
}

/// `x = L^-1 x` for the lower factor.
pub fn solve(lower: &[f64], p: usize, x: &mut [f64]) {
    for i in 0..p {
        let row = &lower[i * p..i * p + i + 1];
        x[i] = (x[i] - dot(&row[..i], x)) / row[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;

    proptest! {
        /// Whole padded rows give the same bits as entry after entry.
        #[test]
        fn padded_rows_add_up_as_plain_ones_do(
            entries in 1usize..40, factors in prop::collection::vec(-2.0..2.0f64, 1..6), seed in prop::collection::vec(-9.0..9.0f64, 7),
        ) {
            let stride = padded(entries);
            let value = |row: usize, column: usize| seed[(3 * row + 5 * column) % 7] * (1.0 + row as f64);
            let mut matrix = vec![0.0; factors.len() * stride];
            for row in 0..factors.len() {
                for column in 0..entries {
                    matrix[row * stride + column] = value(row, column);
                }
            }
            let (mut combined, mut added) = (vec![1.0; stride], vec![0.0; stride]);
            combine(&mut combined, &matrix, stride, factors.iter().copied().enumerate());
            for (row, &factor) in matrix.chunks_exact(stride).zip(&factors) {
                add_row(&mut added, factor, row);
            }
            let mut less = vec![0.0; 2 * stride];
            subtract_squares(&mut less, &matrix, stride, 1, stride);
            for column in 0..entries {
                let mut want = 0.0;
                for (row, factor) in factors.iter().enumerate() {
                    want += factor * value(row, column);
                }
                prop_assert_eq!([combined[column], added[column]], [want; 2]);
                let want = (0..factors.len()).fold(0.0, |sum, row| sum - value(row, 0) * value(row, column));
                prop_assert_eq!([less[column], less[stride + column]], [want, 0.0]);
            }
            prop_assert!(combined[entries..].iter().all(|v| *v == 0.0));
        }

        #[test]
        fn the_factor_times_its_transpose_is_the_matrix(p in 1usize..6, entries in prop::collection::vec(-1.0..1.0f64, 25)) {
            let square = |i: usize, j: usize| (0..p).map(|k| entries[5 * i + k] * entries[5 * j + k]).sum::<f64>() + f64::from(i == j);
            let mut s: Vec<f64> = (0..p * p).map(|at| square(at / p, at % p)).collect();
            prop_assert!(factor(&mut s, p));
            for i in 0..p {
                for j in 0..=i {
                    let got = dot(&s[i * p..=i * p + j], &s[j * p..=j * p + j]);
                    prop_assert!((got - square(i, j)).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn rows_are_kept_by_what_is_not_zero() {
        let both = Sparse::new(2, [(0, &[0.0, 2.0, 3.0, 0.0]), (5, &[0.0, 4.0])]);
        assert_eq!(both.row(0), [(1, 2.0)]);
        assert_eq!(both.row(1), [(0, 3.0), (5, 4.0)]);
        assert_eq!(both.part(1, 1), [(5, 4.0)]);
        assert_eq!(
            sparse_dot(both.row(1), &[1.0, 0.0, 0.0, 0.0, 0.0, 0.5]),
            5.0
        );
        let none = Sparse::new(0, [(0, &[])]);
        assert!(none.entries.is_empty());
    }
}
