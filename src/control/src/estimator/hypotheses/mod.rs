//! The state-based fault estimator: hypotheses in competition by likelihood, each with its prior probability.
//!
//! One Kalman filter of the joint state `[x; d; l; g; f]` stands for each hypothesis: plant state,
//! periodic disturbance, loads on the state, relative errors of the input gains, sensor faults. A
//! sample may mean that nothing happened, that a load or an input gain jumped, that sensors failed (by a
//! bias, a wrong gain, a frozen value), changed their fault, or recovered. Each of these has a
//! probability per sample, and the likelihood of the readings decides between what they leave.
//!
//! A sensor fault counts where the sensor's reading left what is expected of it within one sample, or
//! repeats one value while the model moves, and where it beats the best explanation without one by
//! given odds. What grows slowly can be a load or a sensor's drift: `suspect` names the sensors, and
//! the policy decides. Where no hypothesis fits, the readings are used as they are and `model_valid` is false.

mod candidates;
mod competition;
mod effect;
mod expectation;
mod hypothesis;
mod linear;
mod model;
mod model_run;
mod modes;
mod propose;
mod start;
mod trial;
mod without_repeats;

use crate::tuning::{BankTuning, MOST_KEPT};
use alloc::vec::Vec;
pub use hypothesis::{Hypothesis, Reading, Sensors, has};
pub use model::Layout;

use super::super::parameters::Hypotheses;
use crate::compensation::is_measurement;
use crate::kernel::LARGEST;
use candidates::Candidates;
use expectation::Expectation;
use hypothesis::{Innovation, Step};
use linear::dot;
use model::ModeModel;
use model_run::ModelRun;
use serde::{Deserialize, Serialize};

/// Most modes where the mode is not told: each but the leading one needs a hypothesis.
pub const MOST_MODES: usize = 9;
/// Least deviation of a sensor's noise, output units: its square is far above underflow.
const SMALLEST_NOISE: f64 = 1e-150;
/// Most hypotheses that may exist while a sample is judged.
const SLOTS: usize = 2 * MOST_KEPT + MOST_MODES - 1;

/// The estimator: immutable, shared by any number of [`BankState`]s.
#[derive(Clone, Debug)]
pub struct Bank {
    layout: Layout,
    modes: Vec<ModeModel>,
    settings: Hypotheses,
    tuning: BankTuning,
    rotation: Vec<(f64, f64)>,
    /// Of each pair of the disturbance: the error of its angle, and the least growth of its variance.
    waves: Vec<(f64, f64)>,
    log_rates: LogRates,
    /// Whether a switch shows in the sample in which it happens (modes x modes).
    at_once: Vec<bool>,
    /// Noise deviation of each sensor over its threshold (p).
    noise_per_threshold: Vec<f64>,
}

/// Logarithms of the probabilities per sample.
#[derive(Clone, Copy, Debug)]
struct LogRates {
    fault: f64,
    stuck: f64,
    release: f64,
    change: f64,
    load: f64,
    changed: f64,
    /// Where the mode is not told.
    mode: Option<f64>,
}

/// The slots in use, the leading hypothesis first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct SlotsInUse {
    list: [u8; SLOTS],
    count: usize,
}

impl SlotsInUse {
    const NONE: Self = Self {
        list: [0; SLOTS],
        count: 0,
    };

    fn slots(self) -> impl Iterator<Item = usize> {
        self.list.into_iter().take(self.count).map(usize::from)
    }

    fn first(self) -> usize {
        usize::from(self.list[0])
    }

    fn contains(self, slot: usize) -> bool {
        self.slots().any(|s| s == slot)
    }

    fn add(&mut self, slot: usize) {
        if let Some(entry) = self.list.get_mut(self.count) {
            *entry = slot as u8;
            self.count += 1;
        }
    }

    fn lead(&mut self, slot: usize) {
        if let Some(at) = self.slots().position(|s| s == slot) {
            self.list.swap(0, at);
        }
    }

    /// Whether every slot exists, and each once.
    fn is_consistent(self, slots: usize) -> bool {
        let mut seen = [false; SLOTS];
        let seen = &mut seen[..slots.min(SLOTS)];
        (1..=seen.len()).contains(&self.count)
            && self.slots().all(|s| {
                seen.get_mut(s)
                    .is_some_and(|seen| !core::mem::replace(seen, true))
            })
    }
}

