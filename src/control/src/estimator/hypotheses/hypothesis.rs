//! One hypothesis: who is faulty, and a Kalman filter of `[x; d; l; g; f]` under that assumption.

// Matrices are flat and addressed by row and column, as in the equations.
#![allow(clippy::needless_range_loop)]

use super::linear::{
    add_row, combine, dot, factor, mirror, padded, solve, sparse_dot, subtract_squares, turn,
};
use super::model::{Jump, Layout, ModeModel};
use crate::kernel::{LARGEST, bounded};
use crate::parameters::Hypotheses as Settings;
use crate::tuning::BankTuning;
use alloc::vec;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

/// A set of sensors, as bits.
pub type Sensors = u64;

/// Whether sensor `q` is in the set.
pub const fn has(set: Sensors, q: usize) -> bool {
    q < 64 && set >> q & 1 == 1
}

/// One hypothesis.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Estimate of the joint state (N, padded).
    pub z: Vec<f64>,
    /// Its covariance (N rows, padded).
    pub cov: Vec<f64>,
    /// Estimate of the state a sample ago (n).
    pub before: Vec<f64>,
    /// Sensors with an additive fault.
    pub additive: Sensors,
    /// Sensors that repeat one value.
    pub stuck: Sensors,
    /// Sensors whose gain is wrong.
    pub scaled: Sensors,
    /// Whether nothing but a fault of its sensors could explain the readings that began it.
    pub convinced: bool,
    /// Whether the plant is no longer the model.
    pub plant_changed: bool,
    /// The plant's mode (0-based).
    pub mode: u32,
    /// The mode that brought it from the last sample to this one (0-based).
    pub moved_by: u32,
    /// Logarithm of its probability, up to a constant.
    pub score: f64,
    /// Running mean of how badly it fits.
    pub misfit: f64,
}

/// The innovation of a sample under a hypothesis.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Innovation {
    /// `y - y_hat` (p).
    pub r: Vec<f64>,
    /// Output that is predicted of a healthy sensor (p).
    pub output: Vec<f64>,
    /// `C P` (p rows of N, padded).
    pub rows: Vec<f64>,
    /// Its covariance, then its Cholesky factor (p x p).
    pub s: Vec<f64>,
    /// Weights of the output and of the fault in each reading (p).
    pub weights: Vec<[f64; 2]>,
    /// Whitened innovation (p).
    pub white: Vec<f64>,
    /// `r' S^-1 r`.
    pub square: f64,
    /// Whether the covariance could be factored.
    pub regular: bool,
}

/// One sample.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// Measurement (p).
    pub y: &'a [f64],
    /// Sensors whose reading carries information.
    pub valid: Sensors,
    /// Noise deviation (p).
    pub noise: &'a [f64],
}

crate::state!(Hypothesis {
    parts: [z, cov, before],
    constants: [],
    counters: [
        additive,
        stuck,
        scaled,
        convinced,
        plant_changed,
        mode,
        moved_by,
        score,
        misfit
    ]
});
crate::state!(Innovation {
    parts: [r, output, rows, s, weights, white],
    constants: [],
    counters: [square, regular]
});

/// From one sample to the next, the same for every hypothesis.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    pub layout: Layout,
    pub model: &'a ModeModel,
    pub settings: &'a Settings,
    /// Tuning constants.
    pub tuning: &'a BankTuning,
    /// Variance of the relative error of the entries of the plant's matrices.
    pub model_error: f64,
    /// Noise deviation (p).
    pub noise: &'a [f64],
    /// Cosine and sine of the angle by which each pair of the disturbance turns.
    pub rotation: &'a [(f64, f64)],
    /// The error of that angle, and the least growth of the variance, of each pair.
    pub waves: &'a [(f64, f64)],
    /// Whether the model's outputs may be wrong.
    pub bias: bool,
    /// The input that acts (m), and how it moved (m).
    pub u: &'a [f64],
    pub moved: &'a [f64],
}

impl Innovation {
    /// Room for `layout`.
    pub fn new(layout: Layout) -> Self {
        let p = layout.p;
        Self {
            r: vec![0.0; p],
            output: vec![0.0; p],
            rows: vec![0.0; p * layout.stride()],
            s: vec![0.0; p * p],
            weights: vec![[1.0, 0.0]; p],
            white: vec![0.0; p],
            square: 0.0,
            regular: true,
        }
    }

