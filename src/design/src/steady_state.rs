//! Where a mode comes to rest.

use crate::pseudo_inverse::pseudo_inverse;
use ftc_plant::Mode;
use nalgebra::DMatrix;

/// State and input (n + m x r) at which each of the `tracked` outputs (0-based, r) rests at one, as
/// deviations from the operating point: least squares of `(A - I) x + B u = 0`, `S C x = y_ref`.
pub fn steady_state(mode: &Mode, tracked: &[usize]) -> DMatrix<f64> {
    let (n, m) = mode.b.shape();
    let r = tracked.len();
    let mut equations = DMatrix::zeros(n + r, n + m);
    let moved = &mode.a - DMatrix::identity(n, n);
    equations.view_mut((0, 0), (n, n)).copy_from(&moved);
    equations.view_mut((0, n), (n, m)).copy_from(&mode.b);
    let select = mode.c.select_rows(tracked);
    equations.view_mut((n, 0), (r, n)).copy_from(&select);
    pseudo_inverse(&equations, 1e-12).columns(n, r).into_owned()
}
