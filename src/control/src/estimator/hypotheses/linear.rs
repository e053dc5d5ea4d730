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

/// Columns and values of a row's entries other than zero.
pub type Entries = Vec<(usize, f64)>;

/// The entries other than zero of matrices that stand side by side.
#[derive(Clone, Debug)]
pub struct Sparse<const PARTS: usize> {
    /// Of each row all of them, then those of each matrix.
    rows: Vec<(Entries, [Entries; PARTS])>,
}

impl<const PARTS: usize> Sparse<PARTS> {
    /// From matrices of so many `rows`, row after row, each with the column at which it begins.
    pub fn new(rows: usize, parts: [(usize, &[f64]); PARTS]) -> Self {
        let row = |row: usize| {
            let each = parts.map(|(from, matrix)| {
                let width = matrix.len() / rows;
                let entries = (from..).zip(matrix[row * width..(row + 1) * width].iter().copied());
                entries
                    .filter(|(_, value)| *value != 0.0)
                    .collect::<Entries>()
            });
            (each.iter().flatten().copied().collect(), each)
        };
        Self {
            rows: (0..rows).map(row).collect(),
        }
    }

    /// The entries of a row.
    pub fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.rows[row].0
    }

    /// The entries of a row, matrix by matrix.
    pub fn parts(&self, row: usize) -> &[Entries; PARTS] {
        &self.rows[row].1
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
        let targets = |matrix: &mut [f64], rows: &[f64]| {
            let (left, right) = rows.split_at(stride);
            let Some(a) = left[from..].first_chunk::<W>() else {
                return;
            };
            // Two rows at a time: the entries of the matrix are loaded and stored half as often.
            let b = right.get(from..).and_then(|right| right.first_chunk::<W>());
            let targets = matrix.chunks_exact_mut(stride).take(count).zip(left);
            if let Some(b) = b {
                for ((target, l), r) in targets.zip(right) {
                    if let Some(target) = target[from..].first_chunk_mut::<W>() {
                        add(target, -l, a);
                        add(target, -r, b);
                    }
                }
            } else {
                for (target, l) in targets {
                    if let Some(target) = target[from..].first_chunk_mut::<W>() {
                        add(target, -l, a);
                    }
                }
            }
        };
        rows.chunks(2 * stride)
            .for_each(|rows| targets(matrix, rows));
    });
}

/// Rows `from..until` of a symmetric matrix get their first `columns` entries from the rows above, which
/// are padded to `stride`; `columns` are at most `from`.
pub fn mirror(matrix: &mut [f64], stride: usize, from: usize, until: usize, columns: usize) {
    let (above, below) = matrix.split_at_mut(from * stride);
    let above = above.chunks_exact(stride).take(columns);
    let mut at = from;
    for rows in below[..(until - from) * stride].chunks_mut(LANES * stride) {
        if rows.len() == LANES * stride {
            let (first, last) = rows.split_at_mut(2 * stride);
            let ((a, b), (c, d)) = (first.split_at_mut(stride), last.split_at_mut(stride));
            let four = a.iter_mut().zip(b).zip(c.iter_mut().zip(d));
            for (((a, b), (c, d)), source) in four.zip(above.clone()) {
                if let Some(&[w, x, y, z]) = source[at..].first_chunk::<LANES>() {
                    (*a, *b, *c, *d) = (w, x, y, z);
                }
            }
        } else {
            for (at, row) in (at..).zip(rows.chunks_exact_mut(stride)) {
                for (to, source) in row.iter_mut().zip(above.clone()) {
                    *to = source[at];
                }
            }
        }
        at += LANES;
    }
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

/// `(c x + s y, c y - s x)`, entry by entry of padded rows.
#[inline]
pub fn turn((c, s): (f64, f64), left: &mut [f64], right: &mut [f64]) {
    blocks!(left.len(), |from, W| {
        if let Some(left) = left[from..].first_chunk_mut::<W>()
            && let Some(right) = right[from..].first_chunk_mut::<W>()
        {
            for (left, right) in left.iter_mut().zip(right) {
                let (x, y) = (*left, *right);
                *left = c * x + s * y;
                *right = c * y - s * x;
            }
        }
    });
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
        fn rows_get_their_first_entries_from_the_rows_above(entries in 1usize..30, from in 0usize..30) {
            let (from, stride) = (from.min(entries), padded(entries));
            let before: Vec<f64> = (0..entries * stride).map(|at| at as f64).collect();
            let mut after = before.clone();
            mirror(&mut after, stride, from, entries, from);
            for (at, value) in after.iter().enumerate() {
                let (row, column) = (at / stride, at % stride);
                let mirrored = row >= from && column < from;
                prop_assert_eq!(*value, before[if mirrored { column * stride + row } else { at }]);
            }
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
        assert_eq!(both.parts(1)[1], [(5, 4.0)]);
        assert_eq!(
            sparse_dot(both.row(1), &[1.0, 0.0, 0.0, 0.0, 0.0, 0.5]),
            5.0
        );
        assert!(Sparse::new(0, [(0, &[])]).rows.is_empty());
    }
}
