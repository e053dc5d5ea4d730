//! LAPACK: `dpotrf_`, `dpotrs_`, `dsyevr_`, `dgesdd_`, `dgesvd_`.

use crate::jacobi;
use crate::view::{Triangle, letter, matrix, matrix_mut, size};
use libc::{c_char, c_int};
use nalgebra::{DMatrix, SymmetricEigen};

/// What a routine reports through `info`: 0, or the code to hand over.
type Info = Result<(), c_int>;

/// Writes the outcome where Fortran expects it.
unsafe fn report(info: *mut c_int, outcome: Info) {
    unsafe { *info = outcome.err().unwrap_or(0) }
}

/// A size argument, or `info = -position`.
unsafe fn checked(argument: *const c_int, position: c_int) -> Result<usize, c_int> {
    unsafe { size(argument) }.ok_or(-position)
}

/// A leading dimension of at least `max(1, rows)`, or `info = -position`.
unsafe fn leading(argument: *const c_int, rows: usize, position: c_int) -> Result<usize, c_int> {
    unsafe { size(argument) }
        .filter(|&lead| lead >= rows.max(1))
        .ok_or(-position)
}

/// The size of an index as Fortran writes it.
fn fortran(size: usize) -> c_int {
    c_int::try_from(size).unwrap_or(c_int::MAX)
}

/// Cholesky factor `A = U'U` (`uplo = U`) or `LL'` (`uplo = L`) in place.
/// `info = i > 0`: the leading minor of order `i` is not positive definite (or not a number).
///
/// # Safety
/// The pointers are valid for an n x n matrix with leading dimension `lda`.
#[cfg_attr(feature = "symbols", unsafe(no_mangle))]
pub unsafe extern "C" fn dpotrf_(
    uplo: *const c_char,
    n: *const c_int,
    a: *mut f64,
    lda: *const c_int,
    info: *mut c_int,
) {
    unsafe { report(info, potrf(uplo, n, a, lda)) }
}

unsafe fn potrf(uplo: *const c_char, n: *const c_int, a: *mut f64, lda: *const c_int) -> Info {
    unsafe {
        let triangle = Triangle::from_letter(letter(uplo)).ok_or(-1)?;
        let n = checked(n, 2)?;
        let lda = leading(lda, n, 4)?;
        let mut a = matrix_mut(a, n, n, lda);
        // Work on the upper factor by columns: each dot product runs over contiguous memory.
        let mut factor = triangle.symmetric(&a.as_view());
        let outcome = upper_cholesky(&mut factor);
        for column in 0..n {
            for row in 0..=column {
                match triangle {
                    Triangle::Upper => a[(row, column)] = factor[(row, column)],
                    Triangle::Lower => a[(column, row)] = factor[(row, column)],
                }
            }
        }
        outcome
    }
}

/// Overwrites the upper triangle of a symmetric matrix by `U` with `A = U'U`.
fn upper_cholesky(a: &mut DMatrix<f64>) -> Info {
    for column in 0..a.ncols() {
        for row in 0..column {
            let known = a
                .view((0, row), (row, 1))
                .dot(&a.view((0, column), (row, 1)));
            a[(row, column)] = (a[(row, column)] - known) / a[(row, row)];
        }
        let pivot = a[(column, column)] - a.view((0, column), (column, 1)).norm_squared();
        // Written so that a NaN fails as well.
        if !(pivot > 0.0 && pivot.is_finite()) {
            a[(column, column)] = pivot;
            return Err(fortran(column + 1));
        }
        a[(column, column)] = pivot.sqrt();
    }
    Ok(())
}

/// Solves `A X = B` from the factor of [`dpotrf_`]; `B` (n x nrhs) is overwritten by `X`.
///
/// # Safety
/// The pointers are valid for the shapes the sizes and leading dimensions describe.
#[cfg_attr(feature = "symbols", unsafe(no_mangle))]
pub unsafe extern "C" fn dpotrs_(
    uplo: *const c_char,
    n: *const c_int,
    nrhs: *const c_int,
    a: *const f64,
    lda: *const c_int,
    b: *mut f64,
    ldb: *const c_int,
    info: *mut c_int,
) {
    unsafe { report(info, potrs(uplo, n, nrhs, (a, lda), (b, ldb))) }
}

