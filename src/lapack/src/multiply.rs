//! Level-3 BLAS: `dgemm_`, `dsyrk_`, `dsyr2k_`.

use crate::view::{Triangle, letter, matrix, matrix_mut, size};
use libc::{c_char, c_int};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Dyn};

/// Whether an operand is taken as it stands (`N`) or transposed (`T`, `C`).
fn transposed(flag: u8) -> Option<bool> {
    match flag {
        b'N' => Some(false),
        b'T' | b'C' => Some(true),
        _ => None,
    }
}

/// `c <- alpha op(a) op(b) + beta c`; `beta = 0` overwrites, whatever `c` held.
fn accumulate(
    c: &mut DMatrixViewMut<f64, Dyn, Dyn>,
    alpha: f64,
    (a, a_transposed): (&DMatrixView<f64, Dyn, Dyn>, bool),
    (b, b_transposed): (&DMatrixView<f64, Dyn, Dyn>, bool),
    beta: f64,
) {
    match (a_transposed, b_transposed) {
        (false, false) => c.gemm(alpha, a, b, beta),
        (true, false) => c.gemm_tr(alpha, a, b, beta),
        (false, true) => c.gemm(alpha, a, &b.transpose(), beta),
        (true, true) => c.gemm_tr(alpha, a, &b.transpose(), beta),
    }
}

/// `C <- alpha op(A) op(B) + beta C`, `op(A)` m x k, `op(B)` k x n. An illegal argument leaves `C`
/// as it is (BLAS level 3 has no `info`).
///
/// # Safety
/// The pointers are valid for the shapes the sizes and leading dimensions describe, and `c`
/// overlaps neither `a` nor `b`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dgemm_(
    transa: *const c_char,
    transb: *const c_char,
    m: *const c_int,
    n: *const c_int,
    k: *const c_int,
    alpha: *const f64,
    a: *const f64,
    lda: *const c_int,
    b: *const f64,
    ldb: *const c_int,
    beta: *const f64,
    c: *mut f64,
    ldc: *const c_int,
) {
    unsafe {
        let (Some(a_transposed), Some(b_transposed)) =
            (transposed(letter(transa)), transposed(letter(transb)))
        else {
            return;
        };
        let (Some(m), Some(n), Some(k)) = (size(m), size(n), size(k)) else {
            return;
        };
        let (Some(lda), Some(ldb), Some(ldc)) = (size(lda), size(ldb), size(ldc)) else {
            return;
        };
        let (a_rows, a_columns) = if a_transposed { (k, m) } else { (m, k) };
        let (b_rows, b_columns) = if b_transposed { (n, k) } else { (k, n) };
        if lda < a_rows.max(1) || ldb < b_rows.max(1) || ldc < m.max(1) || m == 0 || n == 0 {
            return;
        }
        let mut c = matrix_mut(c, m, n, ldc);
        if k == 0 {
            return scale_all(&mut c, *beta);
        }
        let a = matrix(a, a_rows, a_columns, lda);
        let b = matrix(b, b_rows, b_columns, ldb);
        accumulate(
            &mut c,
            *alpha,
            (&a, a_transposed),
            (&b, b_transposed),
            *beta,
        );
    }
}

/// `c <- beta c`, an exact zero for `beta = 0`.
fn scale_all(c: &mut DMatrixViewMut<f64, Dyn, Dyn>, beta: f64) {
    if beta == 0.0 {
        c.fill(0.0);
    } else {
        *c *= beta;
    }
}

/// Adds `update` to `beta` times the stored triangle of `c`; the other triangle is not touched.
fn add_to_triangle(
    c: &mut DMatrixViewMut<f64, Dyn, Dyn>,
    triangle: Triangle,
    beta: f64,
    update: &DMatrix<f64>,
) {
    for column in 0..c.ncols() {
        for row in (0..c.nrows()).filter(|&row| triangle.holds(row, column)) {
            let old = match beta {
                0.0 => 0.0,
                _ => beta * c[(row, column)],
            };
            c[(row, column)] = old + update[(row, column)];
        }
    }
}

/// `C <- alpha A A' + beta C` (`trans = N`, A n x k) or `alpha A' A + beta C` (`trans = T`, A k x n)
/// in one triangle of `C`.
///
/// # Safety
/// As for [`dgemm_`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dsyrk_(
    uplo: *const c_char,
    trans: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const f64,
    a: *const f64,
    lda: *const c_int,
    beta: *const f64,
    c: *mut f64,
    ldc: *const c_int,
) {
    unsafe { rank_update(uplo, trans, n, k, *alpha, (a, lda), None, *beta, (c, ldc)) }
}

/// `C <- alpha (A B' + B A') + beta C` (`trans = N`, A and B n x k) or
/// `alpha (A' B + B' A) + beta C` (`trans = T`, A and B k x n) in one triangle of `C`.
///
/// # Safety
/// As for [`dgemm_`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dsyr2k_(
    uplo: *const c_char,
    trans: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: *const f64,
    a: *const f64,
    lda: *const c_int,
    b: *const f64,
    ldb: *const c_int,
    beta: *const f64,
    c: *mut f64,
    ldc: *const c_int,
) {
    unsafe {
        let b = Some((b, ldb));
        rank_update(uplo, trans, n, k, *alpha, (a, lda), b, *beta, (c, ldc))
    }
}

/// A matrix argument: its data and its leading dimension.
type Operand = (*const f64, *const c_int);

/// What [`dsyrk_`] (no `b`) and [`dsyr2k_`] have in common.
///
/// # Safety
/// As for [`dgemm_`].
#[allow(clippy::too_many_arguments)] // the Fortran argument list, grouped as far as it goes
unsafe fn rank_update(
    uplo: *const c_char,
    trans: *const c_char,
    n: *const c_int,
    k: *const c_int,
    alpha: f64,
    (a, lda): Operand,
    b: Option<Operand>,
    beta: f64,
    (c, ldc): (*mut f64, *const c_int),
) {
    unsafe {
        let (Some(triangle), Some(is_transposed)) = (
            Triangle::from_letter(letter(uplo)),
            transposed(letter(trans)),
        ) else {
            return;
        };
        let (Some(n), Some(k), Some(lda), Some(ldc)) = (size(n), size(k), size(lda), size(ldc))
        else {
            return;
        };
        let (rows, columns) = if is_transposed { (k, n) } else { (n, k) };
        if lda < rows.max(1) || ldc < n.max(1) || n == 0 {
            return;
        }
        let orient = |view: DMatrixView<f64, Dyn, Dyn>| match is_transposed {
            true => view.transpose(),
            false => view.clone_owned(),
        };
        let a = orient(matrix(a, rows, columns, lda));
        let update = match b {
            None => alpha * (&a * a.transpose()),
            Some((b, ldb)) => {
                let Some(ldb) = size(ldb).filter(|&ldb| ldb >= rows.max(1)) else {
                    return;
                };
                let half = alpha * (&a * orient(matrix(b, rows, columns, ldb)).transpose());
                &half + half.transpose()
            }
        };
        add_to_triangle(&mut matrix_mut(c, n, n, ldc), triangle, beta, &update);
    }
}
