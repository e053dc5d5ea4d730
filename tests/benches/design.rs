//! How long a design takes, by size, number of modes and kind of guarantee: state feedback of least
//! gamma and observer, certified, on random plants. Times are medians over plants; the ratio is to the
//! two-state, two-mode design with a common Lyapunov function in the same run.
#![allow(missing_docs)]

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use ftc_design::{
    ControlSpec, DesignError, Lyapunov, ObserverChoice, ObserverSpec, SolverFailure, synthesise,
};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Mode, SwitchedPlant, spectral_radius};
use nalgebra::DMatrix;
use std::time::Instant;

/// Designs up to this many states are timed on three plants, larger ones on one.
const SMALL: usize = 4;

fn matrix(random: &mut ChaCha8Rng, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| {
        2.0 * (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 1.0
    })
}

/// Modes that are variations of one plant, so that one guarantee can serve them all.
fn plant(random: &mut ChaCha8Rng, n: usize, modes: usize) -> SwitchedPlant {
    let (m, p) = (n.div_ceil(2), n.div_ceil(2));
    let a = matrix(random, n, n);
    let a = &a * (0.8 / spectral_radius(&a));
    let (b, c, e) = (
        matrix(random, n, m),
        matrix(random, p, n),
        matrix(random, n, 1),
    );
    let mode = |random: &mut ChaCha8Rng| {
        Mode::new(
            &a + 0.02 * matrix(random, n, n),
            &b + 0.02 * matrix(random, n, m),
            c.clone(),
        )
        .named("random")
        .with_disturbance(e.clone(), DMatrix::zeros(p, 1))
    };
    SwitchedPlant::new(1.0, (0..modes).map(|_| mode(random)).collect())
}

/// Seconds of one design, and what came of it.
fn timed(plant: &SwitchedPlant, lyapunov: Lyapunov) -> (f64, &'static str) {
    let dims = plant.dimensions();
    let tracked = 1;
    let mut control = ControlSpec::unweighted(dims);
    control.tracked = (0..tracked).collect();
    control.lyapunov = lyapunov;
    control.decay = 0.97;
    control.output_weight = vec![1.0; tracked];
    control.integral_weight = vec![0.3; tracked];
    control.input_weight = vec![0.3; dims.inputs];
    let observer = ObserverSpec::new(ObserverChoice::Auto, 0.97, lyapunov);
    let begin = Instant::now();
    let scaling = Scaling::automatic(plant);
    let outcome = match synthesise(plant, &control, &observer, &scaling) {
        Ok(_) => "certified",
        Err(DesignError::Infeasible(_)) => "infeasible",
        Err(DesignError::Uncertified(_)) => "not certified",
        Err(DesignError::Solver(SolverFailure::NumericalTrouble)) => "numerical trouble",
        Err(_) => "refused",
    };
    (begin.elapsed().as_secs_f64(), outcome)
}

fn main() {
    println!("| states | modes | guarantee | seconds | times the smallest | outcome |");
    println!("|---|---|---|---|---|---|");
    let mut smallest = None;
    for n in [2, 4, 8, 12] {
        let plants = if n <= SMALL { 3 } else { 1 };
        for modes in [2, 4] {
            for lyapunov in [Lyapunov::Common, Lyapunov::Switched, Lyapunov::Dwell] {
                let mut random = ChaCha8Rng::seed_from_u64((10 * n + modes) as u64);
                let mut runs: Vec<(f64, &str)> = (0..plants)
                    .map(|_| timed(&plant(&mut random, n, modes), lyapunov))
                    .collect();
                runs.sort_by(|x, y| x.0.total_cmp(&y.0));
                let seconds = runs[plants / 2].0;
                let ratio = seconds / *smallest.get_or_insert(seconds);
                let outcomes: Vec<&str> = runs.iter().map(|run| run.1).collect();
                println!(
                    "| {n} | {modes} | {lyapunov} | {seconds:.3} | {ratio:.1} | {} |",
                    outcomes.join(", ")
                );
            }
        }
    }
}
