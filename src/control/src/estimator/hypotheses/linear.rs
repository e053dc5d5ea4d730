//! Small dense algebra on rows, in a fixed order, without allocation.

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
        for j in 0..=i {
            let (above, from) = s.split_at_mut(i * p);
            let sum = if i == j {
                from[i] - dot(&from[..i], &from[..i])
            } else {
                (from[j] - dot(&from[..j], &above[j * p..j * p + j])) / above[j * p + j]
            };
            if i == j {
                if sum <= 0.0 || !sum.is_finite() {
                    return false;
                }
                from[i] = libm::sqrt(sum);
            } else {
                from[j] = sum;
            }
        }
    }
    true
}

/// `x = L^-1 x` for the lower factor.
pub fn solve(lower: &[f64], p: usize, x: &mut [f64]) {
    for i in 0..p {
        let row = &lower[i * p..i * p + i];
        x[i] = (x[i] - dot(row, &x[..i])) / lower[i * p + i];
    }
}
