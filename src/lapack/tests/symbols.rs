//! Each symbol against nalgebra on random matrices, and on everything a caller may throw at it.

use ftc_lapack::{dgemm_, dgesdd_, dgesvd_, dpotrf_, dpotrs_, dsyevr_, dsyr2k_, dsyrk_};
use libc::{c_char, c_int};
use nalgebra::DMatrix;

/// A linear congruential generator of numbers in [-1, 1).
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn below(&mut self, bound: usize) -> usize {
        ((self.number() + 1.0) / 2.0 * bound as f64) as usize
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.number())
    }
}

/// What fills the memory between the columns: a routine that touches it is caught.
const PADDING: f64 = 777.0;

/// A matrix as Fortran holds it, with a leading dimension larger than its rows.
struct Stored {
    data: Vec<f64>,
    rows: usize,
    columns: usize,
    lead: usize,
}

impl Stored {
    fn new(matrix: &DMatrix<f64>, extra: usize) -> Self {
        let (rows, columns) = matrix.shape();
        let lead = (rows + extra).max(1);
        let mut data = vec![PADDING; lead * columns];
        for c in 0..columns {
            data[c * lead..c * lead + rows].copy_from_slice(matrix.column(c).as_slice());
        }
        Self {
            data,
            rows,
            columns,
            lead,
        }
    }

    fn lead(&self) -> c_int {
        self.lead as c_int
    }

    /// The matrix, after checking that the padding is as it was.
    fn read(&self) -> DMatrix<f64> {
        for column in self.data.chunks(self.lead) {
            assert!(column[self.rows..].iter().all(|&value| value == PADDING));
        }
        DMatrix::from_fn(self.rows, self.columns, |r, c| self.data[c * self.lead + r])
    }
}

fn flag(letter: u8) -> c_char {
    letter as c_char
}

fn transpose_if(matrix: &DMatrix<f64>, flag: u8) -> DMatrix<f64> {
    if flag == b'N' {
        matrix.clone()
    } else {
        matrix.transpose()
    }
}

/// Keeps the named triangle of `new`, the rest of `old`.
fn merge(uplo: u8, new: &DMatrix<f64>, old: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(old.nrows(), old.ncols(), |r, c| {
        let stored = if uplo == b'U' { r <= c } else { r >= c };
        if stored { new[(r, c)] } else { old[(r, c)] }
    })
}

#[test]
fn dgemm_multiplies_for_every_orientation() {
    let mut random = Random(1);
    for case in 0..300 {
        let (m, n, k) = (random.below(9), random.below(9), random.below(9));
        for (ta, tb) in [(b'N', b'N'), (b'T', b'N'), (b'N', b'T'), (b'c', b't')] {
            let transposed = |flag: u8| flag != b'N';
            let a = if transposed(ta) {
                random.matrix(k, m)
            } else {
                random.matrix(m, k)
            };
            let b = if transposed(tb) {
                random.matrix(n, k)
            } else {
                random.matrix(k, n)
            };
            let mut c = random.matrix(m, n);
            let (alpha, beta) = (random.number(), [0.0, 1.0, random.number()][case % 3]);
            let expected = alpha * transpose_if(&a, ta) * transpose_if(&b, tb) + beta * &c;
            if beta == 0.0 {
                // Whatever stood there, NaN included, is overwritten.
                c.fill(f64::NAN);
            }
            let (a, b) = (Stored::new(&a, case % 3), Stored::new(&b, case % 2));
            let mut c = Stored::new(&c, case % 4);
            let lead = c.lead();
            unsafe {
                dgemm_(
                    &flag(ta),
                    &flag(tb),
                    &(m as c_int),
                    &(n as c_int),
                    &(k as c_int),
                    &alpha,
                    a.data.as_ptr(),
                    &a.lead(),
                    b.data.as_ptr(),
                    &b.lead(),
                    &beta,
                    c.data.as_mut_ptr(),
                    &lead,
                );
            }
            assert!((c.read() - expected).iter().all(|d| d.abs() < 1e-13));
        }
    }
}

