//! The eight LAPACK/BLAS symbols that clarabel's semidefinite cone links, over nalgebra.
//!
//! A conic solver with semidefinite cones expects `dgemm_`, `dsyrk_`, `dsyr2k_`, `dpotrf_`,
//! `dpotrs_`, `dsyevr_`, `dgesdd_` and `dgesvd_` from a system BLAS. This crate defines them, so
//! that no system package is needed. A dependent keeps them linked with `use ftc_lapack as _;`.
//!
//! The conventions are Fortran's: every argument is a pointer, matrices are column-major with a
//! leading dimension, `info` is 0 on success, `-i` when argument `i` is illegal and positive when
//! the numbers do not allow a result. Nothing here panics: sizes are checked first, and input that
//! is not finite is answered by `info`, never by a loop that does not end.

mod factor;
mod jacobi;
mod multiply;
mod view;

pub use factor::{dgesdd_, dgesvd_, dpotrf_, dpotrs_, dsyevr_};
pub use multiply::{dgemm_, dsyr2k_, dsyrk_};