/// What changes at run time.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct BankState {
    slots: Vec<Hypothesis>,
    seen: Vec<Innovation>,
    in_use: SlotsInUse,
    candidates: Candidates,
    scratch: Vec<f64>,
    expectation: Expectation,
    trial: Innovation,
    /// The plant's mode (0-based) by the leading hypothesis.
    mode: usize,
    /// The mode that moved the model in open loop to this sample.
    moved_by: u32,
    /// The input that acted last (m), and how it moved (m).
    u: Vec<f64>,
    moved: Vec<f64>,
    first: bool,
    /// Noise deviation of each sensor (p).
    noise: Vec<f64>,
    /// Its variance relative to the design's (p), and how many samples it rests on.
    noise_ratio: Vec<f64>,
    noise_samples: f64,
    /// Variance of the model's error relative to the assumed one, and how many samples it rests on (modes each).
    model_share: Vec<f64>,
    model_samples: Vec<f64>,
    /// What the model's error of the last sample adds to the variance of each output (p).
    from_model: Vec<f64>,
    /// Evidence that a sensor repeats one value, the same before this sample, that value's mean, and of how
    /// many samples (p each).
    evidence: Vec<f64>,
    evidence_before: Vec<f64>,
    /// The reading that repeats, and the output of the model in open loop when it came first (p each).
    repeated: Vec<f64>,
    moved_from: Vec<f64>,
    mean: Vec<f64>,
    count: Vec<f64>,
    /// Sensors that show their last reading once more.
    repeating: Sensors,
    /// Sensors that did so a sample ago and do not now.
    resumed: Sensors,
    best: usize,
    /// Sensors that loads have moved away from the model in open loop.
    apart: Sensors,
    /// Running mean of the leading hypothesis's squared whitened innovation.
    misfit: f64,
    /// The model in open loop under the commands alone.
    unloaded: ModelRun,
    /// The same under the loads and gain errors that are usual.
    usual: ModelRun,
    /// Outputs that the leading hypothesis expects of healthy sensors (p).
    pub expected: Vec<f64>,
    /// What the readings leave unexplained; of a flagged sensor its fault (p).
    pub residual: Vec<f64>,
    /// Sensors whose reading is not used.
    pub flagged: Sensors,
    /// Sensors whose slow divergence could be a fault.
    pub suspect: Sensors,
    /// Whether the model explains the readings.
    pub model_valid: bool,
    /// What acts on the plant beside the command, as an input (m).
    pub load: Vec<f64>,
    /// Of each mode its probability, where the mode is not told (modes).
    pub probability: Vec<f64>,
    /// Inputs on which that exceeds the size of a usual load, as bits.
    pub actuator_fault: u64,
}

crate::state!(BankState {
    parts: [
        slots,
        seen,
        candidates,
        scratch,
        expectation,
        trial,
        u,
        moved,
        noise,
        noise_ratio,
        model_share,
        model_samples,
        from_model,
        evidence,
        evidence_before,
        repeated,
        moved_from,
        mean,
        count,
        unloaded,
        usual,
        expected,
        residual,
        load,
        probability
    ],
    constants: [],
    counters: [
        in_use,
        mode,
        moved_by,
        first,
        noise_samples,
        repeating,
        resumed,
        best,
        apart,
        misfit,
        flagged,
        suspect,
        model_valid,
        actuator_fault
    ]
});

impl Bank {
    /// Judges the readings `y` (p) of a sample, taken in `mode` (0-based) unless the estimator finds it;
    /// what is no measurement tells nothing. A threshold other than the design's scales the noise of its sensor.
    pub fn observe(&self, state: &mut BankState, mode: usize, y: &[f64], thresholds: &[f64]) {
        let mut noise = core::mem::take(&mut state.noise);
        let scales = thresholds.iter().zip(&self.noise_per_threshold);
        for ((deviation, (&threshold, &share)), &ratio) in
            noise.iter_mut().zip(scales).zip(&state.noise_ratio)
        {
            *deviation =
                (threshold.abs() * share * libm::sqrt(ratio)).clamp(SMALLEST_NOISE, LARGEST);
        }
        let mut valid = 0;
        for (q, &value) in y.iter().enumerate().take(Sensors::BITS as usize) {
            valid |= Sensors::from(is_measurement(value)) << q;
        }
        self.judge(
            state,
            mode,
            Reading {
                y,
                valid,
                noise: &noise,
            },
        );
        state.noise = noise;
    }

