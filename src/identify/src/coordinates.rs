//! One state for all modes, and each mode's operating point in it.

use crate::Coordinates;
use crate::data::Data;
use crate::fit;
use crate::least_squares;
use crate::subspace::Model;
use nalgebra::{DMatrix, DVector};

/// A mode's model in shared coordinates, and its operating point (scaled deviations).
pub struct Placed {
    /// Its matrices; constants are those of deviations from the logs' means.
    pub model: Model,
    /// State of the operating point (n), shared coordinates.
    pub x0: DVector<f64>,
    /// Input of the operating point (m), from the mean.
    pub u0: DVector<f64>,
    /// Output of the operating point (p), from the mean.
    pub y0: DVector<f64>,
}

/// A change of coordinates: `z = transform (x - origin)` is a mode's own state.
struct Change {
    /// Own state from shared state (n x n).
    transform: DMatrix<f64>,
    /// Shared state at which the own state is zero (n).
    origin: DVector<f64>,
}

/// Least fit, in percent, with which the map between two modes' states must follow from switches.
const LEAST_SWITCH_FIT: f64 = 50.0;
/// Largest condition number of a change of coordinates.
const WORST_CONDITION: f64 = 1e6;

/// Puts all models into one state's coordinates.
pub fn shared(data: &Data, models: Vec<Model>) -> (Vec<Placed>, Coordinates) {
    if models.len() == 1 {
        let place = places_of_outputs(&models);
        return (by_outputs(data, &models, place), Coordinates::Single);
    }
    match by_switches(data, &models) {
        Some((changes, fit)) => (
            by_changes(data, &models, &changes),
            Coordinates::Switches { fit },
        ),
        None => {
            let place = places_of_outputs(&models);
            (by_outputs(data, &models, place), Coordinates::Outputs)
        }
    }
}

/// The steady state at the mean input, or the nearest there is: `x0`, `u0`, `y0` in own coordinates.
fn steady(model: &Model) -> (DVector<f64>, DVector<f64>, DVector<f64>) {
    let (n, m) = (model.a.nrows(), model.b.ncols());
    let constant = model.a0.column(0).into_owned();
    let drift = DMatrix::identity(n, n) - &model.a;
    let (x0, u0) = match drift
        .clone()
        .try_inverse()
        .filter(|inverse| inverse.norm() < WORST_CONDITION)
    {
        Some(inverse) => (inverse * &constant, DVector::zeros(m)),
        None => {
            // An integrator: the input that keeps it still, as near to the mean as possible.
            let mut both = DMatrix::zeros(n, n + m);
            both.columns_mut(0, n).copy_from(&drift);
            both.columns_mut(n, m).copy_from(&-&model.b);
            let svd = both.svd(true, true);
            let tolerance = svd.singular_values.max() * 1e-8;
            let found = svd
                .solve(&constant, tolerance)
                .unwrap_or_else(|_| DVector::zeros(n + m));
            (found.rows(0, n).into_owned(), found.rows(n, m).into_owned())
        }
    };
    let y0 = &model.c * &x0 + model.c0.column(0);
    (x0, u0, y0)
}

/// Changes of coordinates that make the state continuous at the switches that were logged, and the
/// worst fit among them; `None` where a mode is not reached by enough of them.
fn by_switches(data: &Data, models: &[Model]) -> Option<(Vec<Change>, f64)> {
    let n = models[0].a.nrows();
    let mut changes: Vec<Option<Change>> = models.iter().map(|_| None).collect();
    changes[0] = Some(Change {
        transform: DMatrix::identity(n, n),
        origin: DVector::zeros(n),
    });
    let mut worst = 100.0_f64;
    while let Some((known, new)) = next_pair(data, &changes) {
        let (map, offset, fit) = between(data, models, known, new)?;
        worst = worst.min(fit);
        let base = changes[known].as_ref()?;
        let transform = &map * &base.transform;
        // own = map (base.transform (x - base.origin)) + offset
        let origin = &base.origin - transform.clone().try_inverse()? * offset;
        changes[new] = Some(Change { transform, origin });
    }
    let all: Option<Vec<Change>> = changes.into_iter().collect();
    all.map(|changes| (changes, worst))
}