#[test]
fn rank_updates_touch_one_triangle_only() {
    let mut random = Random(2);
    for case in 0..200 {
        let (n, k) = (1 + random.below(8), random.below(8));
        for uplo in [b'U', b'L'] {
            for trans in [b'N', b'T'] {
                let shape = if trans == b'N' { (n, k) } else { (k, n) };
                let a = random.matrix(shape.0, shape.1);
                let b = random.matrix(shape.0, shape.1);
                let c = random.matrix(n, n);
                let (alpha, beta) = (random.number(), [0.0, random.number()][case % 2]);
                let (left, right) = (transpose_if(&a, trans), transpose_if(&b, trans));
                let single = alpha * &left * left.transpose() + beta * &c;
                let double =
                    alpha * (&left * right.transpose() + &right * left.transpose()) + beta * &c;
                let (a, b) = (Stored::new(&a, 2), Stored::new(&b, 1));
                let (size, depth) = (n as c_int, k as c_int);

                let mut found = Stored::new(&c, 3);
                let lead = found.lead();
                unsafe {
                    dsyrk_(
                        &flag(uplo),
                        &flag(trans),
                        &size,
                        &depth,
                        &alpha,
                        a.data.as_ptr(),
                        &a.lead(),
                        &beta,
                        found.data.as_mut_ptr(),
                        &lead,
                    );
                }
                assert!((found.read() - merge(uplo, &single, &c)).amax() < 1e-13);

                let mut found = Stored::new(&c, 3);
                unsafe {
                    dsyr2k_(
                        &flag(uplo),
                        &flag(trans),
                        &size,
                        &depth,
                        &alpha,
                        a.data.as_ptr(),
                        &a.lead(),
                        b.data.as_ptr(),
                        &b.lead(),
                        &beta,
                        found.data.as_mut_ptr(),
                        &lead,
                    );
                }
                assert!((found.read() - merge(uplo, &double, &c)).amax() < 1e-13);
            }
        }
    }
}

fn potrf(uplo: u8, stored: &mut Stored) -> c_int {
    let (n, lead, mut info) = (stored.rows as c_int, stored.lead(), -99);
    unsafe { dpotrf_(&flag(uplo), &n, stored.data.as_mut_ptr(), &lead, &mut info) };
    info
}

#[test]
fn cholesky_reconstructs_and_solves() {
    let mut random = Random(3);
    for case in 0..200 {
        let n = random.below(12);
        let root = random.matrix(n, n + 2);
        let a = &root * root.transpose();
        let right = random.matrix(n, 1 + case % 3);
        for uplo in [b'U', b'l'] {
            let mut factor = Stored::new(&a, case % 3);
            assert_eq!(potrf(uplo, &mut factor), 0);
            let triangle = if uplo == b'U' {
                factor.read().upper_triangle().transpose()
            } else {
                factor.read().lower_triangle()
            };
            assert!(
                (&triangle * triangle.transpose() - &a)
                    .iter()
                    .all(|d| d.abs() < 1e-12)
            );

            let mut solution = Stored::new(&right, 2);
            let (lead, mut info) = (solution.lead(), -99);
            unsafe {
                dpotrs_(
                    &flag(uplo),
                    &(n as c_int),
                    &(right.ncols() as c_int),
                    factor.data.as_ptr(),
                    &factor.lead(),
                    solution.data.as_mut_ptr(),
                    &lead,
                    &mut info,
                );
            }
            assert_eq!(info, 0);
            let residual = &a * solution.read() - &right;
            assert!(residual.iter().all(|d| d.abs() < 1e-8));
        }
    }
}

#[test]
fn cholesky_names_the_minor_that_is_not_positive() {
    let mut indefinite = DMatrix::<f64>::identity(4, 4);
    indefinite[(2, 2)] = -1.0;
    let mut broken = DMatrix::<f64>::identity(4, 4);
    broken[(1, 1)] = f64::NAN;
    let mut infinite = DMatrix::<f64>::identity(4, 4);
    infinite[(3, 3)] = f64::INFINITY;
    let singular = DMatrix::<f64>::from_element(4, 4, 1.0);
    for uplo in [b'U', b'L'] {
        for (matrix, minor) in [
            (&indefinite, 3),
            (&broken, 2),
            (&infinite, 4),
            (&singular, 2),
        ] {
            assert_eq!(potrf(uplo, &mut Stored::new(matrix, 1)), minor);
        }
    }
    assert_eq!(potrf(b'X', &mut Stored::new(&singular, 0)), -1);
}

