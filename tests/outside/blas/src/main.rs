//! Defines every BLAS symbol the solver links, as a static BLAS would, counts the calls, and designs. No archive of
//! another BLAS is linked: the symbols are this program's, and do what ftc-lapack does.
#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]

use ftc_design::{ControlSpec, Run, Solver, state_feedback};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Mode, SwitchedPlant};
use nalgebra::dmatrix;
use std::ffi::{c_char, c_int};
use std::sync::atomic::{AtomicUsize, Ordering};

static CALLS: AtomicUsize = AtomicUsize::new(0);

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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe { ftc_lapack::dgemm_(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc) }
}

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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe { ftc_lapack::dsyrk_(uplo, trans, n, k, alpha, a, lda, beta, c, ldc) }
}

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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe { ftc_lapack::dsyr2k_(uplo, trans, n, k, alpha, a, lda, b, ldb, beta, c, ldc) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn dpotrf_(
    uplo: *const c_char,
    n: *const c_int,
    a: *mut f64,
    lda: *const c_int,
    info: *mut c_int,
) {
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe { ftc_lapack::dpotrf_(uplo, n, a, lda, info) }
}

#[unsafe(no_mangle)]
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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe { ftc_lapack::dpotrs_(uplo, n, nrhs, a, lda, b, ldb, info) }
}

#[unsafe(no_mangle)]
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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe {
        ftc_lapack::dsyevr_(
            jobz, range, uplo, n, a, lda, vl, vu, il, iu, _abstol, m, w, z, ldz, isuppz, work,
            lwork, iwork, liwork, info,
        )
    }
}

#[unsafe(no_mangle)]
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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe {
        ftc_lapack::dgesdd_(
            jobz, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, _iwork, info,
        )
    }
}

#[unsafe(no_mangle)]
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
    CALLS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the caller keeps the same promises.
    unsafe {
        ftc_lapack::dgesvd_(
            jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info,
        )
    }
}

fn main() {
    let mode = |pole: f64| {
        Mode::new(dmatrix![pole, 0.1; 0.0, 0.5], dmatrix![0.0; 1.0], dmatrix![1.0, 0.0])
            .with_disturbance(dmatrix![0.1; 0.0], dmatrix![0.0])
    };
    let plant = SwitchedPlant::new(1.0, vec![mode(0.9), mode(0.8)]);
    let mut spec = ControlSpec::unweighted(plant.dimensions());
    spec.decay = 0.98;
    let scaling = Scaling::automatic(&plant);
    // The structured solver needs no BLAS; the general one does.
    let mut run = Run::default();
    run.solver = Solver::General;
    let control = state_feedback::synthesise_with(&plant, &spec, &scaling, &run).expect("the plant is easy");
    control.verify(&plant).expect("it is proved");
    let calls = CALLS.load(Ordering::Relaxed);
    assert!(calls > 0, "the solver used another BLAS");
    println!("{calls} calls");
}
