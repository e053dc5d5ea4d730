//! What the estimator knows beforehand: the plant per mode, and sizes and rates of what may happen.

use super::linear::{Sparse, multiply, multiply_transposed, padded, sparse_dot};
use crate::tuning::BankTuning;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

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
    /// Channels of the disturbance, each with a load.
    pub s: usize,
}

/// A jump of loads from one source, or of all at once.
#[derive(Clone, Debug)]
pub struct Jump {
    /// Logarithm of its probability per sample.
    pub log_rate: f64,
    /// Its size over that of a usual one.
    pub scale: f64,
    /// Which loads jump.
    pub loads: Range<usize>,
    /// Covariance of their effect on the outputs (p x p).
    pub seen: Vec<f64>,
    /// Inputs whose gain jumps with it.
    pub gains: Range<usize>,
}

impl Layout {
    /// Entries of `l`: on each input, each channel of the disturbance, each state.
    pub const fn loads(self) -> usize {
        self.m + self.s + self.n
    }
    /// The load on state 0 among the loads.
    pub const fn state_load(self) -> usize {
        self.m + self.s
    }
    /// First entry of `l`.
    pub const fn load(self) -> usize {
        self.n + self.d
    }
    /// First entry of `g`.
    pub const fn gain(self) -> usize {
        self.load() + self.loads()
    }
    /// First entry of `f`.
    pub const fn fault(self) -> usize {
        self.gain() + self.m
    }
    /// All entries.
    pub const fn size(self) -> usize {
        self.fault() + self.p
    }
    /// The length of a padded row of the covariance.
    pub const fn stride(self) -> usize {
        padded(self.size())
    }
}

/// One mode, row after row: `x+ = A x + B u + a + E_d d + G l + B diag(u) g`, `y = C x + c + F_d d`.
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
    /// What the loads do to the states: `[B E I]` (n x loads).
    pub g: Vec<f64>,
    /// Standard deviation of a jump of each load.
    pub load_size: Vec<f64>,
    /// What jumps of loads may do: all of them at once first, then each source on its own.
    pub jumps: Vec<Jump>,
    /// `C B` (p x m).
    pub cb: Vec<f64>,
    /// Square of what the states at their nominal values add to each output (p).
    pub bias: Vec<f64>,
    /// `B^+` (m x n): the input that would act as a load does.
    pub b_inverse: Vec<f64>,
    /// `A`, `E_d` and `G` side by side: what moves the state, by entries of the joint state.
    pub motion: Sparse<3>,
    /// `B`, by the gain errors in the joint state.
    pub by_gain: Sparse<1>,
    /// How the variance of each load and of each gain error grows per sample.
    pub growth: Vec<f64>,
    /// The greatest variance of each entry of the joint state: of a load the square of its size, of a
    /// fault that of a healthy sensor.
    pub most: Vec<f64>,
    /// `C` and `F_d` side by side: the outputs, by entries of the joint state.
    pub outputs: Sparse<2>,
}

/// Of everything at once, of each input, of each wave, and of the states, as large as usual or larger.
fn jumps(
    layout: Layout,
    (c, g): (&[f64], &[f64]),
    load_size: &[f64],
    (log_rate, tuning): (f64, &BankTuning),
) -> Vec<Jump> {
    let Layout { n, m, p, .. } = layout;
    let count = layout.loads();
    let jump = |(log_rate, scale, loads, gains): (f64, f64, Range<usize>, Range<usize>)| {
        let mut effect = vec![0.0; p * loads.len()];
        for (row, c) in effect
            .chunks_exact_mut(loads.len().max(1))
            .zip(c.chunks_exact(n))
        {
            for (value, k) in row.iter_mut().zip(loads.clone()) {
                let column = g.iter().skip(k).step_by(count);
                *value =
                    scale * load_size[k] * c.iter().zip(column).map(|(c, g)| c * g).sum::<f64>();
            }
        }
        let mut seen = vec![0.0; p * p];
        multiply_transposed(&mut seen, &effect, &effect, loads.len());
        Jump {
            log_rate,
            scale,
            loads,
            gains,
            seen,
        }
    };
    let every = (tuning.everything * log_rate, 1.0, 0..count, 0..m);
    let each = (0..m).map(|j| (log_rate, 1.0, j..j + 1, j..j + 1));
    let waves = (m..layout.state_load()).map(|j| (log_rate, 1.0, j..j + 1, 0..0));
    let several = tuning.several * log_rate;
    let states = [
        (several, 1.0),
        (several + tuning.large_load_log_rate, tuning.large_load),
    ];
    let states = states.map(|(rate, scale)| (rate, scale, layout.state_load()..count, 0..0));
    let all = core::iter::once(every)
        .chain(each)
        .chain(waves)
        .chain(states);
    all.map(jump).collect()
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
        (g, load_size, growth): (Vec<f64>, Vec<f64>, Vec<f64>),
        (bias, most): (Vec<f64>, Vec<f64>),
        load_rate: (f64, &BankTuning),
        b_inverse: Vec<f64>,
    ) -> Self {
        let Layout { n, m, p, .. } = layout;
        let (x0, u0, y0) = point;
        let motion = Sparse::new(n, [(0, &a), (n, &e), (layout.load(), &g)]);
        let by_gain = Sparse::new(n, [(layout.gain(), &b)]);
        let outputs = Sparse::new(p, [(0, &c), (n, &f)]);
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
        let jumps = jumps(layout, (&c, &g), &load_size, load_rate);
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
            g,
            load_size,
            growth,
            most,
            jumps,
            cb,
            bias,
            b_inverse,
            motion,
            by_gain,
            outputs,
        }
    }

    /// Output `q` at the plant's state `x` (n) and the disturbance in `z`.
    #[inline]
    pub fn output(&self, q: usize, x: &[f64], z: &[f64]) -> f64 {
        let [states, waves] = self.outputs.parts(q);
        self.output_offset[q] + sparse_dot(states, x) + sparse_dot(waves, z)
    }
}
