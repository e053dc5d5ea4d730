//! What the estimator knows beforehand: the plant per mode, and sizes and rates of what may happen.

use super::linear::{multiply, multiply_transposed};
use alloc::vec;
use alloc::vec::Vec;

/// Sizes of the parts of the joint state `[x; d; l; g; f]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// States `x`.
    pub n: usize,
    /// Inputs, each with a gain error `g`.
    pub m: usize,
    /// Sensors, each with a fault `f`.
    pub p: usize,
    /// States `d` of the periodic disturbance.
    pub d: usize,
}

impl Layout {
    /// First entry of `l`.
    pub const fn load(self) -> usize {
        self.n + self.d
    }
    /// First entry of `g`.
    pub const fn gain(self) -> usize {
        self.load() + self.n
    }
    /// First entry of `f`.
    pub const fn fault(self) -> usize {
        self.gain() + self.m
    }
    /// All entries.
    pub const fn size(self) -> usize {
        self.fault() + self.p
    }
}

/// One mode, row after row: `x+ = A x + B u + a + E_d d + l + B diag(u) g`, `y = C x + c + F_d d`.
#[derive(Clone, Debug)]
pub struct ModeModel {
    /// `A` (n x n).
    pub a: Vec<f64>,
    /// `B` (n x m).
    pub b: Vec<f64>,
    /// `C` (p x n).
    pub c: Vec<f64>,
    /// `E` times the disturbance's output map (n x d).
    pub e: Vec<f64>,
    /// `F` times the disturbance's output map (p x d).
    pub f: Vec<f64>,
    /// Operating point of the state (n).
    pub x0: Vec<f64>,
    /// Operating point of the input (m).
    pub u0: Vec<f64>,
    /// `x0 - A x0 - B u0` (n).
    pub state_offset: Vec<f64>,
    /// `y0 - C x0` (p).
    pub output_offset: Vec<f64>,
    /// Covariance of the jump of a load (n x n).
    pub load: Vec<f64>,
    /// `C load C'` (p x p).
    pub load_seen: Vec<f64>,
    /// `C B` (p x m).
    pub cb: Vec<f64>,
    /// Square of what the states at their nominal values add to each output (p).
    pub bias: Vec<f64>,
    /// `B^+` (m x n): the input that would act as a load does.
    pub b_inverse: Vec<f64>,
}

impl ModeModel {
    /// Fills in what follows from the matrices and the load's covariance.
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        layout: Layout,
        a: Vec<f64>,
        b: Vec<f64>,
        c: Vec<f64>,
        e: Vec<f64>,
        f: Vec<f64>,
        point: (&[f64], &[f64], &[f64]),
        load: Vec<f64>,
        bias: Vec<f64>,
        b_inverse: Vec<f64>,
    ) -> Self {
        let Layout { n, m, p, .. } = layout;
        let (x0, u0, y0) = point;
        let mut state_offset = x0.to_vec();
        for (i, value) in state_offset.iter_mut().enumerate() {
            for j in 0..n {
                *value -= a[i * n + j] * x0[j];
            }
            for j in 0..m {
                *value -= b[i * m + j] * u0[j];
            }
        }
        let mut output_offset = y0.to_vec();
        for (i, value) in output_offset.iter_mut().enumerate() {
            for j in 0..n {
                *value -= c[i * n + j] * x0[j];
            }
        }
        let mut half = vec![0.0; p * n];
        multiply(&mut half, &c, &load, n);
        let mut load_seen = vec![0.0; p * p];
        multiply_transposed(&mut load_seen, &half, &c, n);
        let mut cb = vec![0.0; p * m];
        multiply(&mut cb, &c, &b, n);
        Self {
            a,
            b,
            c,
            e,
            f,
            x0: x0.to_vec(),
            u0: u0.to_vec(),
            state_offset,
            output_offset,
            load,
            load_seen,
            cb,
            bias,
            b_inverse,
        }
    }
}