unsafe fn potrs(
    uplo: *const c_char,
    n: *const c_int,
    nrhs: *const c_int,
    (a, lda): (*const f64, *const c_int),
    (b, ldb): (*mut f64, *const c_int),
) -> Info {
    unsafe {
        let triangle = Triangle::from_letter(letter(uplo)).ok_or(-1)?;
        let (n, columns) = (checked(n, 2)?, checked(nrhs, 3)?);
        let (lda, ldb) = (leading(lda, n, 5)?, leading(ldb, n, 7)?);
        let a = matrix(a, n, n, lda);
        // Entry (row, column) of U, wherever it is stored.
        let u = |row: usize, column: usize| match triangle {
            Triangle::Upper => a[(row, column)],
            Triangle::Lower => a[(column, row)],
        };
        let mut b = matrix_mut(b, n, columns, ldb);
        for mut x in b.column_iter_mut() {
            for i in 0..n {
                let known: f64 = (0..i).map(|k| u(k, i) * x[k]).sum();
                x[i] = (x[i] - known) / u(i, i);
            }
            for i in (0..n).rev() {
                let known: f64 = (i + 1..n).map(|k| u(i, k) * x[k]).sum();
                x[i] = (x[i] - known) / u(i, i);
            }
        }
        Ok(())
    }
}

/// Eigenvalues, ascending, and with `jobz = V` orthonormal eigenvectors of a symmetric matrix;
/// all of them (`range = A`), those in `(vl, vu]` (`V`), or numbers `il..=iu` (`I`).
/// `info = 1`: the matrix is not finite, or the iteration did not converge.
/// With `lwork = -1` or `liwork = -1` the sizes of the work arrays are returned and nothing else
/// is touched; the work arrays are not used.
///
/// # Safety
/// The pointers are valid for the shapes the sizes and leading dimensions describe; `z` is not
/// touched unless `jobz = V`.
#[cfg_attr(feature = "symbols", unsafe(no_mangle))]
pub unsafe extern "C" fn dsyevr_(
    jobz: *const c_char,
    range: *const c_char,
    uplo: *const c_char,
    n: *const c_int,
    a: *mut f64,
    lda: *const c_int,
    vl: *const f64,
    vu: *const f64,
    il: *const c_int,
    iu: *const c_int,
    _abstol: *const f64,
    m: *mut c_int,
    w: *mut f64,
    z: *mut f64,
    ldz: *const c_int,
    isuppz: *mut c_int,
    work: *mut f64,
    lwork: *const c_int,
    iwork: *mut c_int,
    liwork: *const c_int,
    info: *mut c_int,
) {
    unsafe {
        if *lwork == -1 || *liwork == -1 {
            *work = 1.0;
            *iwork = 1;
            return report(info, Ok(()));
        }
        let bounds = (*vl, *vu, *il, *iu);
        let outcome = syevr(
            letter(jobz),
            letter(range),
            letter(uplo),
            (n, a, lda),
            bounds,
            (m, w, isuppz),
            (z, ldz),
        );
        report(info, outcome)
    }
}

unsafe fn syevr(
    jobz: u8,
    range: u8,
    uplo: u8,
    (n, a, lda): (*const c_int, *mut f64, *const c_int),
    (vl, vu, il, iu): (f64, f64, c_int, c_int),
    (m, w, isuppz): (*mut c_int, *mut f64, *mut c_int),
    (z, ldz): (*mut f64, *const c_int),
) -> Info {
    unsafe {
        let vectors = match jobz {
            b'V' => true,
            b'N' => false,
            _ => return Err(-1),
        };
        let triangle = Triangle::from_letter(uplo).ok_or(-3)?;
        let n = checked(n, 4)?;
        let lda = leading(lda, n, 6)?;
        let ldz = if vectors { leading(ldz, n, 15)? } else { 1 };
        *m = 0;
        if n == 0 {
            return Ok(());
        }
        let (values, basis) = eigen(triangle.symmetric(&matrix(a, n, n, lda)), vectors)?;
        let wanted: Vec<usize> = match range {
            b'A' => (0..n).collect(),
            b'V' => (0..n)
                .filter(|&i| vl < values[i] && values[i] <= vu)
                .collect(),
            b'I' if 1 <= il && il <= iu && iu <= fortran(n) => {
                (il as usize - 1..iu as usize).collect()
            }
            b'I' => return Err(-9),
            _ => return Err(-2),
        };
        *m = fortran(wanted.len());
        for (to, &from) in wanted.iter().enumerate() {
            *w.add(to) = values[from];
            if let Some(basis) = &basis {
                matrix_mut(z.add(to * ldz), n, 1, ldz).copy_from(&basis.column(from));
                *isuppz.add(2 * to) = 1;
                *isuppz.add(2 * to + 1) = fortran(n);
            }
        }
        Ok(())
    }
}

