//! From the plant and the settings to an estimator ready to run.

use super::candidates::Candidates;
use super::expectation::Expectation;
use super::hypothesis::{Hypothesis, Innovation};
use super::linear::{axpy, factor, solve};
use super::model::{Layout, ModeModel};
use super::model_run::ModelRun;
use super::modes::differ_at_once;
use super::{Bank, BankState, LogRates, SlotsInUse};
use crate::matrix::Matrix;
use crate::parameters::{Hypotheses, ModeModel as Described};
use crate::tuning::BankTuning;
use alloc::vec;
use alloc::vec::Vec;

fn rows(matrix: &Matrix) -> Vec<f64> {
    let (rows, columns) = matrix.shape();
    let entry = |row, column| matrix.get(row, column).unwrap_or(0.0);
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| entry(row, column)))
        .collect()
}

/// The exosystem's output through `channels` (rows x s): the sine of each harmonic of each channel.
fn waves(channels: &Matrix, harmonics: usize) -> Vec<f64> {
    let (count, columns) = channels.shape();
    rows(&Matrix::from_fn(
        count,
        2 * harmonics * columns,
        |row, wave| {
            if wave % 2 == 0 {
                channels
                    .get(row, wave / 2 / harmonics.max(1))
                    .unwrap_or(0.0)
            } else {
                0.0
            }
        },
    ))
}

/// `(B'B)^-1 B'` (m x n, row after row) of `b` (n x m, row after row), slightly regularised.
fn left_inverse(b: &[f64], n: usize, m: usize) -> Vec<f64> {
    let mut lower = vec![0.0; m * m];
    for row in b.chunks_exact(m) {
        for (sums, &left) in lower.chunks_exact_mut(m).zip(row) {
            axpy(sums, left, row);
        }
    }
    let trace: f64 = (0..m).map(|j| lower[j * m + j]).sum();
    for j in 0..m {
        lower[j * m + j] += 1e-12 * trace + f64::MIN_POSITIVE;
    }
    let mut out = vec![0.0; m * n];
    if !factor(&mut lower, m) {
        return out;
    }
    for (i, row) in b.chunks_exact(m).enumerate() {
        let mut column = row.to_vec();
        solve(&lower, m, &mut column);
        for j in (0..m).rev() {
            for k in j + 1..m {
                column[j] -= lower[k * m + j] * column[k];
            }
            column[j] /= lower[j * m + j];
        }
        for (j, &value) in column.iter().enumerate() {
            out[j * n + i] = value;
        }
    }
    out
}

/// What loads do to the states (n x loads), how large they are, and how their variances and those
/// of the gain errors grow per sample: on each input, each channel of the
/// disturbance, each state.
fn loads(
    layout: Layout,
    mode: &Described,
    settings: &Hypotheses,
) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let Layout { n, m, s, .. } = layout;
    let effect = Matrix::from_fn(n, layout.loads(), |i, k| match k {
        k if k < m => mode.b.get(i, k).unwrap_or(0.0),
        k if k < m + s => mode.e.get(i, k - m).unwrap_or(0.0),
        k => f64::from(k - m - s == i),
    });
    let mut sizes = settings.input_load.clone();
    sizes.extend(&settings.disturbance_load);
    for i in 0..n {
        let mut sum = 0.0;
        for (j, size) in settings.state_load.iter().enumerate() {
            let still = f64::from(i == j) - mode.a.get(i, j).unwrap_or(0.0);
            sum += (still * size) * (still * size);
        }
        sizes.push(libm::sqrt(sum));
    }
    let mut walks: Vec<f64> = sizes.iter().map(|size| settings.load_walk * size).collect();
    walks[m..m + s].copy_from_slice(&settings.disturbance_walk);
    walks.resize(walks.len() + m, settings.gain_walk);
    let growth = walks.iter().map(|walk| walk * walk).collect();
    (rows(&effect), sizes, growth)
}