/// The pair of a known and a new mode with the most switches between them.
fn next_pair(data: &Data, changes: &[Option<Change>]) -> Option<(usize, usize)> {
    let known = (0..changes.len()).filter(|&mode| changes[mode].is_some());
    let pairs = known.flat_map(|from| (0..changes.len()).map(move |to| (from, to)));
    pairs
        .filter(|&(_, to)| changes[to].is_none())
        .max_by_key(|&(from, to)| count(data, from, to))
        .filter(|&(from, to)| count(data, from, to) > 0)
}

fn count(data: &Data, one: usize, other: usize) -> usize {
    let between = |from: usize, to: usize| (from, to) == (one, other) || (to, from) == (one, other);
    let switches = data.switches.iter();
    switches
        .filter(|switch| between(switch.from.0, switch.to.0))
        .count()
}

/// State of mode `new` from that of mode `known`: `z_new = map z_known + offset`, and its fit in percent.
fn between(
    data: &Data,
    models: &[Model],
    known: usize,
    new: usize,
) -> Option<(DMatrix<f64>, DVector<f64>, f64)> {
    let n = models[0].a.nrows();
    let mut pairs = Vec::new();
    for switch in &data.switches {
        let ((from, before), (to, after)) = (switch.from, switch.to);
        if (from, to) != (known, new) && (from, to) != (new, known) {
            continue;
        }
        let before = fit::final_state(&models[from], &data.modes[from].stretches[before]);
        let stretch = &data.modes[to].stretches[after];
        let after = fit::initial_state(&models[to], stretch, 4 * n + 8);
        if let (Some(before), Some(after)) = (before, after) {
            pairs.push(if from == known {
                (before, after)
            } else {
                (after, before)
            });
        }
    }
    // Twice as many equations as unknowns.
    if pairs.len() < 2 * (n + 1) {
        return None;
    }
    let states = DMatrix::from_fn(n + 1, pairs.len(), |row, column| match row < n {
        true => pairs[column].0[row],
        false => 1.0,
    });
    let targets = DMatrix::from_fn(n, pairs.len(), |row, column| pairs[column].1[row]);
    let found = least_squares::fit(&targets, &states)?;
    let missed = &targets - &found * &states;
    let mean = targets.column_mean();
    let moved: f64 = targets
        .column_iter()
        .map(|column| (column - &mean).norm_squared())
        .sum();
    let fit = 100.0 * (1.0 - (missed.norm_squared() / moved).sqrt());
    let map = found.columns(0, n).into_owned();
    let usable = fit >= LEAST_SWITCH_FIT && condition(&map) < WORST_CONDITION;
    usable.then(|| (map, found.column(n).into_owned(), fit))
}

fn condition(matrix: &DMatrix<f64>) -> f64 {
    let values = matrix.singular_values();
    values.max() / values.min()
}

/// Models and operating points where all changes of coordinates are known; the shared state begins
/// with the outputs of the first mode, where they are independent.
fn by_changes(data: &Data, models: &[Model], changes: &[Change]) -> Vec<Placed> {
    let first = readable(&data.output_scale, &models[0]);
    let start = steady(&models[0]);
    let inverse = first
        .clone()
        .try_inverse()
        .unwrap_or_else(|| first.transpose());
    // Where the first mode's operating point is put: at its outputs, in physical units.
    let place = physical_outputs(data, 0, &start.2, first.nrows());
    let mut placed = Vec::new();
    for (model, change) in models.iter().zip(changes) {
        let (own, u0, y0) = steady(model);
        // shared raw state (first mode's own) of this operating point
        let back = change
            .transform
            .clone()
            .try_inverse()
            .unwrap_or_else(|| change.transform.transpose());
        let raw = &back * own + &change.origin;
        let moved = model.transformed(&(&first * &back), &(&change.transform * &inverse));
        placed.push(Placed {
            model: moved,
            x0: &place + &first * (raw - &start.0),
            u0,
            y0,
        });
    }
    placed
}

