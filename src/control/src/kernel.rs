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
pub fn bounded(value: f64) -> f64 {
    if value.is_nan() || value.abs() < f64::MIN_POSITIVE {
        0.0
    } else {
        value.clamp(-LARGEST, LARGEST)
    }
}

/// Applies [`bounded`] to every entry.
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
    for (column, &factor) in matrix.columns().zip(vector) {
        add_scaled(out, factor, column);
    }
}

/// `out = start + matrix * vector`.
pub fn affine(out: &mut [f64], start: &[f64], matrix: &Matrix, vector: &[f64]) {
    copy(out, start);
    add_product(out, matrix, vector);
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
pub fn copy(out: &mut [f64], source: &[f64]) {
    for (to, &from) in out.iter_mut().zip(source) {
        *to = from;
    }
}

/// Inner product.
pub fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(l, r)| l * r).sum()
}

/// Inner product in four sums side by side, for long vectors: no addition waits for the one before
/// it. Its order is fixed too.
pub fn long_dot(left: &[f64], right: &[f64]) -> f64 {
    let (left, left_rest) = left.as_chunks::<4>();
    let (right, right_rest) = right.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (l, r) in left.iter().zip(right) {
        for (sum, (l, r)) in sums.iter_mut().zip(l.iter().zip(r)) {
            *sum += l * r;
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + dot(left_rest, right_rest)
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
        fn a_long_product_is_a_product(pairs in prop::collection::vec((-10.0..10.0f64, -10.0..10.0f64), 0..40)) {
            let (left, right): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
            let (long, plain) = (long_dot(&left, &right), dot(&left, &right));
            prop_assert!((long - plain).abs() <= 1e-11);
        }

        #[test]
        fn bounded_is_finite_for_every_bit_pattern(bits: u64) {
            let value = bounded(f64::from_bits(bits));
            prop_assert!(value.is_finite() && !value.is_subnormal() && value.abs() <= LARGEST);
        }
    }
}
