//! From the plant and the settings to an estimator ready to run.

use super::competition::Candidates;
use super::hypothesis::{Hypothesis, Innovation};
use super::linear::{factor, solve};
use super::model::{Layout, ModeModel};
use super::{Bank, BankState, Live, Prices, SLOTS};
use crate::parameters::Hypotheses;
use ftc_plant::{Mode, SwitchedPlant};
use nalgebra::DMatrix;

/// Standard deviation of loads and input gains at the start, relative to that of their jumps.
const AT_REST: f64 = 0.3;

fn rows(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// The exosystem's output through `channels` (rows x s): the sine of each harmonic of each channel.
fn waves(channels: &DMatrix<f64>, harmonics: usize) -> Vec<f64> {
    let mut out = DMatrix::zeros(channels.nrows(), 2 * harmonics * channels.ncols());
    for channel in 0..channels.ncols() {
        for harmonic in 0..harmonics {
            out.set_column(
                2 * (channel * harmonics + harmonic),
                &channels.column(channel),
            );
        }
    }
    rows(&out)
}

/// `(B'B)^-1 B'` (m x n), slightly regularised.
fn left_inverse(b: &DMatrix<f64>) -> Vec<f64> {
    let (n, m) = b.shape();
    let gram = b.transpose() * b;
    let ridge = 1e-12 * gram.trace() + f64::MIN_POSITIVE;
    let mut lower = rows(&(gram + DMatrix::identity(m, m) * ridge));
    let mut out = vec![0.0; m * n];
    if !factor(&mut lower, m) {
        return out;
    }
    let mut column = vec![0.0; m];
    for i in 0..n {
        for (value, &entry) in column.iter_mut().zip(b.row(i).iter()) {
            *value = entry;
        }
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

fn model(layout: Layout, mode: &Mode, settings: &Hypotheses) -> ModeModel {
    let Layout { n, p, .. } = layout;
    let mut load = DMatrix::zeros(n, n);
    for (channels, sizes) in [
        (&mode.b, &settings.input_load),
        (&mode.e, &settings.disturbance_load),
    ] {
        for (column, size) in channels.column_iter().zip(sizes) {
            load += column * column.transpose() * (size * size);
        }
    }
    let still = DMatrix::identity(n, n) - &mode.a;
    for i in 0..n {
        let moved = (0..n).map(|j| still[(i, j)] * settings.state_load[j]);
        load[(i, i)] += moved.map(|v| v * v).sum::<f64>();
    }
    let bias = (0..p)
        .map(|q| {
            let parts = (0..n).map(|i| mode.c[(q, i)] * settings.state_size[i]);
            0.25 * parts.map(|v| v * v).sum::<f64>()
        })
        .collect();
    let harmonics = settings.angles.len();
    let point = &mode.operating_point;
    ModeModel::new(
        layout,
        rows(&mode.a),
        rows(&mode.b),
        rows(&mode.c),
        waves(&mode.e, harmonics),
        waves(&mode.f, harmonics),
        (&point.x, &point.u, &point.y),
        rows(&load),
        bias,
        left_inverse(&mode.b),
    )
}

impl Bank {
    /// The estimator of `plant`; the sizes in `settings` must agree with it.
    pub fn new(plant: &SwitchedPlant, settings: &Hypotheses) -> Self {
        let dims = plant.dimensions();
        let layout = Layout {
            n: dims.states,
            m: dims.inputs,
            p: dims.outputs,
            d: 2 * settings.angles.len() * dims.disturbances,
        };
        let ln = libm::log;
        let turn = |_| {
            settings
                .angles
                .iter()
                .map(|&angle| (libm::cos(angle), libm::sin(angle)))
        };
        Self {
            layout,
            modes: plant
                .modes
                .iter()
                .map(|mode| model(layout, mode, settings))
                .collect(),
            rotation: (0..dims.disturbances).flat_map(turn).collect(),
            prices: Prices {
                fault: ln(settings.fault_rate),
                stuck: ln(settings.stuck_rate),
                release: ln(settings.release_rate),
                change: ln(settings.change_rate),
                load: ln(settings.load_rate),
                moving: ln(settings.load_moving),
                settle: ln(1.0 - settings.load_moving),
            },
            settings: settings.clone(),
        }
    }

    /// Whether there are more sensors than states, so that they contradict each other where the
    /// model's output matrix is wrong.
    pub(super) const fn output_error(&self) -> bool {
        self.layout.p > self.layout.n
    }

    /// At rest at the operating point of `mode`.
    pub fn start(&self, mode: usize) -> BankState {
        let layout = self.layout;
        let Layout { n, m, p, d } = layout;
        let size = layout.size();
        let settings = &self.settings;
        let model = &self.modes[mode];
        let mut first = Hypothesis::new(layout);
        first.z[..n].copy_from_slice(&model.x0);
        first.before.copy_from_slice(&model.x0);
        let mut set = |k: usize, deviation: f64| first.cov[k * size + k] = deviation * deviation;
        for i in 0..n {
            set(i, settings.start[i]);
            set(
                layout.load() + i,
                AT_REST * libm::sqrt(model.load[i * n + i]),
            );
        }
        for i in 0..d {
            set(n + i, settings.disturbance_size[i]);
        }
        for j in 0..m {
            set(layout.gain() + j, AT_REST * settings.gain_error);
        }
        let mut slots = vec![Hypothesis::new(layout); SLOTS];
        slots[0] = first;
        BankState {
            slots,
            seen: vec![Innovation::new(layout); SLOTS],
            live: Live::ONE,
            candidates: Candidates::new(p),
            scratch: vec![0.0; n.max(1) * size],
            trial: Innovation::new(layout),
            mode: None,
            u: model.u0.clone(),
            moved: vec![0.0; m],
            first: true,
            noise: vec![0.0; p],
            evidence: vec![0.0; p],
            mean: vec![0.0; p],
            count: vec![0.0; p],
            best: 0,
            misfit: p as f64,
            own: model.x0.clone(),
            own_output: vec![0.0; p],
            expected: vec![0.0; p],
            residual: vec![0.0; p],
            accused: 0,
            suspect: 0,
            model_valid: true,
            load: vec![0.0; m],
            actuator_fault: 0,
        }
    }
}
