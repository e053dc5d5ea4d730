//! The few vector operations of the on-line path: contiguous slices, no allocation, no panic.
//!
//! Sums run column by column in a fixed order, so a result depends on its inputs alone.

use crate::matrix::Matrix;

/// The largest magnitude any on-line quantity may take; far beyond physics, far below overflow.
pub const LARGEST: f64 = 1e100;

/// `value` forced into the finite range `[-LARGEST, LARGEST]`; not-a-number becomes zero.
///
/// Magnitudes below the smallest normal number become zero too: a state that decays for ever
/// would otherwise end in denormals, which are several times slower to compute with.
#[inline]
pub fn bounded(value: f64) -> f64 {
    if value.is_nan() || value.abs() < f64::MIN_POSITIVE {
        0.0
    } else {
        value.clamp(-LARGEST, LARGEST)
    }
}

/// Applies [`bounded`] to every entry.
#[inline]
pub fn bound(values: &mut [f64]) {
    for value in values {
        *value = bounded(*value);
    }
}

/// The change of a bounded `value` that would change by `change`: none at a bound.
pub fn bounded_change(value: f64, change: f64) -> f64 {
    if value.abs() < LARGEST { change } else { 0.0 }
}

/// `out += matrix * vector`.
pub fn add_product(out: &mut [f64], matrix: &Matrix, vector: &[f64]) {
    let rows = matrix.nrows();
    match rows {
        1 if out.len() >= rows => add_few::<1>(out, matrix, vector),
        2 if out.len() >= rows => add_few::<2>(out, matrix, vector),
        3 if out.len() >= rows => add_few::<3>(out, matrix, vector),
        4 if out.len() >= rows => add_few::<4>(out, matrix, vector),
        _ => {
            for (column, &factor) in matrix.columns().zip(vector) {
                add_scaled(out, factor, column);
            }
        }
    }
}

/// The same for a matrix of few rows: the sums stay in registers.
fn add_few<const ROWS: usize>(out: &mut [f64], matrix: &Matrix, vector: &[f64]) {
    let Some(out) = out.first_chunk_mut::<ROWS>() else {
        return;
    };
    let mut sums = *out;
    add_columns(&mut sums, matrix, vector);
    *out = sums;
}

/// `sums += matrix * vector` for a matrix of `ROWS` rows.
#[inline]
fn add_columns<const ROWS: usize>(sums: &mut [f64; ROWS], matrix: &Matrix, vector: &[f64]) {
    for (column, factor) in matrix.as_slice().as_chunks::<ROWS>().0.iter().zip(vector) {
        for (sum, value) in sums.iter_mut().zip(column) {
            *sum += factor * value;
        }
    }
}

/// `out = start + matrix * vector`.
pub fn affine(out: &mut [f64], start: &[f64], matrix: &Matrix, vector: &[f64]) {
    affine_sum(out, start, [(matrix, vector)]);
}

/// `out = start + matrix_1 * vector_1 + matrix_2 * vector_2 + ...`, summed in this order.
#[inline]
pub fn affine_sum<const K: usize>(out: &mut [f64], start: &[f64], terms: [(&Matrix, &[f64]); K]) {
    match out.len() {
        1 => affine_few::<1, K>(out, start, terms),
        2 => affine_few::<2, K>(out, start, terms),
        3 => affine_few::<3, K>(out, start, terms),
        4 => affine_few::<4, K>(out, start, terms),
        _ => {
            copy(out, start);
            for (matrix, vector) in terms {
                add_product(out, matrix, vector);
            }
        }
    }
}

/// The same for few rows: the sums stay in registers.
#[inline]
fn affine_few<const ROWS: usize, const K: usize>(
    out: &mut [f64],
    start: &[f64],
    terms: [(&Matrix, &[f64]); K],
) {
    let (Some(out), Some(start)) = (out.first_chunk_mut::<ROWS>(), start.first_chunk::<ROWS>())
    else {
        return;
    };
    let mut sums = *start;
    for (matrix, vector) in terms {
        if matrix.nrows() == ROWS {
            add_columns(&mut sums, matrix, vector);
        }
    }
    *out = sums;
}

/// `out += factor * vector`.
pub fn add_scaled(out: &mut [f64], factor: f64, vector: &[f64]) {
    for (sum, &value) in out.iter_mut().zip(vector) {
        *sum += factor * value;
    }
}

/// `matrix -= scale * vector vector'`, for a square matrix kept row after row.
///
/// The product of two entries is taken before the factor, so a symmetric matrix stays symmetric
/// to the last bit: under forgetting, an asymmetry would grow without end.
pub fn subtract_square(matrix: &mut [f64], scale: f64, vector: &[f64]) {
    for (row, &left) in matrix.chunks_exact_mut(vector.len().max(1)).zip(vector) {
        for (value, &right) in row.iter_mut().zip(vector) {
            *value -= scale * (left * right);
        }
    }
}

/// `out = left - right`.
pub fn difference(out: &mut [f64], left: &[f64], right: &[f64]) {
    for ((result, &l), &r) in out.iter_mut().zip(left).zip(right) {
        *result = l - r;
    }
}

