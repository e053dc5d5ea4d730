//! Singular values by one-sided Jacobi rotations: slow for large matrices, accurate for all.
//!
//! Small singular values come out with high relative accuracy, which is what the scaling of an
//! interior-point method near its solution needs, and the number of sweeps is bounded.

use nalgebra::{DMatrix, DVector};

/// Sweeps after which the columns are orthogonal to working precision for any input seen (about
/// ten are typical); beyond, the input is declared hopeless.
const MAX_SWEEPS: usize = 60;

/// Columns shorter than this, relative to the largest entry, count as zero: their squared norm
/// would underflow.
const NEGLIGIBLE: f64 = 1e-140;

/// A thin singular value decomposition `A = U diag(s) V'` with `s` descending.
pub(crate) struct Svd {
    /// Left singular vectors, m x min(m, n).
    pub u: DMatrix<f64>,
    /// Singular values, min(m, n), descending.
    pub s: Vec<f64>,
    /// Right singular vectors transposed, min(m, n) x n.
    pub v_transposed: DMatrix<f64>,
}

/// Decomposes a finite matrix; `None` when the sweeps do not converge.
pub(crate) fn svd(a: &DMatrix<f64>) -> Option<Svd> {
    if a.nrows() < a.ncols() {
        let Svd { u, s, v_transposed } = svd(&a.transpose())?;
        return Some(Svd {
            u: v_transposed.transpose(),
            s,
            v_transposed: u.transpose(),
        });
    }
    let scale = a.amax();
    let mut columns = if scale > 0.0 { a / scale } else { a.clone() };
    let mut v = DMatrix::identity(a.ncols(), a.ncols());
    orthogonalise(&mut columns, &mut v)?;

    let norms: Vec<f64> = columns
        .column_iter()
        .map(|column| Some(column.norm()).filter(|&norm| norm > NEGLIGIBLE))
        .map(Option::unwrap_or_default)
        .collect();
    let mut order: Vec<usize> = (0..norms.len()).collect();
    order.sort_by(|&i, &j| norms[j].total_cmp(&norms[i]));
    let mut u = DMatrix::zeros(a.nrows(), a.ncols());
    for (to, &from) in order.iter().enumerate() {
        let direction = match norms[from] {
            0.0 => complement(&u, to),
            norm => columns.column(from) / norm,
        };
        u.set_column(to, &direction);
    }
    Some(Svd {
        u,
        s: order.iter().map(|&from| norms[from] * scale).collect(),
        v_transposed: v.select_columns(&order).transpose(),
    })
}

/// Rotates pairs of columns of `w` (and of `v` alike) until all are orthogonal.
fn orthogonalise(w: &mut DMatrix<f64>, v: &mut DMatrix<f64>) -> Option<()> {
    let n = w.ncols();
    // A dot product cannot be known to be smaller than its own rounding.
    let tolerance = w.nrows() as f64 * f64::EPSILON;
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let (pp, qq) = (w.column(p).norm_squared(), w.column(q).norm_squared());
                let pq = w.column(p).dot(&w.column(q));
                let negligible = pp.min(qq) <= NEGLIGIBLE * NEGLIGIBLE;
                if negligible || pq.abs() <= tolerance * pp.sqrt() * qq.sqrt() {
                    continue;
                }
                rotated = true;
                let zeta = (qq - pp) / (2.0 * pq);
                let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                rotate(w, p, q, cosine, cosine * tangent);
                rotate(v, p, q, cosine, cosine * tangent);
            }
        }
        if !rotated {
            return Some(());
        }
    }
    None
}

/// Columns `(p, q) <- (c p - s q, s p + c q)`.
fn rotate(w: &mut DMatrix<f64>, p: usize, q: usize, cosine: f64, sine: f64) {
    let rows = w.nrows();
    let (head, tail) = w.as_mut_slice().split_at_mut(q * rows);
    for (x, y) in head[p * rows..(p + 1) * rows].iter_mut().zip(tail) {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    }
}

/// A unit vector orthogonal to the first `count` columns of `u` (which are orthonormal).
fn complement(u: &DMatrix<f64>, count: usize) -> DVector<f64> {
    let basis = u.columns(0, count);
    let candidate = |axis: usize| {
        let mut vector = DVector::zeros(u.nrows());
        vector[axis] = 1.0;
        for _ in 0..2 {
            vector -= basis * basis.tr_mul(&vector);
        }
        vector
    };
    (0..u.nrows())
        .map(candidate)
        .max_by(|x, y| x.norm().total_cmp(&y.norm()))
        .map_or_else(|| DVector::zeros(0), |best| best.normalize())
}