fn model(
    layout: Layout,
    mode: &Described,
    settings: &Hypotheses,
    tuning: &BankTuning,
) -> ModeModel {
    let Layout { n, m, .. } = layout;
    let (b, c) = (rows(&mode.b), rows(&mode.c));
    let spread = |row: &[f64]| {
        let parts = row.iter().zip(&settings.state_size);
        tuning.usual_deviation * parts.map(|(c, size)| (c * size) * (c * size)).sum::<f64>()
    };
    let bias: Vec<f64> = c.chunks_exact(n).map(spread).collect();
    let inverse = left_inverse(&b, n, m);
    let loads = loads(layout, mode, settings);
    let error = settings.model_error;
    let starts = settings.start_elsewhere.iter();
    let most = starts
        .map(|size| tuning.state_limit * size * size)
        .chain(settings.disturbance_size.iter().map(|size| size * size))
        .chain(loads.1.iter().map(|size| size * size))
        .chain((0..m).map(|_| settings.gain_error * settings.gain_error))
        .chain(bias.iter().map(|bias| bias * error * error))
        .collect();
    let harmonics = settings.harmonics();
    ModeModel::new(
        layout,
        rows(&mode.a),
        b,
        c,
        waves(&mode.e, harmonics),
        waves(&mode.f, harmonics),
        (&mode.x0, &mode.u0, &mode.y0),
        loads,
        (bias, most),
        (libm::log(settings.load_rate), tuning),
        inverse,
    )
}

/// The modes, with what logs say of them.
fn as_fitted<'a>(
    modes: &'a [Described],
    settings: &'a Hypotheses,
) -> impl Iterator<Item = Described> + 'a {
    modes.iter().enumerate().map(|(at, mode)| {
        let mut mode = mode.clone();
        if let Some(fitted) = settings.fitted.get(at) {
            mode.a.clone_from(&fitted.a);
            mode.b.clone_from(&fitted.b);
            mode.c.clone_from(&fitted.c);
            mode.e.clone_from(&fitted.e);
            mode.f.clone_from(&fitted.f);
        }
        mode
    })
}

/// Per pair of the disturbance's `d` states: the error of its angle, and the least growth of its variance.
fn waves_of(
    settings: &Hypotheses,
    tuning: &BankTuning,
    angles: &[f64],
    d: usize,
) -> Vec<(f64, f64)> {
    let sizes = settings.disturbance_size.iter().step_by(2);
    let angles = angles.iter().cycle();
    let pairs = angles.zip(sizes).take(d / 2);
    pairs
        .map(|(angle, size)| {
            (
                settings.period_error * angle,
                tuning.wave_floor * (size * size),
            )
        })
        .collect()
}

impl Bank {
    /// The estimator of a plant with these `modes` and decision `thresholds` (p); the sizes in `settings`
    /// must agree with it.
    pub fn new(
        modes: &[Described],
        sample_time: f64,
        settings: &Hypotheses,
        tuning: BankTuning,
        thresholds: &[f64],
    ) -> Self {
        let period = settings.period.iter();
        let angles: Vec<f64> = period.flat_map(|known| known.angles(sample_time)).collect();
        let (n, m, p) = modes.first().map_or((0, 0, 0), |mode| {
            (mode.a.nrows(), mode.b.ncols(), mode.c.nrows())
        });
        let disturbances = settings.disturbance_load.len();
        let d = 2 * settings.harmonics() * disturbances;
        let layout = Layout {
            n,
            m,
            p,
            d,
            s: disturbances,
        };
        let ln = libm::log;
        let turn = |_| {
            angles
                .iter()
                .map(|&angle| (libm::cos(angle), libm::sin(angle)))
        };
        let modes: Vec<ModeModel> = as_fitted(modes, settings)
            .map(|mode| model(layout, &mode, settings, &tuning))
            .collect();
        let pairs = modes
            .iter()
            .flat_map(|one| modes.iter().map(move |other| (one, other)));
        Self {
            layout,
            at_once: pairs
                .map(|(one, other)| differ_at_once(one, other, &settings.noise))
                .collect(),
            modes,
            rotation: (0..disturbances).flat_map(turn).collect(),
            waves: waves_of(settings, &tuning, &angles, d),
            log_rates: LogRates {
                fault: ln(settings.fault_rate),
                stuck: ln(settings.stuck_rate),
                release: ln(settings.release_rate),
                change: ln(settings.change_rate),
                load: ln(settings.load_rate),
                changed: tuning.everything * ln(settings.load_rate),
                mode: settings.mode_rate.map(ln),
            },
            noise_per_threshold: settings
                .noise
                .iter()
                .zip(thresholds)
                .map(|(noise, threshold)| noise / threshold.abs().max(f64::MIN_POSITIVE))
                .collect(),
            settings: settings.clone(),
            tuning,
        }
    }