/// Outputs at an operating point in physical units, as the first states; zeros beyond them.
fn physical_outputs(data: &Data, mode: usize, y0: &DVector<f64>, n: usize) -> DVector<f64> {
    let outputs = &data.modes[mode].output_mean + y0.component_mul(&data.output_scale);
    DVector::from_fn(n, |row, _| outputs.get(row).copied().unwrap_or(0.0))
}

/// Coordinates whose first states are the physical outputs, where those are independent; the rest
/// completes them at right angles.
fn readable(scale: &DVector<f64>, model: &Model) -> DMatrix<f64> {
    let (n, p) = (model.a.nrows(), model.c.nrows());
    let c = DMatrix::from_diagonal(scale) * &model.c;
    if p > n || condition(&model.c) > WORST_CONDITION {
        return DMatrix::identity(n, n);
    }
    let normal = (c.transpose() * &c).symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&one, &other| normal.eigenvalues[one].total_cmp(&normal.eigenvalues[other]));
    let mut all = DMatrix::zeros(n, n);
    all.rows_mut(0, p).copy_from(&c);
    for (row, &index) in order.iter().take(n - p).enumerate() {
        all.row_mut(p + row)
            .copy_from(&normal.eigenvectors.column(index).transpose());
    }
    all
}

/// Which outputs, how many samples ahead, are the states: the first independent ones in every mode.
fn places_of_outputs(models: &[Model]) -> Vec<(usize, usize)> {
    /// Least angle, as a sine, between a new state and those before it.
    const LEAST_SINE: f64 = 1e-3;
    let (n, p) = (models[0].a.nrows(), models[0].c.nrows());
    let mut rows: Vec<DMatrix<f64>> = models.iter().map(|model| model.c.clone()).collect();
    let mut bases: Vec<Vec<DVector<f64>>> = vec![Vec::new(); models.len()];
    let mut chosen = Vec::new();
    for ahead in 0..n {
        for output in 0..p {
            if chosen.len() == n {
                return chosen;
            }
            let rests: Vec<DVector<f64>> = rows
                .iter()
                .zip(&bases)
                .map(|(row, basis)| {
                    let row = row.row(output).transpose();
                    let unit = row.unscale(row.norm().max(f64::MIN_POSITIVE));
                    basis
                        .iter()
                        .fold(unit, |rest, base| &rest - base * base.dot(&rest))
                })
                .collect();
            if rests.iter().all(|rest| rest.norm() > LEAST_SINE) {
                chosen.push((ahead, output));
                for (basis, rest) in bases.iter_mut().zip(rests) {
                    basis.push(rest.normalize());
                }
            }
        }
        for (row, model) in rows.iter_mut().zip(models) {
            *row = &*row * &model.a;
        }
    }
    chosen
}

/// Models whose states are outputs to come in free motion, in physical units.
fn by_outputs(data: &Data, models: &[Model], places: Vec<(usize, usize)>) -> Vec<Placed> {
    let n = models[0].a.nrows();
    let mut placed = Vec::new();
    for (mode, model) in models.iter().enumerate() {
        let (own, u0, y0) = steady(model);
        let mut transform = DMatrix::zeros(n, n);
        for (row, &(ahead, output)) in places.iter().enumerate() {
            let mut reading = model.c.row(output).into_owned();
            for _ in 0..ahead {
                reading = &reading * &model.a;
            }
            transform
                .row_mut(row)
                .copy_from(&(reading * data.output_scale[output]));
        }
        let outputs = &data.modes[mode].output_mean + y0.component_mul(&data.output_scale);
        let unusable = places.len() < n || condition(&transform) > WORST_CONDITION;
        let inverse = if unusable {
            None
        } else {
            transform.clone().try_inverse()
        };
        placed.push(match inverse {
            Some(inverse) => Placed {
                model: model.transformed(&transform, &inverse),
                x0: DVector::from_fn(n, |row, _| outputs[places[row].1]),
                u0,
                y0,
            },
            // The logs do not show every state: the model's own coordinates.
            None => Placed {
                model: model.clone(),
                x0: own,
                u0,
                y0,
            },
        });
    }
    placed
}
