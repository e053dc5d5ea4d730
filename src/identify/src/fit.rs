//! Free simulation, and how well it fits.

use crate::data::Stretch;
use crate::subspace::Model;
use nalgebra::{DMatrix, DVector};

/// Fit in percent per output: free simulation from the initial state that suits each stretch best.
pub fn percent(model: &Model, stretches: &[Stretch]) -> Vec<f64> {
    let p = model.c.nrows();
    let usable = || {
        stretches
            .iter()
            .filter(|s| s.samples() > model.a.nrows() + 1)
    };
    let samples: usize = usable().map(Stretch::samples).sum();
    let mut mean = DVector::zeros(p);
    for stretch in usable() {
        mean += stretch.y.column_sum();
    }
    mean /= samples as f64;
    let (mut missed, mut moved) = (DVector::<f64>::zeros(p), DVector::<f64>::zeros(p));
    for stretch in usable() {
        let simulated = initial_state(model, stretch, stretch.samples())
            .map(|start| simulate(model, &start, stretch));
        for at in 0..stretch.samples() {
            let y = stretch.y.column(at);
            moved += (y - &mean).map(|value| value * value);
            missed += match &simulated {
                Some(simulated) => (y - simulated.column(at)).map(|value| value * value),
                None => DVector::from_element(p, f64::INFINITY),
            };
        }
    }
    let ratio = missed.zip_map(&moved, |missed: f64, moved: f64| (missed / moved).sqrt());
    ratio.iter().map(|ratio| 100.0 * (1.0 - ratio)).collect()
}

/// Outputs (p x N) of a free run.
fn simulate(model: &Model, start: &DVector<f64>, stretch: &Stretch) -> DMatrix<f64> {
    let mut state = start.clone();
    let mut outputs = DMatrix::zeros(model.c.nrows(), stretch.samples());
    for at in 0..stretch.samples() {
        let known = stretch.known.column(at);
        outputs.set_column(at, &(&model.c * &state + &model.c0 * known));
        state = &model.a * state + &model.b * stretch.u.column(at) + &model.a0 * known;
    }
    outputs
}

/// The state at the start of a stretch whose free run fits its first samples best.
pub fn initial_state(model: &Model, stretch: &Stretch, samples: usize) -> Option<DVector<f64>> {
    let (n, p) = (model.a.nrows(), model.c.nrows());
    let samples = samples.min(stretch.samples());
    if samples * p < n {
        return None;
    }
    let stretch = &stretch.part(0, samples);
    let forced = simulate(model, &DVector::zeros(n), stretch);
    let mut observed = DMatrix::zeros(samples * p, n);
    let mut rest = DVector::zeros(samples * p);
    let mut row = model.c.clone();
    for at in 0..samples {
        observed.rows_mut(at * p, p).copy_from(&row);
        rest.rows_mut(at * p, p)
            .copy_from(&(stretch.y.column(at) - forced.column(at)));
        row = &row * &model.a;
    }
    if !(observed.iter().chain(rest.iter())).all(|value| value.is_finite()) {
        return None;
    }
    let svd = observed.try_svd(true, true, f64::EPSILON, 0)?;
    let tolerance = svd.singular_values.max() * 1e-10;
    svd.solve(&rest, tolerance).ok()
}

/// The state after a stretch, told by the predictor.
pub fn final_state(model: &Model, stretch: &Stretch) -> Option<DVector<f64>> {
    let mut state = initial_state(model, stretch, 4 * model.a.nrows() + 8)?;
    for at in 0..stretch.samples() {
        let known = stretch.known.column(at);
        let error = stretch.y.column(at) - &model.c * &state - &model.c0 * known;
        let driven = &model.b * stretch.u.column(at) + &model.a0 * known;
        state = &model.a * state + driven + &model.k * error;
    }
    state.iter().all(|value| value.is_finite()).then_some(state)
}