    /// Whether there are more sensors than states, so that they contradict each other where the
    /// model's output matrix is wrong.
    pub(super) const fn output_error(&self) -> bool {
        self.layout.p > self.layout.n
    }

    /// At rest at the operating point of `mode`; where the mode is not told, that of any other may be
    /// the plant's as well.
    pub fn start(&self, mode: usize) -> BankState {
        let layout = self.layout;
        let Layout { n, m, p, .. } = layout;
        let stride = layout.stride();
        let settings = &self.settings;
        let model = &self.modes[mode];
        let others = (0..self.others()).map(|k| if k < mode { k } else { k + 1 });
        let mut slots: Vec<Hypothesis> = core::iter::once(mode)
            .chain(others)
            .map(|mode| self.at_rest(mode))
            .collect();
        let mut in_use = SlotsInUse::NONE;
        (0..slots.len()).for_each(|slot| in_use.add(slot));
        slots.resize(self.slot_without_repeats() + 1, Hypothesis::new(layout));
        BankState {
            seen: vec![Innovation::new(layout); slots.len()],
            candidates: Candidates::new(slots.len(), p, model.jumps.len()),
            slots,
            in_use,
            probability: vec![0.0; self.modes.len()],
            scratch: vec![0.0; n.max(1) * stride],
            expectation: Expectation::new(p),
            trial: Innovation::new(layout),
            mode,
            moved_by: mode as u32,
            u: model.u0.clone(),
            moved: vec![0.0; m],
            first: true,
            noise: vec![0.0; p],
            noise_ratio: vec![self.tuning.noise_at_start; p],
            noise_samples: self.tuning.noise_prior,
            model_share: vec![1.0; self.modes.len()],
            model_samples: vec![self.tuning.model_prior; self.modes.len()],
            from_model: vec![0.0; p],
            evidence: vec![0.0; p],
            evidence_before: vec![0.0; p],
            repeated: vec![0.0; p],
            moved_from: vec![0.0; p],
            mean: vec![0.0; p],
            count: vec![0.0; p],
            repeating: 0,
            resumed: 0,
            best: 0,
            apart: 0,
            misfit: p as f64,
            unloaded: ModelRun::new(model, settings, layout.size()),
            usual: ModelRun::new(model, settings, layout.size()),
            expected: vec![0.0; p],
            residual: vec![0.0; p],
            flagged: 0,
            suspect: 0,
            model_valid: true,
            load: vec![0.0; m],
            actuator_fault: 0,
        }
    }

    /// The hypothesis that the plant is at rest at the operating point of `mode`.
    fn at_rest(&self, mode: usize) -> Hypothesis {
        let (layout, settings) = (self.layout, &self.settings);
        let Layout { n, m, d, .. } = layout;
        let stride = layout.stride();
        let model = &self.modes[mode];
        let mut rest = Hypothesis::new(layout);
        (rest.mode, rest.moved_by) = (mode as u32, mode as u32);
        rest.z[..n].copy_from_slice(&model.x0);
        rest.before.copy_from_slice(&model.x0);
        let mut set = |k: usize, deviation: f64| rest.cov[k * stride + k] = deviation * deviation;
        for i in 0..n {
            set(i, settings.start[i]);
        }
        for (k, size) in model.load_size.iter().enumerate() {
            set(layout.load() + k, self.tuning.load_at_start * size);
        }
        for i in 0..d {
            set(n + i, settings.disturbance_size[i]);
        }
        for j in 0..m {
            set(
                layout.gain() + j,
                self.tuning.load_at_start * settings.gain_error,
            );
        }
        rest
    }
}
