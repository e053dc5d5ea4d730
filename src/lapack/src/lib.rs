//! The eight LAPACK/BLAS symbols that clarabel's semidefinite cone links, over nalgebra.
//!
//! A conic solver with semidefinite cones expects `dgemm_`, `dsyrk_`, `dsyr2k_`, `dpotrf_`,
//! `dpotrs_`, `dsyevr_`, `dgesdd_` and `dgesvd_` from a system BLAS. This crate defines them, so
//! that no system package is needed. The feature `symbols` gives them these names for the linker; a dependent
//! keeps them linked with `use ftc_lapack as _;`. Without the feature they are plain functions, and the
//! program may link any other BLAS.
//!
//! The conventions are Fortran's: every argument is a pointer, matrices are column-major with a
//! leading dimension, `info` is 0 on success, `-i` when argument `i` is illegal and positive when
//! the numbers do not allow a result. Nothing here panics: sizes are checked first, and input that
//! is not finite is answered by `info`, never by a loop that does not end.
//!
//! ```
//! // The Cholesky factor of [4 2; 2 5], lower triangle, column after column.
//! let mut a = [4.0, 2.0, 2.0, 5.0];
//! let mut info = 0;
//! // SAFETY: the sizes are those of `a`, which nothing else uses.
//! unsafe { ftc_lapack::dpotrf_(c"L".as_ptr(), &2, a.as_mut_ptr(), &2, &mut info) };
//! assert_eq!((info, a[0], a[1], a[3]), (0, 2.0, 1.0, 2.0));
//! ```

mod factor;
mod jacobi;
mod multiply;
mod view;

pub use factor::{dgesdd_, dgesvd_, dpotrf_, dpotrs_, dsyevr_};
pub use multiply::{dgemm_, dsyr2k_, dsyrk_};