    /// Innovation of `h`.
    pub fn predict(
        &mut self,
        layout: Layout,
        model: &ModeModel,
        reading: Reading<'_>,
        h: &Hypothesis,
        bias: bool,
    ) {
        let (p, kinds) = (layout.p, h.kinds());
        let (stride, fault) = (layout.stride(), layout.fault());
        let width = padded(h.active(layout, bias));
        for q in 0..p {
            let row = &mut self.rows[q * stride..q * stride + width];
            let output = model.output(q, &h.z, &h.z);
            self.output[q] = output;
            if !has(reading.valid, q) {
                row.fill(0.0);
                self.s[q * p..q * p + q].fill(0.0);
                self.r[q] = 0.0;
                self.s[q * p + q] = 1.0;
                continue;
            }
            let noise = reading.noise[q];
            let k = fault + q;
            let (scale, slot) = kinds.weights(q, output, h.z[k], bias);
            let seen = match scale != 0.0 {
                true => model.outputs.row(q),
                false => &[],
            };
            let terms = seen.iter().map(|&(at, factor)| (at, scale * factor));
            combine(row, &h.cov, stride, terms);
            if slot != 0.0 {
                add_row(row, slot, &h.cov[k * stride..k * stride + width]);
            }
            self.r[q] = reading.y[q]
                - if has(kinds.scaled, q) {
                    scale * output
                } else {
                    scale * output + slot * h.z[k]
                };
            self.weights[q] = [scale, slot];
            let covariances = &mut self.s[q * p..=q * p + q];
            for (j, (sum, &[scale, slot])) in covariances.iter_mut().zip(&self.weights).enumerate()
            {
                *sum = 0.0;
                if has(reading.valid, j) {
                    if scale != 0.0 {
                        let [states, waves] = model.outputs.parts(j);
                        *sum = scale * (sparse_dot(states, row) + sparse_dot(waves, row));
                    }
                    if slot != 0.0 {
                        *sum += slot * row[fault + j];
                    }
                }
            }
            self.s[q * p + q] += noise * noise;
        }
    }

    /// Factors the covariance, whitens the innovation.
    pub fn whiten(&mut self, p: usize) {
        self.regular = factor(&mut self.s, p);
        if !self.regular {
            self.white.fill(0.0);
            self.square = 1e300;
            return;
        }
        self.white.copy_from_slice(&self.r);
        solve(&self.s, p, &mut self.white);
        self.square = dot(&self.white, &self.white);
        if !self.square.is_finite() {
            self.square = 1e300;
        }
    }

    /// Whether an innovation `r` (p) is about the same as this one, after [`whiten`](Self::whiten).
    pub fn leaves(&self, tuning: &BankTuning, r: &[f64]) -> bool {
        let p = r.len();
        self.r.iter().zip(r).enumerate().all(|(q, (own, other))| {
            let factor = &self.s[q * p..=q * p + q];
            let off = own - other;
            off * off <= tuning.same_estimate * dot(factor, factor)
        })
    }

    /// Logarithm of the likelihood, after [`whiten`](Self::whiten).
    pub fn likelihood(&self, p: usize) -> f64 {
        if !self.regular {
            return -1e5;
        }
        let mut product = 1.0;
        let mut log = 0.0;
        for q in 0..p {
            product *= self.s[q * p + q];
            if !(1.0 / LARGEST..LARGEST).contains(&product) {
                log += libm::log(product);
                product = 1.0;
            }
        }
        log += libm::log(product);
        (-0.5 * self.square.min(1e5) - log).max(-1e6)
    }
}

/// Who is faulty, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kinds {
    pub additive: Sensors,
    pub stuck: Sensors,
    pub scaled: Sensors,
}

impl Kinds {
    pub const fn all(self) -> Sensors {
        self.additive | self.stuck | self.scaled
    }
    pub const fn without(self, set: Sensors) -> Self {
        Self {
            additive: self.additive & !set,
            stuck: self.stuck & !set,
            scaled: self.scaled & !set,
        }
    }
    /// Weights of the output and of the fault's entry in the reading of sensor `q`.
    pub fn weights(self, q: usize, output: f64, fault: f64, bias: bool) -> (f64, f64) {
        if has(self.stuck, q) {
            (0.0, 1.0)
        } else if has(self.scaled, q) {
            (1.0 + fault, output)
        } else if bias || has(self.additive, q) {
            (1.0, 1.0)
        } else {
            (1.0, 0.0)
        }
    }
}

