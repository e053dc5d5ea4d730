//! Logs, cut into windows.

use crate::commissioning::{Database, RecordedDisturbance, commission};
use ftc_plant::Mode;
use ftc_plant::scaling::Scaling;
use nalgebra::DMatrix;

/// Samples in a window, at least, and per nuisance parameter.
pub(super) const WINDOW: usize = 40;
const SAMPLES_PER_UNKNOWN: usize = 4;

/// Of so many windows one is held back to judge the fit.
pub(super) const HELD_BACK: usize = 4;

/// Windows of the usual movement in each mode.
const USUAL: usize = 4;

/// Samples without a gap, a log from one gap to the next or a window of it: what drove the plant and what was read.
#[derive(Clone)]
pub(super) struct Segment {
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
    let nuisance = mode.a.nrows() + (1 + 2 * count) * mode.e.ncols();
    WINDOW.max(SAMPLES_PER_UNKNOWN * nuisance / mode.c.nrows())
}

/// Stretches that follow each other without a gap, in whatever mode, joined.
pub(super) fn segments(
    stretches: &[Vec<Database>],
    disturbance: Option<RecordedDisturbance>,
) -> Vec<Segment> {
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
        Segment {
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
) -> Vec<Segment> {
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
    let segments = segments(&stretches, disturbance);
    segments
        .iter()
        .flat_map(|segment| cut(segment, length))
        .collect()
}

/// The same if each input acted one sample after its row.
pub(super) fn a_sample_later(segment: &Segment) -> Segment {
    let samples = segment.modes.len().saturating_sub(1);
    let from = segment.modes.len() - samples;
    Segment {
        modes: segment.modes[from..].to_vec(),
        u: segment.u.columns(0, samples).into_owned(),
        y: segment.y.columns(from, samples).into_owned(),
        waves: segment.waves.rows(from, samples).into_owned(),
    }
}

/// Windows of so many samples, one after the other.
pub(super) fn cut(segment: &Segment, length: usize) -> Vec<Segment> {
    let starts = (0..segment.modes.len() / length).map(|at| at * length);
    let window = |from: usize| Segment {
        modes: segment.modes[from..from + length].to_vec(),
        u: segment.u.columns(from, length).into_owned(),
        y: segment.y.columns(from, length).into_owned(),
        waves: segment.waves.rows(from, length).into_owned(),
    };
    starts.map(window).collect()
}

pub(super) fn samples_of(windows: &[Segment], mode: usize) -> usize {
    let count = |window: &Segment| window.modes.iter().filter(|&&of| of == mode).count();
    windows.iter().map(count).sum()
}

/// Windows to learn from, and windows to judge by: a share of what each mode has.
pub(super) fn split(windows: Vec<Segment>, modes: usize) -> (Vec<Segment>, Vec<Segment>) {
    let (mut learn, mut held_back) = (Vec::new(), Vec::new());
    for window in windows {
        let due = |mode: usize| {
            let here = samples_of(std::slice::from_ref(&window), mode);
            let held = samples_of(&held_back, mode) + here;
            here > 0 && HELD_BACK * held <= samples_of(&learn, mode) + held
        };
        match (0..modes).any(due) {
            true => held_back.push(window),
            false => learn.push(window),
        }
    }
    (learn, held_back)
}