/// Copies as many entries as both hold.
#[inline]
pub fn copy(out: &mut [f64], source: &[f64]) {
    for (to, &from) in out.iter_mut().zip(source) {
        *to = from;
    }
}

/// Inner product.
pub fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(l, r)| l * r).sum()
}

/// Inner products of four vectors with another one, each in four sums side by side, for long vectors: no
/// addition waits for the one before it. Their order is fixed too. All have `right`'s length, a multiple
/// of four.
///
/// In pairs, as the processor's registers hold them: of four in one array the compiler may make one, two
/// and one, which takes a quarter more instructions.
pub fn four_dots(left: [&[f64]; 4], right: &[f64]) -> [f64; 4] {
    let [a, b, c, d] = left.map(fours);
    let mut sums = [[[0.0; 2]; 2]; 4];
    let left = a.iter().zip(b).zip(c.iter().zip(d));
    for (((a, b), (c, d)), right) in left.zip(fours(right)) {
        add_pairs(&mut sums[0], a, right);
        add_pairs(&mut sums[1], b, right);
        add_pairs(&mut sums[2], c, right);
        add_pairs(&mut sums[3], d, right);
    }
    totals(sums)
}

/// Four entries as two pairs.
type Four = [[f64; 2]; 2];

fn fours(vector: &[f64]) -> &[Four] {
    vector.as_chunks().0.as_chunks().0
}

fn add_pairs(sums: &mut Four, left: &Four, right: &Four) {
    for (sum, (left, right)) in sums.iter_mut().zip(left.iter().zip(right)) {
        for (sum, (l, r)) in sum.iter_mut().zip(left.iter().zip(right)) {
            *sum += l * r;
        }
    }
}

/// Apart, so that the sums before it are not interleaved for its sake.
#[inline(never)]
fn totals(sums: [Four; 4]) -> [f64; 4] {
    sums.map(|[[a, b], [c, d]]| (a + c) + (b + d))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn products_agree_with_nalgebra(
            rows in 1usize..7, columns in 0usize..7,
            entries in prop::collection::vec(-10.0..10.0f64, 49), x in prop::collection::vec(-10.0..10.0f64, 7),
        ) {
            let matrix = DMatrix::from_fn(rows, columns, |r, c| entries[7 * r + c]);
            let vector = &x[..columns];
            let mut out = vec![1.0; rows];
            let plain = Matrix::from_fn(rows, columns, |r, c| matrix[(r, c)]);
            add_product(&mut out, &plain, vector);
            let expected = DVector::repeat(rows, 1.0) + &matrix * DVector::from_column_slice(vector);
            for (got, want) in out.iter().zip(expected.iter()) {
                prop_assert!((got - want).abs() <= 1e-12 * (1.0 + want.abs()));
            }
        }

        #[test]
        fn four_products_are_products(groups in 0usize..9, seed in prop::collection::vec(-10.0..10.0f64, 11)) {
            let vector = |k: usize| (0..4 * groups).map(|at| seed[(3 * at + k) % 11]).collect::<Vec<f64>>();
            let (left, right) = ([0, 1, 2, 3].map(vector), vector(4));
            let four = four_dots(left.each_ref().map(Vec::as_slice), &right);
            for (one, left) in four.into_iter().zip(&left) {
                prop_assert!((one - dot(left, &right)).abs() <= 1e-11);
            }
        }

        /// Few rows are added up in registers, to the same bits.
        #[test]
        fn few_rows_are_added_up_as_many_are(
            rows in 0usize..7, room in 0usize..3, entries in prop::collection::vec(-10.0..10.0f64, 42), x in prop::collection::vec(-10.0..10.0f64, 6),
        ) {
            let matrix = Matrix::from_fn(rows, 6, |r, c| entries[6 * r + c]);
            let mut out = vec![0.5; rows + room];
            let mut wanted = out.clone();
            add_product(&mut out, &matrix, &x);
            for (column, factor) in matrix.columns().zip(x) {
                add_scaled(&mut wanted, factor, column);
            }
            prop_assert_eq!(out, wanted);
        }

        /// Several products in one are those one after the other, to the same bits.
        #[test]
        fn a_sum_of_products_is_the_products(
            rows in 0usize..7, entries in prop::collection::vec(-10.0..10.0f64, 42), x in prop::collection::vec(-10.0..10.0f64, 6),
        ) {
            let matrix = |from: usize| Matrix::from_fn(rows, 3, |r, c| entries[6 * r + from + c]);
            let (first, second, start) = (matrix(0), matrix(3), vec![0.5; rows]);
            let (left, right) = x.split_at(3);
            let (mut found, mut wanted) = (vec![7.0; rows], vec![7.0; rows]);
            affine_sum(&mut found, &start, [(&first, left), (&second, right)]);
            copy(&mut wanted, &start);
            add_product(&mut wanted, &first, left);
            add_product(&mut wanted, &second, right);
            prop_assert_eq!(found, wanted);
        }

        #[test]
        fn bounded_is_finite_for_every_bit_pattern(bits: u64) {
            let value = bounded(f64::from_bits(bits));
            prop_assert!(value.is_finite() && !value.is_subnormal() && value.abs() <= LARGEST);
        }
    }
}
