//! Logs cut into stretches of one mode, centred and scaled; what to estimate from and what to hold out.

use crate::{Error, Log};
use nalgebra::{DMatrix, DVector};

/// Consecutive samples of one mode, in scaled deviations.
#[derive(Clone, Debug)]
pub struct Stretch {
    /// Inputs (m x samples).
    pub u: DMatrix<f64>,
    /// Outputs (p x samples).
    pub y: DMatrix<f64>,
    /// What acts besides and is known (q x samples): 1, then sine and cosine of each period of the
    /// disturbance.
    pub known: DMatrix<f64>,
}

impl Stretch {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.y.ncols()
    }

    /// Some of its samples.
    pub fn part(&self, from: usize, to: usize) -> Self {
        let count = to - from;
        Self {
            u: self.u.columns(from, count).into_owned(),
            y: self.y.columns(from, count).into_owned(),
            known: self.known.columns(from, count).into_owned(),
        }
    }
}

/// All stretches of one mode.
pub struct ModeData {
    /// Mean of the inputs (m), physical units.
    pub input_mean: DVector<f64>,
    /// Mean of the outputs (p), physical units.
    pub output_mean: DVector<f64>,
    /// In the order of the logs.
    pub stretches: Vec<Stretch>,
}

/// A change of mode within a log: positions of the stretches before and after it.
pub struct Switch {
    /// Mode before, and its stretch.
    pub from: (usize, usize),
    /// Mode after, and its stretch.
    pub to: (usize, usize),
}

/// Everything that was logged.
pub struct Data {
    /// Per mode.
    pub modes: Vec<ModeData>,
    /// Standard deviation of the inputs (m).
    pub input_scale: DVector<f64>,
    /// Standard deviation of the outputs (p).
    pub output_scale: DVector<f64>,
    /// Changes of mode.
    pub switches: Vec<Switch>,
}

/// One mode's data in three parts.
pub struct Split {
    /// What models are estimated from while the order is chosen.
    pub estimation: Vec<Stretch>,
    /// What the order is chosen by.
    pub validation: Vec<Stretch>,
    /// What no choice has seen.
    pub test: Vec<Stretch>,
}

impl Split {
    /// What the final model is estimated from.
    pub fn estimation_and_validation(&self) -> Vec<Stretch> {
        let both = self.estimation.iter().chain(&self.validation);
        both.cloned().collect()
    }
}

/// The fewest samples of a mode that anything is said from.
const LEAST_SAMPLES: usize = 40;
/// From so many stretches on whole stretches are held out, else the ends of each.
const MANY_STRETCHES: usize = 10;

impl Data {
    /// Checks, cuts, centres and scales; a disturbance may have known periods (samples).
    pub fn prepare(logs: &[Log], periods: &[f64]) -> Result<Self, Error> {
        check(logs)?;
        let separable = |period: &&f64| **period > 2.0 && period.is_finite();
        if let Some(&period) = periods.iter().find(|period| !separable(period)) {
            return Err(Error::Period(period));
        }
        let count = 1 + logs.iter().flat_map(|log| &log.modes).max().unwrap_or(&0);
        let mut raw: Vec<Vec<Stretch>> = vec![Vec::new(); count];
        let mut switches = Vec::new();
        for log in logs {
            let mut first = 0;
            let mut before: Option<(usize, usize)> = None;
            for run in log.modes.chunk_by(|one, next| one == next) {
                let mode = run[0];
                raw[mode].push(Stretch {
                    u: log.inputs.rows(first, run.len()).transpose(),
                    y: log.outputs.rows(first, run.len()).transpose(),
                    known: known(first, run.len(), periods),
                });
                let here = (mode, raw[mode].len() - 1);
                if let Some(from) = before.replace(here) {
                    switches.push(Switch { from, to: here });
                }
                first += run.len();
            }
        }
        let mut modes = raw
            .into_iter()
            .enumerate()
            .map(|(number, stretches)| ModeData::centred(number + 1, stretches))
            .collect::<Result<Vec<_>, _>>()?;
        let input_scale = deviation(&modes, |stretch| &stretch.u);
        let output_scale = deviation(&modes, |stretch| &stretch.y);
        for stretch in modes.iter_mut().flat_map(|mode| &mut mode.stretches) {
            divide(&mut stretch.u, &input_scale);
            divide(&mut stretch.y, &output_scale);
        }
        Ok(Self {
            modes,
            input_scale,
            output_scale,
            switches,
        })
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.output_scale.len()
    }
}

/// 1, then sine and cosine of each period, at the rows of a log from `first` on.
fn known(first: usize, count: usize, periods: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(1 + 2 * periods.len(), count, |row, column| {
        let Some(wave) = row.checked_sub(1) else {
            return 1.0;
        };
        let at = (first + column) as f64;
        let (sine, cosine) = (core::f64::consts::TAU * at / periods[wave / 2]).sin_cos();
        if wave.is_multiple_of(2) { sine } else { cosine }
    })
}