impl Hypothesis {
    /// Who is faulty, and how.
    pub const fn kinds(&self) -> Kinds {
        Kinds {
            additive: self.additive,
            stuck: self.stuck,
            scaled: self.scaled,
        }
    }
    /// Nothing but the start.
    pub fn new(layout: Layout) -> Self {
        let stride = layout.stride();
        Self {
            z: vec![0.0; stride],
            cov: vec![0.0; layout.size() * stride],
            before: vec![0.0; layout.n],
            additive: 0,
            stuck: 0,
            scaled: 0,
            convinced: true,
            plant_changed: false,
            mode: 0,
            moved_by: 0,
            score: 0.0,
            misfit: layout.p as f64,
        }
    }

    /// All sensors that it takes for faulty.
    pub const fn flagged(&self) -> Sensors {
        self.additive | self.stuck | self.scaled
    }

    /// Copies in place.
    pub fn take(&mut self, other: &Self) {
        self.z.copy_from_slice(&other.z);
        self.cov.copy_from_slice(&other.cov);
        self.before.copy_from_slice(&other.before);
        self.additive = other.additive;
        self.stuck = other.stuck;
        self.scaled = other.scaled;
        self.convinced = other.convinced;
        self.plant_changed = other.plant_changed;
        self.mode = other.mode;
        self.moved_by = other.moved_by;
        self.score = other.score;
        self.misfit = other.misfit;
    }

    /// Whether an estimate `z` (N, padded) is about the same as this one.
    pub fn has_estimate(&self, tuning: &BankTuning, z: &[f64]) -> bool {
        let stride = self.z.len();
        let pairs = self.z.iter().zip(z);
        let mut variances = self.cov.iter().step_by(stride + 1);
        pairs.zip(&mut variances).all(|((own, other), variance)| {
            let off = own - other;
            off * off <= tuning.same_estimate * variance
        })
    }

    /// How many entries of the state are in use.
    pub fn active(&self, layout: Layout, bias: bool) -> usize {
        if bias || self.flagged() != 0 {
            layout.size()
        } else {
            layout.fault()
        }
    }

    /// Forgets entry `k` and opens it with `variance` around `mean`.
    pub fn open(&mut self, k: usize, mean: f64, variance: f64) {
        let stride = self.z.len();
        self.cov[k * stride..(k + 1) * stride].fill(0.0);
        for row in self.cov.chunks_exact_mut(stride) {
            row[k] = 0.0;
        }
        self.cov[k * stride + k] = variance;
        self.z[k] = mean;
    }

    /// Kalman update; `seen` is spent.
    pub fn update(&mut self, layout: Layout, seen: &mut Innovation, bias: bool) {
        if !seen.regular {
            return;
        }
        let (p, stride) = (layout.p, layout.stride());
        let active = self.active(layout, bias);
        let width = padded(active);
        // The rows of `L^-1 C P`.
        for i in 0..p {
            let (done, rest) = seen.rows.split_at_mut(i * stride);
            let row = &mut rest[..width];
            for (&factor, other) in seen.s[i * p..].iter().zip(done.chunks_exact(stride)) {
                add_row(row, -factor, &other[..width]);
            }
            let scale = 1.0 / seen.s[i * p + i];
            row.iter_mut().for_each(|v| *v *= scale);
            add_row(&mut self.z[..width], seen.white[i], row);
        }
        for v in &mut self.z {
            *v = bounded(*v);
        }
        let rows = &seen.rows[..p * stride];
        subtract_squares(&mut self.cov, rows, stride, active, width);
    }

    /// One sample on. `scratch` holds n rows of the covariance.
    pub fn advance(&mut self, step: &Step<'_>, scratch: &mut [f64]) {
        let active = self.active(step.layout, step.bias);
        self.moved_by = self.mode;
        self.drift(step, scratch);
        self.propagate(step, active, scratch);
        self.move_state(step, scratch);
        self.rotate(step, active);
        self.wander(step);
        self.limit(step, active);
    }

    /// By how much each state changes (n), squared, where entries of the matrices are wrong by their size, after
    /// the input `moved` (m) and the state moved.
    pub fn unmodelled(
        &self,
        layout: Layout,
        model: &ModeModel,
        moved: &[f64],
        changes: &mut [f64],
    ) {
        for (i, change) in changes.iter_mut().enumerate() {
            let mut sum = 0.0;
            for &(at, a) in &model.motion.parts(i)[0] {
                let step = self.z[at] - self.before[at];
                sum += a * a * (step * step);
            }
            for &(at, b) in model.by_gain.row(i) {
                let s = moved[at - layout.gain()];
                sum += b * b * s * s;
            }
            *change = sum;
        }
    }