    fn judge(&self, state: &mut BankState, mode: usize, reading: Reading<'_>) {
        let (layout, tuning) = (self.layout, &self.tuning);
        let p = layout.p;
        if self.log_rates.mode.is_none() {
            self.tell(state, mode);
        }
        let bias = self.output_error();
        self.predict_without_repeats(state, reading);
        let z = &state.slots[state.best].z;
        let model = self.model(state, state.best);
        for run in [&mut state.unloaded, &mut state.usual] {
            run.read(model, (&self.settings, &self.tuning), z, reading.noise);
        }
        for slot in state.in_use.slots() {
            let model = self.model(state, slot);
            let h = &state.slots[slot];
            let seen = &mut state.seen[slot];
            seen.predict(layout, model, reading, h, bias);
        }
        let leading_slot = state.in_use.first();
        self.watch(state, leading_slot, reading);
        for slot in state.in_use.slots() {
            state.seen[slot].whiten(p);
        }
        self.learn_model_error(state, leading_slot, reading);
        let h = &state.slots[leading_slot];
        let nothing_happened = h.flagged() == 0
            && !h.plant_changed
            && state.seen[leading_slot].square < tuning.quiet(p)
            && state.seen[leading_slot].regular
            && state.evidence.iter().all(|&e| e < tuning.frozen_evidence)
            && !state.first
            && state.apart == 0
            && !(self.settings.trusts_model() && state.suspect != 0)
            && self.leads_alone(state);
        if nothing_happened {
            self.continue_all(state);
        } else {
            self.compete(state, reading);
        }
        self.update_without_repeats(state);
        state.first = false;
        state.mode = state.slots[state.best].mode as usize;
        self.correct_model_runs(state, reading);
        self.learn_noise(state, reading);
        self.conclude(state, reading);
        let displaced = state.unloaded.displaced(&state.expected, tuning.displaced);
        state.apart = state.unloaded.displaced(&state.expected, tuning.returned);
        state.unloaded.learn(tuning, &state.expected);
        state.usual.learn(tuning, &state.expected);
        let best = &state.slots[state.best];
        if best.flagged() == 0 && !best.plant_changed {
            state.usual.learn_loads(tuning, layout, &best.z);
        }
        state.suspect |= displaced & !state.slots[state.best].flagged();
    }

    /// Noise of the sensors that are used, from the innovations of the leading hypothesis: the mean
    /// of the noise's square given the reading. The design's noise is the least.
    fn learn_noise(&self, state: &mut BankState, reading: Reading<'_>) {
        let (p, tuning) = (self.layout.p, &self.tuning);
        let (seen, flagged) = (&state.seen[state.best], state.slots[state.best].flagged());
        if !seen.regular {
            return;
        }
        state.noise_samples = (state.noise_samples + 1.0).min(tuning.noise_memory);
        for q in 0..p {
            if !has(reading.valid & !flagged, q) {
                continue;
            }
            let factor = &seen.s[q * p..=q * p + q];
            let variance = dot(factor, factor);
            let noise = reading.noise[q] * reading.noise[q];
            let share = noise / variance;
            let square = (seen.r[q] * seen.r[q]).min(tuning.outlier * variance);
            let relative = share * (square / variance) + (1.0 - share);
            if relative.is_finite() {
                let ratio = &mut state.noise_ratio[q];
                *ratio += *ratio * (relative - 1.0) / state.noise_samples;
                *ratio = ratio.clamp(1.0, tuning.noise_limit);
            }
        }
    }

    /// How wrong the model of the mode that moved the plant is, from the innovations of the hypothesis in `slot`,
    /// whatever they are taken for: a step of Fisher scoring for the share of the assumed variance.
    fn learn_model_error(&self, state: &mut BankState, slot: usize, reading: Reading<'_>) {
        let (p, tuning) = (self.layout.p, &self.tuning);
        let (seen, h) = (&state.seen[slot], &state.slots[slot]);
        if !seen.regular || h.plant_changed {
            return;
        }
        let mode = h.moved_by as usize;
        for q in (0..p).filter(|&q| has(reading.valid & !h.flagged(), q)) {
            let factor = &seen.s[q * p..=q * p + q];
            let variance = dot(factor, factor);
            let part = state.from_model[q] / variance;
            let square = (seen.r[q] * seen.r[q] / variance).min(tuning.outlier);
            if (part * square).is_finite() {
                let samples = &mut state.model_samples[mode];
                // In this order a damaged saved state is mended: what is no number becomes the bound.
                *samples = (*samples + part * part)
                    .max(tuning.model_prior)
                    .min(tuning.model_memory);
                let share = &mut state.model_share[mode];
                *share += *share * part * (square - 1.0) / *samples;
                *share = share
                    .max(tuning.model_share_least)
                    .min(tuning.model_share_most);
            }
        }
    }

