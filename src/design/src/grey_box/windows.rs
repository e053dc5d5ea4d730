//! Logs, cut into windows.

use crate::commissioning::{Database, RecordedDisturbance, commission};
use ftc_plant::Mode;
use ftc_plant::scaling::Scaling;
use nalgebra::DMatrix;

/// Samples in a window, at least, and per unknown of its own.
pub(super) const WINDOW: usize = 40;
const SAMPLES_PER_UNKNOWN: usize = 4;

/// Of so many windows one is held back to judge the fit.
pub(super) const HELD_BACK: usize = 4;

/// Windows of the usual movement in each mode.
const USUAL: usize = 4;

/// Samples without a gap: what drove the plant and what was read.
#[derive(Clone)]
pub(super) struct Window {
    /// The mode of each sample (0-based).
    pub(super) modes: Vec<usize>,
    /// Inputs about the mode's operating point (m x samples).
    pub(super) u: DMatrix<f64>,
    /// Outputs about the mode's operating point (p x samples).
    pub(super) y: DMatrix<f64>,
    /// The disturbance's level and waves (samples x waves), the same for each channel.
    pub(super) waves: DMatrix<f64>,
}

/// Samples in a window.
pub(crate) fn least_samples(mode: &Mode, disturbance: Option<RecordedDisturbance>) -> usize {
    let count = disturbance.map_or(0, |known| known.count);
    let own = mode.a.nrows() + (1 + 2 * count) * mode.e.ncols();
    WINDOW.max(SAMPLES_PER_UNKNOWN * own / mode.c.nrows())
}

/// A log from one gap to the next.
pub(super) type Record = Window;

/// Stretches that follow each other without a gap, in whatever mode, joined.
pub(super) fn records(
    stretches: &[Vec<Database>],
    disturbance: Option<RecordedDisturbance>,
) -> Vec<Record> {
    let count = disturbance.map_or(0, |known| known.count);
    // The level first, then the waves.
    let wave = |k: usize, column: usize| match (disturbance, column.checked_sub(1)) {
        (Some(known), Some(column)) => known.wave(k, column),
        _ => 1.0,
    };
    let of = |(mode, stretches): (usize, &'_ Vec<Database>)| {
        let each = stretches.iter().map(move |stretch| (mode, stretch.clone()));
        each.collect::<Vec<_>>()
    };
    let mut all: Vec<(usize, Database)> = stretches.iter().enumerate().flat_map(of).collect();
    let mut joined = Vec::new();
    while !all.is_empty() {
        let (mode, stretch) = all.remove(0);
        let mut parts = vec![(mode, stretch)];
        while let Some((_, last)) = parts.last() {
            let end = last.first + last.samples();
            let next = all
                .iter()
                .position(|(_, next)| next.first == end && end > 0);
            match next {
                Some(at) => parts.push(all.remove(at)),
                None => break,
            }
        }
        joined.push(parts);
    }
    let join = |parts: Vec<(usize, Database)>| {
        let first = parts[0].1.first;
        let modes: Vec<usize> = parts
            .iter()
            .flat_map(|(mode, part)| vec![*mode; part.samples()])
            .collect();
        let columns = |pick: fn(&Database) -> &DMatrix<f64>| {
            let all = parts.iter().flat_map(|(_, part)| pick(part).row_iter());
            DMatrix::from_columns(&all.map(|row| row.transpose()).collect::<Vec<_>>())
        };
        let waves = DMatrix::from_fn(modes.len(), 1 + 2 * count, |k, column| {
            wave(first + k, column)
        });
        Record {
            u: columns(|part| &part.inputs),
            y: columns(|part| &part.outputs),
            waves,
            modes,
        }
    };
    joined.into_iter().map(join).collect()
}

/// What the model does under inputs that jump at random between their nominal values, in each mode.
pub(super) fn usual(
    modes: &[Mode],
    length: usize,
    disturbance: Option<RecordedDisturbance>,
    scaling: &Scaling,
) -> Vec<Window> {
    let still = vec![0.0; scaling.outputs.len()];
    let run = |(seed, mode): (usize, &Mode)| {
        let samples = USUAL * length;
        vec![commission(
            mode,
            &scaling.inputs,
            &still,
            samples,
            seed as u64,
        )]
    };
    let stretches: Vec<_> = modes.iter().enumerate().map(run).collect();
    let records = records(&stretches, disturbance);
    records
        .iter()
        .flat_map(|record| cut(record, length))
        .collect()
}

/// The same if each input acted one sample after its row.
pub(super) fn a_sample_later(record: &Record) -> Record {
    let samples = record.modes.len().saturating_sub(1);
    let from = record.modes.len() - samples;
    Record {
        modes: record.modes[from..].to_vec(),
        u: record.u.columns(0, samples).into_owned(),
        y: record.y.columns(from, samples).into_owned(),
        waves: record.waves.rows(from, samples).into_owned(),
    }
}

/// Windows of so many samples, one after the other.
pub(super) fn cut(record: &Record, length: usize) -> Vec<Window> {
    let starts = (0..record.modes.len() / length).map(|at| at * length);
    let window = |from: usize| Window {
        modes: record.modes[from..from + length].to_vec(),
        u: record.u.columns(from, length).into_owned(),
        y: record.y.columns(from, length).into_owned(),
        waves: record.waves.rows(from, length).into_owned(),
    };
    starts.map(window).collect()
}

pub(super) fn samples_of(windows: &[Window], mode: usize) -> usize {
    let count = |window: &Window| window.modes.iter().filter(|&&of| of == mode).count();
    windows.iter().map(count).sum()
}

/// Windows to learn from, and windows to judge by: a share of what each mode has.
pub(super) fn split(windows: Vec<Window>, modes: usize) -> (Vec<Window>, Vec<Window>) {
    let (mut learn, mut held_back) = (Vec::new(), Vec::new());
    for window in windows {
        let due = |mode: usize| {
            let own = samples_of(std::slice::from_ref(&window), mode);
            let held = samples_of(&held_back, mode) + own;
            own > 0 && HELD_BACK * held <= samples_of(&learn, mode) + held
        };
        match (0..modes).any(due) {
            true => held_back.push(window),
            false => learn.push(window),
        }
    }
    (learn, held_back)
}