    /// The model's error acts as a load that moves as the state and the input move; loads, gain errors
    /// and the disturbance wander.
    fn drift(&mut self, step: &Step<'_>, scratch: &mut [f64]) {
        let Step {
            layout,
            model,
            settings,
            ..
        } = *step;
        let (stride, load, gain) = (layout.stride(), layout.load(), layout.gain());
        let error = if self.plant_changed {
            settings.changed_error * settings.changed_error
        } else {
            step.model_error
        };
        let changes = &mut scratch[..layout.n];
        self.unmodelled(layout, model, step.moved, changes);
        for (k, change) in (load + layout.state_load()..gain).zip(&*changes) {
            self.cov[k * stride + k] += error * change;
        }
        for (k, growth) in (load..).zip(&model.growth) {
            self.cov[k * stride + k] += growth;
        }
        for (pair, &(angle, least)) in step.waves.iter().enumerate() {
            let k = layout.n + 2 * pair;
            let amplitude = self.z[k] * self.z[k] + self.z[k + 1] * self.z[k + 1];
            let variance = angle * angle * amplitude + least;
            for k in [k, k + 1] {
                self.cov[k * stride + k] += variance;
            }
        }
        if step.bias {
            for q in 0..layout.p {
                let mut sum = 0.0;
                for &(at, c) in &model.outputs.parts(q)[0] {
                    let moved = self.z[at] - self.before[at];
                    sum += c * c * (moved * moved);
                }
                let k = layout.fault() + q;
                self.cov[k * stride + k] += error * sum;
            }
        }
        self.before.copy_from_slice(&self.z[..layout.n]);
    }

    /// `F P F'` but for the turning of the disturbance, in the rows of the plant's state.
    fn propagate(&mut self, step: &Step<'_>, active: usize, scratch: &mut [f64]) {
        let Step { layout, model, .. } = *step;
        let (n, stride, gain) = (layout.n, layout.stride(), layout.gain());
        let width = padded(active);
        for i in 0..n {
            let row = &mut scratch[i * stride..i * stride + width];
            let gains = model.by_gain.row(i).iter();
            let gains = gains.map(|&(at, b)| (at, b * step.u[at - gain]));
            let terms = model.motion.row(i).iter().copied().chain(gains);
            combine(row, &self.cov, stride, terms);
        }
        let rows = scratch.chunks_exact(stride).take(n);
        for (i, row) in rows.clone().enumerate() {
            self.cov[i * stride + n..i * stride + width].copy_from_slice(&row[n..width]);
        }
        for j in 0..n {
            let ([a, e, g], gains) = (model.motion.parts(j), model.by_gain.row(j));
            for (i, row) in rows.clone().enumerate().skip(j) {
                let mut sum = sparse_dot(a, row) + sparse_dot(e, row) + sparse_dot(g, row);
                for &(at, b) in gains {
                    sum += row[at] * b * step.u[at - gain];
                }
                self.cov[i * stride + j] = sum;
                self.cov[j * stride + i] = sum;
            }
            let start = step.settings.start_elsewhere[j];
            self.cov[j * stride + j] += step.tuning.state_floor * start * start;
        }
    }

    /// The next state of the plant.
    fn move_state(&mut self, step: &Step<'_>, scratch: &mut [f64]) {
        let Step { layout, model, .. } = *step;
        let next = &mut scratch[..layout.n];
        for (i, (next, offset)) in next.iter_mut().zip(&model.state_offset).enumerate() {
            let [a, e, g] = model.motion.parts(i).each_ref();
            let [a, e, g] = [a, e, g].map(|part| sparse_dot(part, &self.z));
            let mut sum = offset + g + a + e;
            for &(at, b) in model.by_gain.row(i) {
                sum += b * step.u[at - layout.gain()] * (1.0 + self.z[at]);
            }
            *next = bounded(sum);
        }
        self.z[..layout.n].copy_from_slice(next);
    }

    /// Faults wander.
    fn wander(&mut self, step: &Step<'_>) {
        if self.flagged() == 0 {
            return;
        }
        let (stride, fault) = (step.layout.stride(), step.layout.fault());
        let share = if self.convinced && !step.settings.trusts_model() {
            step.settings.fault_walk
        } else {
            step.settings.drift_walk
        };
        for (q, noise) in step.noise.iter().enumerate() {
            let k = fault + q;
            if has(self.additive, q) {
                self.cov[k * stride + k] += share * share * noise * noise;
            }
            if has(self.scaled, q) {
                self.cov[k * stride + k] += step.tuning.gain_fault_walk;
            }
        }
    }