    /// What the model's error does to the outputs of the coming sample.
    fn expect_model_error(&self, state: &mut BankState) {
        let Layout { n, .. } = self.layout;
        let h = &state.slots[state.best];
        let model = &self.modes[h.mode as usize];
        let error = self.model_error(&state.model_share, h.mode);
        let scratch = &mut state.scratch[..n];
        h.unmodelled(self.layout, model, &state.moved, scratch);
        for (row, from_model) in model.c.chunks_exact(n).zip(&mut state.from_model) {
            let terms = row.iter().zip(&*scratch);
            *from_model = error * terms.map(|(c, v)| c * c * v).sum::<f64>();
        }
    }

    /// Variance of the relative error of the entries of the matrices of `mode`, as far as it is known.
    fn model_error(&self, shares: &[f64], mode: u32) -> f64 {
        self.settings.model_error * self.settings.model_error * shares[mode as usize]
    }

    /// Which sensors repeat one value while the model moves.
    fn watch(&self, state: &mut BankState, slot: usize, reading: Reading<'_>) {
        let (p, tuning) = (self.layout.p, &self.tuning);
        let (h, seen) = (&state.slots[slot], &state.seen[slot]);
        state.evidence_before.copy_from_slice(&state.evidence);
        for q in 0..p {
            let y = reading.y[q];
            if has(reading.valid, q) && y != state.repeated[q] {
                state.repeated[q] = y;
                state.moved_from[q] = state.unloaded.y[q];
            }
            if !has(reading.valid, q) || has(h.stuck, q) {
                state.evidence[q] = 0.0;
                state.count[q] = 0.0;
                continue;
            }
            let variance = reading.noise[q] * reading.noise[q];
            let moved = state.unloaded.y[q] - state.moved_from[q];
            if state.count[q] == 0.0 {
                state.mean[q] = y;
                state.count[q] = 1.0;
                state.evidence[q] = 0.0;
                continue;
            }
            let off = y - state.mean[q];
            let s = seen.s[q * p + q];
            let gain = 0.5 * (seen.r[q] * seen.r[q] / s).min(tuning.frozen_outlier)
                - 0.5 * off * off / (variance * (1.0 + 1.0 / state.count[q]))
                - tuning.frozen_loss;
            let repeats = moved * moved > tuning.displaced * variance;
            state.evidence[q] += if repeats {
                gain.max(tuning.repeat_evidence)
            } else {
                gain
            };
            if state.evidence[q] <= 0.0 {
                state.evidence[q] = 0.0;
                state.mean[q] = y;
                state.count[q] = 1.0;
            } else {
                state.count[q] += 1.0;
                state.mean[q] += off / state.count[q].min(tuning.frozen_memory);
            }
        }
    }

    /// The model in open loop, where it moved in a mode that the plant was not in.
    fn correct_model_runs(&self, state: &mut BankState, reading: Reading<'_>) {
        let best = &state.slots[state.best];
        if best.moved_by == state.moved_by {
            return;
        }
        state.moved_by = best.moved_by;
        let moved = &self.modes[best.moved_by as usize];
        let next = &mut state.scratch[..self.layout.n];
        let model = &self.modes[state.mode];
        for run in [&mut state.unloaded, &mut state.usual] {
            run.repeat(self.layout, moved, &state.u, next);
            run.read(
                model,
                (&self.settings, &self.tuning),
                &best.z,
                reading.noise,
            );
        }
    }

    fn conclude(&self, state: &mut BankState, reading: Reading<'_>) {
        let p = self.layout.p;
        let model = &self.modes[state.mode];
        let h = &state.slots[state.best];
        for (q, expected) in state.expected.iter_mut().enumerate() {
            *expected = model.output(q, &h.z, &h.z);
        }
        let all = if p >= 64 { u64::MAX } else { (1 << p) - 1 };
        state.flagged = h.flagged() | (all & !reading.valid);
        for q in 0..p {
            state.residual[q] = if has(h.flagged(), q) {
                reading.y[q] - state.expected[q]
            } else {
                state.seen[state.best].r[q]
            };
        }
        let square = state.seen[state.best].square;
        state.misfit = self.tuning.averaged(state.misfit, square, 0.0);
        state.model_valid =
            state.misfit < self.tuning.misfit_invalid * p as f64 && !h.plant_changed;
        self.find_load(state, model);
        state.actuator_fault = 0;
        for (j, (load, size)) in state.load.iter().zip(&self.settings.input_load).enumerate() {
            state.actuator_fault |= u64::from(load.abs() > *size && j < 64) << (j & 63);
        }
    }