/// Ascending eigenvalues and, when wanted, the eigenvectors in the same order.
fn eigen(a: DMatrix<f64>, vectors: bool) -> Result<(Vec<f64>, Option<DMatrix<f64>>), c_int> {
    if a.iter().any(|value| !value.is_finite()) {
        return Err(1);
    }
    let iterations = 100 * a.nrows().max(10);
    let found = SymmetricEigen::try_new(a, f64::EPSILON, iterations).ok_or(1)?;
    let mut order: Vec<usize> = (0..found.eigenvalues.len()).collect();
    order.sort_by(|&i, &j| found.eigenvalues[i].total_cmp(&found.eigenvalues[j]));
    let values = order.iter().map(|&i| found.eigenvalues[i]).collect();
    Ok((
        values,
        vectors.then(|| found.eigenvectors.select_columns(&order)),
    ))
}

/// Thin singular value decomposition `A = U diag(s) V'` (`jobz = S`), or the singular values only
/// (`jobz = N`). `jobz = A` and `O` are answered by `info = -1`: no caller here needs them.
/// `info = 1`: the matrix is not finite, or the sweeps did not converge.
/// With `lwork = -1` the size of the work array is returned and nothing else is touched.
///
/// # Safety
/// The pointers are valid for the shapes the sizes and leading dimensions describe; `u` and `vt`
/// are not touched unless `jobz = S`.
#[cfg_attr(feature = "symbols", unsafe(no_mangle))]
pub unsafe extern "C" fn dgesdd_(
    jobz: *const c_char,
    m: *const c_int,
    n: *const c_int,
    a: *mut f64,
    lda: *const c_int,
    s: *mut f64,
    u: *mut f64,
    ldu: *const c_int,
    vt: *mut f64,
    ldvt: *const c_int,
    work: *mut f64,
    lwork: *const c_int,
    _iwork: *mut c_int,
    info: *mut c_int,
) {
    unsafe {
        if *lwork == -1 {
            *work = 1.0;
            return report(info, Ok(()));
        }
        let outcome = match letter(jobz) {
            b'S' => thin_svd(
                (m, n, 2),
                (a, lda, 5),
                s,
                Some((u, ldu, 8)),
                Some((vt, ldvt, 10)),
            ),
            b'N' => thin_svd((m, n, 2), (a, lda, 5), s, None, None),
            _ => Err(-1),
        };
        report(info, outcome)
    }
}

/// As [`dgesdd_`], with the left (`jobu`) and the right vectors (`jobvt`) chosen apart (`S` or `N`).
///
/// # Safety
/// As for [`dgesdd_`].
#[cfg_attr(feature = "symbols", unsafe(no_mangle))]
pub unsafe extern "C" fn dgesvd_(
    jobu: *const c_char,
    jobvt: *const c_char,
    m: *const c_int,
    n: *const c_int,
    a: *mut f64,
    lda: *const c_int,
    s: *mut f64,
    u: *mut f64,
    ldu: *const c_int,
    vt: *mut f64,
    ldvt: *const c_int,
    work: *mut f64,
    lwork: *const c_int,
    info: *mut c_int,
) {
    unsafe {
        if *lwork == -1 {
            *work = 1.0;
            return report(info, Ok(()));
        }
        let left = match letter(jobu) {
            b'S' => Some((u, ldu, 9)),
            b'N' => None,
            _ => return report(info, Err(-1)),
        };
        let right = match letter(jobvt) {
            b'S' => Some((vt, ldvt, 11)),
            b'N' => None,
            _ => return report(info, Err(-2)),
        };
        report(info, thin_svd((m, n, 3), (a, lda, 6), s, left, right))
    }
}

/// A matrix to be written: data, leading dimension, and the position of the latter among the
/// arguments (for `info`).
type Target = (*mut f64, *const c_int, c_int);

unsafe fn thin_svd(
    (m, n, position): (*const c_int, *const c_int, c_int),
    (a, lda, lda_position): Target,
    s: *mut f64,
    left: Option<Target>,
    right: Option<Target>,
) -> Info {
    unsafe {
        let (m, n) = (checked(m, position)?, checked(n, position + 1)?);
        let rank = m.min(n);
        let lda = leading(lda, m, lda_position)?;
        if rank == 0 {
            return Ok(());
        }
        let a = matrix(a, m, n, lda).clone_owned();
        let left = left
            .map(|(data, lead, position)| leading(lead, m, position).map(|lead| (data, lead)))
            .transpose()?;
        let right = right
            .map(|(data, lead, position)| leading(lead, rank, position).map(|lead| (data, lead)))
            .transpose()?;
        if a.iter().any(|value| !value.is_finite()) {
            return Err(1);
        }
        let svd = jacobi::svd(&a).ok_or(1)?;
        for (i, value) in svd.s.iter().enumerate() {
            *s.add(i) = *value;
        }
        if let Some((u, ldu)) = left {
            matrix_mut(u, m, rank, ldu).copy_from(&svd.u);
        }
        if let Some((vt, ldvt)) = right {
            matrix_mut(vt, rank, n, ldvt).copy_from(&svd.v_transposed);
        }
        Ok(())
    }
}