/// What `dsyevr_` returns: info, eigenvalues, eigenvectors.
fn syevr(
    jobz: u8,
    uplo: u8,
    matrix: &DMatrix<f64>,
    range: (u8, f64, f64, c_int, c_int),
) -> (c_int, Vec<f64>, DMatrix<f64>) {
    let n = matrix.nrows();
    let mut a = Stored::new(matrix, 2);
    let mut z = Stored::new(&DMatrix::zeros(n, n), 3);
    let (lead, z_lead) = (a.lead(), z.lead());
    let (mut count, mut info) = (0, -99);
    let mut values = vec![0.0; n];
    let mut support = vec![0; 2 * n.max(1)];
    let (mut work, mut iwork) = (vec![0.0], vec![0]);
    let (mut lwork, mut liwork) = (-1, -1);
    for _ in 0..2 {
        unsafe {
            dsyevr_(
                &flag(jobz),
                &flag(range.0),
                &flag(uplo),
                &(n as c_int),
                a.data.as_mut_ptr(),
                &lead,
                &range.1,
                &range.2,
                &range.3,
                &range.4,
                &-1.0,
                &mut count,
                values.as_mut_ptr(),
                z.data.as_mut_ptr(),
                &z_lead,
                support.as_mut_ptr(),
                work.as_mut_ptr(),
                &lwork,
                iwork.as_mut_ptr(),
                &liwork,
                &mut info,
            );
        }
        if lwork == -1 {
            assert_eq!(info, 0);
            let untouched = a
                .read()
                .iter()
                .zip(matrix)
                .all(|(x, y)| x.to_bits() == y.to_bits());
            assert!(untouched, "a workspace query must not touch the matrix");
            lwork = work[0] as c_int;
            liwork = iwork[0];
            work.resize(lwork as usize, 0.0);
            iwork.resize(liwork as usize, 0);
        }
    }
    values.truncate(count as usize);
    let basis = z.read().columns(0, count as usize).into_owned();
    (info, values, basis)
}

const ALL: (u8, f64, f64, c_int, c_int) = (b'A', 0.0, 0.0, 0, 0);

#[test]
fn eigenvectors_reconstruct_the_matrix_from_either_triangle() {
    let mut random = Random(4);
    for _ in 0..100 {
        let n = 1 + random.below(15);
        let root = random.matrix(n, n);
        let a = &root + root.transpose();
        for uplo in [b'U', b'L'] {
            // Only the named triangle may be read.
            let half = merge(uplo, &a, &DMatrix::from_element(n, n, 1e9));
            let (info, values, basis) = syevr(b'V', uplo, &half, ALL);
            assert_eq!(info, 0);
            assert!(values.is_sorted());
            let diagonal = DMatrix::from_diagonal(&values.clone().into());
            assert!((&basis * diagonal * basis.transpose() - &a).amax() < 1e-12);
            assert!((basis.transpose() * &basis - DMatrix::identity(n, n)).amax() < 1e-12);
            let (_, alone, _) = syevr(b'N', uplo, &half, ALL);
            assert!(
                alone
                    .iter()
                    .zip(&values)
                    .all(|(x, y)| (x - y).abs() < 1e-12)
            );
        }
    }
}

#[test]
fn eigenvalues_can_be_chosen_by_number_and_by_interval() {
    let a = DMatrix::from_diagonal(&vec![3.0, 1.0, 4.0, 2.0].into());
    let (_, by_number, _) = syevr(b'V', b'U', &a, (b'I', 0.0, 0.0, 2, 3));
    assert_eq!(by_number, [2.0, 3.0]);
    let (_, by_interval, basis) = syevr(b'V', b'U', &a, (b'V', 1.0, 3.0, 0, 0));
    assert_eq!(by_interval, [2.0, 3.0]);
    assert!(
        (&a * &basis)
            .column(1)
            .relative_eq(&(3.0 * basis.column(1)), 1e-12, 1e-12)
    );
    assert_eq!(syevr(b'V', b'U', &a, (b'I', 0.0, 0.0, 3, 9)).0, -9);
    assert_eq!(syevr(b'Q', b'U', &a, ALL).0, -1);
    assert_eq!(syevr(b'V', b'U', &a, (b'Q', 0.0, 0.0, 0, 0)).0, -2);
}

/// What a singular value decomposition returns: info, U, s, V'.
fn svd(matrix: &DMatrix<f64>, divide: bool) -> (c_int, DMatrix<f64>, Vec<f64>, DMatrix<f64>) {
    let (m, n) = matrix.shape();
    let rank = m.min(n);
    let mut a = Stored::new(matrix, 1);
    let mut u = Stored::new(&DMatrix::zeros(m, rank), 2);
    let mut vt = Stored::new(&DMatrix::zeros(rank, n), 3);
    let mut s = vec![0.0; rank];
    let (la, lu, lv) = (a.lead(), u.lead(), vt.lead());
    let (rows, columns, mut info) = (m as c_int, n as c_int, -99);
    let mut work = vec![0.0];
    let mut iwork = vec![0; 8 * rank.max(1)];
    for lwork in [-1, 1] {
        unsafe {
            if divide {
                dgesdd_(
                    &flag(b'S'),
                    &rows,
                    &columns,
                    a.data.as_mut_ptr(),
                    &la,
                    s.as_mut_ptr(),
                    u.data.as_mut_ptr(),
                    &lu,
                    vt.data.as_mut_ptr(),
                    &lv,
                    work.as_mut_ptr(),
                    &lwork,
                    iwork.as_mut_ptr(),
                    &mut info,
                );
            } else {
                dgesvd_(
                    &flag(b'S'),
                    &flag(b'S'),
                    &rows,
                    &columns,
                    a.data.as_mut_ptr(),
                    &la,
                    s.as_mut_ptr(),
                    u.data.as_mut_ptr(),
                    &lu,
                    vt.data.as_mut_ptr(),
                    &lv,
                    work.as_mut_ptr(),
                    &lwork,
                    &mut info,
                );
            }
        }
        if lwork == -1 {
            assert_eq!((info, work[0]), (0, 1.0));
        }
    }
    (info, u.read(), s, vt.read())
}