    /// Load and gain error of the leading hypothesis as an input.
    fn find_load(&self, state: &mut BankState, model: &ModeModel) {
        let Layout { n, m, .. } = self.layout;
        let (load, gain) = (self.layout.load(), self.layout.gain());
        let z = &state.slots[state.best].z;
        for j in 0..m {
            state.load[j] = z[load + j] + state.u[j] * z[gain + j];
        }
        for i in 0..n {
            let others = model.motion.parts(i)[2].iter();
            let mut effect = 0.0;
            for &(at, g) in others.filter(|(at, _)| *at >= load + m) {
                effect += g * z[at];
            }
            for (j, sum) in state.load.iter_mut().enumerate() {
                *sum += model.b_inverse[j * n + i] * effect;
            }
        }
    }

    /// Right after [`observe`](Self::observe): `expected` becomes its change for a small change `dy`
    /// (p) of the readings. Spoils the state.
    pub fn differentiate(&self, state: &mut BankState, dy: &[f64]) {
        let Layout { n, p, d, .. } = self.layout;
        let stride = self.layout.stride();
        let Some(model) = self.modes.get(state.mode) else {
            return;
        };
        let best = state.best;
        let (seen, h) = (&mut state.seen[best], &mut state.slots[best]);
        h.z.fill(0.0);
        if seen.regular {
            for q in 0..p {
                // What is no measurement has a row of zeros.
                seen.white[q] = dy.get(q).copied().unwrap_or(0.0);
            }
            linear::solve(&seen.s, p, &mut seen.white);
            for (row, &white) in seen.rows.chunks_exact(stride).zip(&seen.white) {
                linear::axpy(&mut h.z, white, row);
            }
        }
        for q in 0..p {
            state.expected[q] = dot(&model.c[q * n..(q + 1) * n], &h.z[..n])
                + dot(&model.f[q * d..(q + 1) * d], &h.z[n..n + d]);
        }
        self.find_load(state, model);
    }

    /// One sample on, under the input that acts (m).
    pub fn advance(&self, state: &mut BankState, u: &[f64]) {
        let model = &self.modes[state.mode];
        for ((d, &new), old) in state.moved.iter_mut().zip(u).zip(&mut state.u) {
            *d = new - *old;
            *old = new;
        }
        let z = &state.slots[state.best].z;
        let next = &mut state.scratch[..self.layout.n];
        for run in [&mut state.unloaded, &mut state.usual] {
            run.advance(self.layout, model, z, u, next);
        }
        state.moved_by = state.mode as u32;
        self.expect_model_error(state);
        self.branch(state, false);
        let mut step = Step {
            layout: self.layout,
            model,
            settings: &self.settings,
            tuning: &self.tuning,
            model_error: 0.0,
            noise: &state.noise,
            rotation: &self.rotation,
            waves: &self.waves,
            bias: self.output_error(),
            u,
            moved: &state.moved,
        };
        for slot in state
            .in_use
            .slots()
            .chain(self.in_use_without_repeats(state))
        {
            let mode = state.slots[slot].mode;
            step.model = &self.modes[mode as usize];
            step.model_error = self.model_error(&state.model_share, mode);
            state.slots[slot].advance(&step, &mut state.scratch);
        }
        self.branch(state, true);
    }
}

impl BankState {
    /// Whether every index in it is one; a state that came as bytes may hold any.
    pub fn is_consistent(&self) -> bool {
        let modes = self.probability.len();
        let exists = |h: &Hypothesis| h.mode.max(h.moved_by) < modes as u32;
        self.in_use
            .is_consistent(self.slots.len().saturating_sub(1))
            && self.in_use.contains(self.best)
            && self.mode < modes
            && self.slots.iter().all(exists)
    }

    /// Takes every sensor for healthy whose readings `y` (p) are numbers: the loop is not the one that was designed.
    pub fn accept_readings(&mut self, y: &[f64]) {
        self.flagged = 0;
        for (q, &value) in y.iter().enumerate().take(Sensors::BITS as usize) {
            self.flagged |= Sensors::from(!is_measurement(value)) << q;
        }
        let left = &self.seen[self.best].r;
        self.residual.copy_from_slice(left);
        self.model_valid = false;
    }

    /// The plant's mode (0-based) by the leading hypothesis, and the mode that moved it to this sample.
    pub fn mode(&self) -> (usize, usize) {
        (self.mode, self.best().moved_by as usize)
    }

    /// The hypotheses in competition.
    pub fn hypotheses(&self) -> impl Iterator<Item = &Hypothesis> {
        self.in_use.slots().filter_map(|slot| self.slots.get(slot))
    }

    /// The leading hypothesis.
    pub fn best(&self) -> &Hypothesis {
        &self.slots[self.best]
    }
}