    /// The disturbance turns; then what stands below the rows of plant state and disturbance is made
    /// their mirror image.
    fn rotate(&mut self, step: &Step<'_>, active: usize) {
        let layout = step.layout;
        let stride = layout.stride();
        let (first, last) = (layout.n, layout.load());
        for (h, &(c, s)) in step.rotation.iter().enumerate() {
            let k = first + 2 * h;
            let (a, b) = (self.z[k], self.z[k + 1]);
            self.z[k] = c * a + s * b;
            self.z[k + 1] = c * b - s * a;
            let (above, below) = self.cov.split_at_mut((k + 1) * stride);
            turn((c, s), &mut above[k * stride..], &mut below[..stride]);
            for row in self.cov.chunks_exact_mut(stride).take(last) {
                if let [x, y] = &mut row[k..k + 2] {
                    (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
                }
            }
            let mean = 0.5 * (self.cov[k * stride + k + 1] + self.cov[(k + 1) * stride + k]);
            self.cov[k * stride + k + 1] = mean;
            self.cov[(k + 1) * stride + k] = mean;
        }
        mirror(&mut self.cov, stride, last, active, last);
        mirror(&mut self.cov, stride, first, last, first);
    }

    /// Keeps every variance below what is thought possible.
    fn limit(&mut self, step: &Step<'_>, active: usize) {
        let Step { layout, model, .. } = *step;
        let (load, gain, fault) = (layout.load(), layout.gain(), layout.fault());
        for (k, &most) in model.most[..fault].iter().enumerate() {
            let most = if (load..gain).contains(&k) {
                step.tuning.load_limit * most.max(self.z[k] * self.z[k])
            } else {
                most
            };
            self.keep_below(step, active, k, most);
        }
        for k in fault..active {
            let size = step.settings.fault_size[k - fault];
            let most = match has(self.flagged(), k - fault) {
                true => step.tuning.fault_limit * size * size,
                false => model.most[k],
            };
            self.keep_below(step, active, k, most);
        }
    }

    #[inline]
    fn keep_below(&mut self, step: &Step<'_>, active: usize, k: usize, most: f64) {
        let stride = step.layout.stride();
        let variance = self.cov[k * stride + k];
        if (0.0..=most).contains(&variance) {
            return;
        }
        if variance.is_nan() || variance < 0.0 {
            // Cancellation has spoilt it: start anew.
            let start = step.settings.start_elsewhere.get(k);
            let fresh = start.map_or(most, |start| start * start);
            self.open(k, self.z[k], fresh);
            return;
        }
        let scale = if variance.is_finite() {
            libm::sqrt(most / variance)
        } else {
            0.0
        };
        for v in &mut self.cov[k * stride..k * stride + active] {
            let scaled = *v * scale;
            *v = if scaled.is_finite() { scaled } else { 0.0 };
        }
        for j in 0..active {
            self.cov[j * stride + k] = self.cov[k * stride + j];
        }
        self.cov[k * stride + k] = most;
    }

    /// Loads jump, and input gains with them, with effect on the state at once.
    pub fn jump(
        &mut self,
        layout: Layout,
        model: &ModeModel,
        jump: &Jump,
        u: &[f64],
        gain_error: f64,
    ) {
        let Layout { n, m, .. } = layout;
        let (stride, load, gain) = (layout.stride(), layout.load(), layout.gain());
        let loads = layout.loads();
        for k in jump.loads.clone() {
            let size = jump.scale * model.load_size[k];
            let variance = size * size;
            let at = load + k;
            self.cov[at * stride + at] += variance;
            for i in 0..n {
                let left = variance * model.g[i * loads + k];
                if left == 0.0 {
                    continue;
                }
                self.cov[i * stride + at] += left;
                self.cov[at * stride + i] += left;
                for j in 0..n {
                    self.cov[i * stride + j] += left * model.g[j * loads + k];
                }
            }
        }
        for k in jump.gains.clone() {
            let variance = gain_error * gain_error;
            self.cov[(gain + k) * stride + gain + k] += variance;
            for i in 0..n {
                let left = model.b[i * m + k] * u[k];
                self.cov[i * stride + gain + k] += variance * left;
                self.cov[(gain + k) * stride + i] += variance * left;
                for j in 0..n {
                    self.cov[i * stride + j] += variance * left * (model.b[j * m + k] * u[k]);
                }
            }
        }
    }
}