#[test]
fn singular_vectors_reconstruct_every_shape_and_rank() {
    let mut random = Random(5);
    for case in 0..200 {
        let (m, n) = (1 + random.below(12), 1 + random.below(12));
        let mut a = random.matrix(m, n);
        if case % 4 == 0 {
            // Rank one, or zero.
            a = f64::from(case % 8) * random.matrix(m, 1) * random.matrix(1, n);
        }
        a *= [1.0, 1e200, 1e-200][case as usize % 3];
        let rank = m.min(n);
        for divide in [true, false] {
            let (info, u, s, vt) = svd(&a, divide);
            assert_eq!(info, 0);
            assert!(s.iter().rev().is_sorted() && s.iter().all(|value| *value >= 0.0));
            let identity = DMatrix::identity(rank, rank);
            assert!(
                (u.transpose() * &u - &identity).amax() < 1e-12,
                "case {case}"
            );
            assert!(
                (&vt * vt.transpose() - &identity).amax() < 1e-12,
                "case {case}"
            );
            let scale = a.amax().max(f64::MIN_POSITIVE);
            let diagonal =
                DMatrix::from_diagonal(&s.iter().map(|v| v / scale).collect::<Vec<_>>().into());
            assert!(
                (&u * diagonal * &vt - &a / scale).amax() < 1e-12,
                "case {case}"
            );
        }
    }
}

/// Singular values far below the largest keep their digits; an interior-point method's scaling
/// needs them.
#[test]
fn small_singular_values_keep_their_digits() {
    let mut random = Random(6);
    let q = random.matrix(6, 6).qr().q();
    let graded = DMatrix::from_fn(6, 6, |r, c| q[(r, c)] * 10_f64.powi(-4 * c as i32));
    let (info, _, s, _) = svd(&graded, true);
    assert_eq!(info, 0);
    for (k, value) in s.iter().enumerate() {
        let exact = 10_f64.powi(-4 * k as i32);
        assert!((value / exact - 1.0).abs() < 1e-13, "{k}: {value}");
    }
}

#[test]
fn what_is_not_finite_is_refused_without_a_loop() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut matrix = DMatrix::identity(5, 5);
        matrix[(1, 3)] = bad;
        matrix[(3, 1)] = bad;
        assert_eq!(svd(&matrix, true).0, 1);
        assert_eq!(svd(&matrix, false).0, 1);
        assert_eq!(syevr(b'V', b'U', &matrix, ALL).0, 1);
        assert_eq!(syevr(b'N', b'L', &matrix, ALL).0, 1);
    }
}

#[test]
fn jobs_that_are_not_offered_are_named() {
    let (mut a, mut s) = ([1.0], [0.0]);
    let (mut u, mut vt, mut work, mut iwork, mut info) = ([0.0], [0.0], [0.0], [0; 8], 0);
    unsafe {
        dgesdd_(
            &flag(b'A'),
            &1,
            &1,
            a.as_mut_ptr(),
            &1,
            s.as_mut_ptr(),
            u.as_mut_ptr(),
            &1,
            vt.as_mut_ptr(),
            &1,
            work.as_mut_ptr(),
            &1,
            iwork.as_mut_ptr(),
            &mut info,
        );
        assert_eq!(info, -1);
        dgesvd_(
            &flag(b'N'),
            &flag(b'O'),
            &1,
            &1,
            a.as_mut_ptr(),
            &1,
            s.as_mut_ptr(),
            u.as_mut_ptr(),
            &1,
            vt.as_mut_ptr(),
            &1,
            work.as_mut_ptr(),
            &1,
            &mut info,
        );
        assert_eq!(info, -2);
        dgesdd_(
            &flag(b'N'),
            &2,
            &1,
            a.as_mut_ptr(),
            &1,
            s.as_mut_ptr(),
            u.as_mut_ptr(),
            &1,
            vt.as_mut_ptr(),
            &1,
            work.as_mut_ptr(),
            &1,
            iwork.as_mut_ptr(),
            &mut info,
        );
        assert_eq!(info, -5);
    }
}