fn check(logs: &[Log]) -> Result<(), Error> {
    let Some(first) = logs.first() else {
        return Err(Error::TooShort {
            mode: 1,
            samples: 0,
            needed: LEAST_SAMPLES,
        });
    };
    for (index, log) in logs.iter().enumerate() {
        let number = index + 1;
        let rows = log.outputs.nrows();
        if log.inputs.nrows() != rows || log.modes.len() != rows {
            return Err(Error::Sizes {
                log: number,
                what: format!(
                    "{} rows of inputs, {rows} of outputs and {} of modes",
                    log.inputs.nrows(),
                    log.modes.len()
                ),
            });
        }
        let sizes = (log.inputs.ncols(), log.outputs.ncols());
        if sizes != (first.inputs.ncols(), first.outputs.ncols()) || sizes.0 == 0 || sizes.1 == 0 {
            return Err(Error::Sizes {
                log: number,
                what: format!("{} inputs and {} outputs", sizes.0, sizes.1),
            });
        }
        let finite = |row: &usize| {
            let inputs = log.inputs.row(*row);
            inputs
                .iter()
                .chain(log.outputs.row(*row).iter())
                .all(|value| value.is_finite())
        };
        if let Some(row) = (0..rows).find(|row| !finite(row)) {
            return Err(Error::NotFinite {
                log: number,
                row: row + 1,
            });
        }
    }
    Ok(())
}

impl ModeData {
    fn centred(number: usize, mut stretches: Vec<Stretch>) -> Result<Self, Error> {
        let samples: usize = stretches.iter().map(Stretch::samples).sum();
        if samples < LEAST_SAMPLES {
            return Err(Error::TooShort {
                mode: number,
                samples,
                needed: LEAST_SAMPLES,
            });
        }
        let input_mean = centre(number, "input", stretches.iter_mut().map(|s| &mut s.u))?;
        let output_mean = centre(number, "output", stretches.iter_mut().map(|s| &mut s.y))?;
        Ok(Self {
            input_mean,
            output_mean,
            stretches,
        })
    }

    /// About 60, 20 and 20 percent: whole stretches where there are many, else parts of each.
    pub fn split(&self) -> Split {
        let mut split = Split {
            estimation: Vec::new(),
            validation: Vec::new(),
            test: Vec::new(),
        };
        let many = self.stretches.len() >= MANY_STRETCHES;
        for (index, stretch) in self.stretches.iter().enumerate() {
            if many {
                let part = match index % 5 {
                    3 => &mut split.validation,
                    4 => &mut split.test,
                    _ => &mut split.estimation,
                };
                part.push(stretch.clone());
                continue;
            }
            let samples = stretch.samples();
            let cuts = [0, samples * 3 / 5, samples * 4 / 5, samples];
            split.estimation.push(stretch.part(cuts[0], cuts[1]));
            split.validation.push(stretch.part(cuts[1], cuts[2]));
            split.test.push(stretch.part(cuts[2], cuts[3]));
        }
        split
    }
}

/// Takes the mean off rows that must move; returns it.
fn centre<'a>(
    mode: usize,
    signal: &'static str,
    parts: impl Iterator<Item = &'a mut DMatrix<f64>>,
) -> Result<DVector<f64>, Error> {
    let parts: Vec<&mut DMatrix<f64>> = parts.collect();
    let samples: usize = parts.iter().map(|part| part.ncols()).sum();
    let rows = parts.first().map_or(0, |part| part.nrows());
    let mut mean = DVector::zeros(rows);
    for part in &parts {
        mean += part.column_sum();
    }
    mean /= samples as f64;
    let first = parts[0].column(0).into_owned();
    let moves = |row: &usize| {
        parts
            .iter()
            .any(|part| part.row(*row).iter().any(|&value| value != first[*row]))
    };
    if let Some(row) = (0..rows).find(|row| !moves(row)) {
        return Err(Error::Still {
            mode,
            signal,
            number: row + 1,
        });
    }
    for part in parts {
        for mut column in part.column_iter_mut() {
            column -= &mean;
        }
    }
    Ok(mean)
}

fn deviation(modes: &[ModeData], pick: fn(&Stretch) -> &DMatrix<f64>) -> DVector<f64> {
    let parts = || modes.iter().flat_map(|mode| &mode.stretches).map(pick);
    let samples: usize = parts().map(DMatrix::ncols).sum();
    let rows = parts().next().map_or(0, DMatrix::nrows);
    DVector::from_fn(rows, |row, _| {
        let squares: f64 = parts().map(|part| part.row(row).norm_squared()).sum();
        (squares / samples as f64).sqrt()
    })
}

fn divide(values: &mut DMatrix<f64>, scale: &DVector<f64>) {
    for (mut row, scale) in values.row_iter_mut().zip(scale) {
        row /= *scale;
    }
}
