//! Decompositions of dense matrices of real and of complex numbers, over nalgebra, each compiled once.
//!
//! nalgebra's decompositions are generic: every crate that calls one compiles it anew, and they are among the
//! longest functions there are. The crates of this project call them here instead; the numbers are nalgebra's.
//!
//! ```
//! use nalgebra::{DMatrix, dmatrix};
//!
//! let a: DMatrix<f64> = dmatrix![0.5, 1.0; 0.0, -0.25];
//! assert_eq!(ftc_linalg::spectral_radius(&a), 0.5);
//! assert_eq!(ftc_linalg::inverse(a.clone()).ok_or("singular")? * a, DMatrix::identity(2, 2));
//! # Ok::<(), &str>(())
//! ```

mod complex;
mod eigenvalues;
mod real;

pub use complex::{complex_pseudo_inverse, complex_singular_values};
pub use eigenvalues::{eigenvalues, spectral_radius};
pub use real::{
    inverse, pseudo_inverse, qr, right_svd, singular_values, svd, symmetric_eigen,
    symmetric_eigenvalues, try_svd, try_symmetric_eigen,
};
