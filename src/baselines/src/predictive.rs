//! Model predictive control: linear, offset-free, with input bounds; one quadratic programme a sample.
//!
//! The model of the active mode is augmented with a constant output disturbance `d`, estimated by
//! a steady Kalman filter, so the measured output is followed without offset. There is no fault
//! estimation: a faulty reading is used as it is, which is the point of the comparison.
//!
//! Over a horizon of `N` samples it minimises
//!
//! ```text
//! sum |S C (x_k - x_s)|^2 W_y^2 + |u_k - u_s|^2 W_u^2  +  (x_N - x_s)' P (x_N - x_s)
//! ```
//!
//! subject to the input limits. Here `(x_s, u_s)` is the steady state that puts `S (C x + d)` on the
//! reference, and `P` solves the Riccati equation. With the states eliminated the programme differs
//! from sample to sample in its linear term alone, so it is prepared once per mode.

use ftc_control::parameters::Limits;
use ftc_design::quadratic::{QuadraticProgram, RefusedProgram};
use ftc_design::{riccati, steady_state};
use ftc_plant::{Mode, SwitchedPlant};
use ftc_simulate::closed_loop::{Regulator, Report};
use ftc_simulate::plant::PlantState;
use nalgebra::{DMatrix, DVector};
use std::ops::AddAssign;

/// What the controller is asked for.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PredictiveSpec {
    /// Tracked outputs (0-based), `r`.
    pub tracked: Vec<usize>,
    /// `W_y` per tracked output (r).
    pub output_weight: Vec<f64>,
    /// `W_u` per input (m).
    pub input_weight: Vec<f64>,
    /// Limits per input (m).
    pub limits: Vec<Limits>,
    /// Standard deviation of each sensor's noise assumed by the filter (p), positive.
    pub noise: Vec<f64>,
    /// Standard deviation of each disturbance channel assumed by the filter (s).
    pub disturbance: Vec<f64>,
    /// Samples looked ahead, `N`.
    pub horizon: usize,
}

impl PredictiveSpec {
    /// For the tracked outputs (0-based) of a plant whose sensors have the given noise (p): 20 samples
    /// ahead, no limits, weights 1 of outputs and 0.1 of inputs, disturbances of deviation 1.
    pub fn new(plant: &SwitchedPlant, tracked: Vec<usize>, noise: Vec<f64>) -> Self {
        let dims = plant.dimensions();
        Self {
            output_weight: vec![1.0; tracked.len()],
            input_weight: vec![0.1; dims.inputs],
            limits: vec![Limits::default(); dims.inputs],
            noise,
            disturbance: vec![1.0; dims.disturbances],
            horizon: 20,
            tracked,
        }
    }
}

/// The model predictive controller.
pub struct Predictive {
    plant: SwitchedPlant,
    tracked: Vec<usize>,
    modes: Vec<Planner>,
    estimate: DVector<f64>,
    offset: DVector<f64>,
    command: Vec<f64>,
    no_fault: Vec<f64>,
    no_flag: Vec<bool>,
    late: bool,
}

/// Everything of one mode that can be computed beforehand.
struct Planner {
    program: QuadraticProgram,
    /// m.
    inputs: usize,
    /// `q = from_state (x - x_s) + from_input u_s`.
    from_state: DMatrix<f64>,
    from_input: DMatrix<f64>,
    /// `[x_s; u_s]` from the reference less `S d`.
    target: DMatrix<f64>,
    /// Kalman gain of `[x; d]`.
    kalman: DMatrix<f64>,
}

/// Why a mode has no predictive controller.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("mode {mode}: {cause}")]
#[non_exhaustive]
pub struct PredictiveError {
    /// The mode, from 1.
    pub mode: usize,
    /// Why not.
    pub cause: PredictiveCause,
}

/// What a predictive controller lacks.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PredictiveCause {
    /// The solver refuses the quadratic programme.
    #[error(transparent)]
    Programme(#[from] RefusedProgram),
    /// A Riccati equation has no solution.
    #[error("the Riccati equation has no solution: the mode cannot be stabilised")]
    NotStabilisable,
}

impl Predictive {
    /// Prepares the controller of every mode, starting in `mode` (0-based).
    ///
    /// # Errors
    /// A quadratic programme the solver refuses, or a Riccati equation without solution.
    pub fn new(
        plant: &SwitchedPlant,
        spec: &PredictiveSpec,
        mode: usize,
    ) -> Result<Self, PredictiveError> {
        let dims = plant.dimensions();
        let modes = (0..plant.modes.len())
            .map(|index| {
                Planner::new(plant, spec, index).map_err(|cause| PredictiveError {
                    mode: index + 1,
                    cause,
                })
            })
            .collect::<Result<_, PredictiveError>>()?;
        let point = &plant.modes[mode].operating_point;
        Ok(Self {
            plant: plant.clone(),
            tracked: spec.tracked.clone(),
            modes,
            estimate: DVector::from_column_slice(&point.x),
            offset: DVector::zeros(dims.outputs),
            command: point.u.clone(),
            no_fault: vec![0.0; dims.outputs],
            no_flag: vec![false; dims.outputs],
            late: false,
        })
    }

    /// The same controller for a loop in which a command acts one sample after it was computed: it
    /// plans from the state that the command already under way leads to.
    #[must_use]
    pub fn one_sample_late(mut self) -> Self {
        self.late = true;
        self
    }

    /// The state from which a command computed now acts.
    fn starting_point(&self, mode: &Mode) -> DVector<f64> {
        match self.late {
            false => self.estimate.clone(),
            true => {
                &mode.a * &self.estimate
                    + &mode.b * DVector::from_column_slice(&self.command)
                    + mode.state_offset()
            }
        }
    }

    /// Corrects state and output disturbance with the measurement; a lost sensor corrects nothing.
    fn correct(&mut self, seen: &PlantState) {
        let mode = &self.plant.modes[seen.told];
        let expected = &mode.c * &self.estimate + mode.output_offset() + &self.offset;
        let innovation = DVector::from_fn(expected.len(), |i, _| {
            let error = seen.y[i] - expected[i];
            if error.is_finite() { error } else { 0.0 }
        });
        let correction = &self.modes[seen.told].kalman * innovation;
        let n = self.estimate.len();
        self.estimate += correction.rows(0, n);
        self.offset += correction.rows(n, self.offset.len());
    }

    /// Solves the quadratic programme and takes the first command of the plan.
    fn plan(&mut self, seen: &PlantState) {
        let mode = &self.plant.modes[seen.told];
        let point = &mode.operating_point;
        let start = self.starting_point(mode);
        let planner = &mut self.modes[seen.told];
        let wanted = DVector::from_fn(self.tracked.len(), |i, _| {
            seen.reference[i] - point.y[self.tracked[i]] - self.offset[self.tracked[i]]
        });
        let steady = &planner.target * wanted;
        let n = self.estimate.len();
        let deviation = start - DVector::from_column_slice(&point.x) - steady.rows(0, n);
        let linear = &planner.from_state * deviation
            + &planner.from_input * steady.rows(n, self.command.len());
        if let Some(step) = planner.first_step(&linear) {
            for ((command, step), u0) in self.command.iter_mut().zip(&step).zip(&point.u) {
                *command = u0 + step;
            }
        }
    }
}

impl Regulator for Predictive {
    fn tick(&mut self, seen: &PlantState) {
        self.correct(seen);
        self.plan(seen);
    }

    fn command(&self) -> &[f64] {
        &self.command
    }

    fn report(&self) -> Report<'_> {
        Report::new(
            self.estimate.as_slice(),
            &self.no_fault,
            self.offset.as_slice(),
            &self.no_flag,
        )
    }

    fn advance(&mut self, seen: &PlantState, acting: &[f64]) {
        let mode = &self.plant.modes[seen.told];
        self.estimate = &mode.a * &self.estimate
            + &mode.b * DVector::from_column_slice(acting)
            + mode.state_offset();
    }
}

impl Planner {
    fn new(
        plant: &SwitchedPlant,
        spec: &PredictiveSpec,
        index: usize,
    ) -> Result<Self, PredictiveCause> {
        let mode = &plant.modes[index];
        let m = mode.b.ncols();
        let Condensed { hessian, pull } = Condensed::new(mode, spec)?;
        let repeat = DMatrix::from_fn(hessian.nrows(), m, |row, column| {
            f64::from(row % m == column)
        });
        Ok(Self {
            program: QuadraticProgram::new(
                &hessian,
                &bounds(spec.horizon, &mode.operating_point.u, &spec.limits),
            )?,
            // The plan is in deviations from u0, the cost in deviations from u_s.
            from_input: -(&hessian * repeat),
            from_state: pull,
            target: steady_state(mode, &spec.tracked),
            kalman: kalman(plant, index, spec)?,
            inputs: m,
        })
    }

    /// The first inputs of the optimal plan as deviations from `u0` (m); none where the solver fails.
    /// The programme was prepared once: only its linear term (m N) changes.
    fn first_step(&mut self, linear: &DVector<f64>) -> Option<Vec<f64>> {
        let plan = self.program.minimise(linear.as_slice())?;
        Some(plan[..self.inputs].to_vec())
    }
}

/// The cost with the states eliminated: `U' hessian U / 2 + (pull (x - x_s))' U` in deviations of the
/// inputs from `u_s`, one after the other (m N).
struct Condensed {
    /// m N x m N, positive definite.
    hessian: DMatrix<f64>,
    /// m N x n.
    pull: DMatrix<f64>,
}

impl Condensed {
    fn new(mode: &Mode, spec: &PredictiveSpec) -> Result<Self, PredictiveCause> {
        let (a, b) = (&mode.a, &mode.b);
        let (n, m) = b.shape();
        let weighted = DMatrix::from_diagonal(&DVector::from_column_slice(&spec.output_weight))
            * mode.c.select_rows(&spec.tracked);
        let state_cost = weighted.transpose() * &weighted;
        let input_weights = DVector::from_fn(m, |i, _| spec.input_weight[i].powi(2).max(1e-9));
        let reach = b * DMatrix::from_diagonal(&input_weights.map(f64::recip)) * b.transpose();
        let input_cost = DMatrix::from_diagonal(&input_weights);
        let terminal =
            riccati::solve(a, &reach, &state_cost).ok_or(PredictiveCause::NotStabilisable)?;
        let (free, forced) = responses(a, b, spec.horizon);
        let mut weighted = forced.clone();
        for k in 0..spec.horizon {
            let last = k + 1 == spec.horizon;
            let cost = if last { &terminal } else { &state_cost };
            let block = cost * forced.rows(n * k, n);
            weighted.rows_mut(n * k, n).copy_from(&block);
        }
        let mut hessian = 2.0 * forced.transpose() * &weighted;
        for k in 0..spec.horizon {
            let mut block = hessian.view_mut((m * k, m * k), (m, m));
            block += 2.0 * &input_cost;
        }
        Ok(Self {
            hessian,
            pull: 2.0 * weighted.transpose() * free,
        })
    }
}

/// `X = free x + forced U` over `k = 1..N`: n N x n and n N x m N.
fn responses(a: &DMatrix<f64>, b: &DMatrix<f64>, horizon: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let (n, m) = b.shape();
    let mut free = DMatrix::zeros(n * horizon, n);
    let mut forced = DMatrix::zeros(n * horizon, m * horizon);
    let mut power = DMatrix::identity(n, n);
    for k in 0..horizon {
        let response = &power * b;
        for later in k..horizon {
            let corner = (n * later, m * (later - k));
            forced.view_mut(corner, (n, m)).copy_from(&response);
        }
        power = a * power;
        free.rows_mut(n * k, n).copy_from(&power);
    }
    (free, forced)
}

/// The bounds of every planned input, step by step, as deviations from `u0` (m N).
fn bounds(horizon: usize, u0: &[f64], limits: &[Limits]) -> Vec<Limits> {
    let inputs = limits.iter().zip(u0);
    let inputs = inputs.map(|(limit, centre)| Limits {
        min: limit.min.map(|bound| bound - centre),
        max: limit.max.map(|bound| bound - centre),
    });
    (0..horizon).flat_map(|_| inputs.clone()).collect()
}

/// Gain of the steady Kalman filter of `[x; d]`: the disturbance drives the state, and `d` wanders
/// by a noise deviation each sample.
fn kalman(
    plant: &SwitchedPlant,
    index: usize,
    spec: &PredictiveSpec,
) -> Result<DMatrix<f64>, PredictiveCause> {
    let mode = &plant.modes[index];
    let (p, n) = mode.c.shape();
    let mut a = DMatrix::identity(n + p, n + p);
    a.view_mut((0, 0), (n, n)).copy_from(&mode.a);
    let mut c = DMatrix::zeros(p, n + p);
    c.columns_mut(0, n).copy_from(&mode.c);
    c.columns_mut(n, p).fill_with_identity();
    let squares =
        |values: &[f64]| DVector::from_iterator(values.len(), values.iter().map(|v| v * v));
    let variances = squares(&spec.noise);
    let variance = DMatrix::from_diagonal(&variances);
    let driven = &mode.e * DMatrix::from_diagonal(&squares(&spec.disturbance)) * mode.e.transpose();
    let floor = 1e-2 * variances.mean();
    let mut process = DMatrix::identity(n + p, n + p) * floor;
    process.view_mut((0, 0), (n, n)).add_assign(&driven);
    process.view_mut((n, n), (p, p)).copy_from(&variance);
    riccati::filter_gain(&a, &c, &process, &variance).ok_or(PredictiveCause::NotStabilisable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HORIZON: usize = 12;

    fn plant(entries: &[f64]) -> SwitchedPlant {
        SwitchedPlant::new(
            1.0,
            vec![
                Mode::new(
                    DMatrix::from_row_slice(2, 2, &entries[..4]),
                    DMatrix::from_row_slice(2, 2, &entries[4..8]),
                    DMatrix::identity(2, 2),
                )
                .named("only"),
            ],
        )
    }

    fn spec(limit: f64) -> PredictiveSpec {
        let limits = Limits {
            min: Some(-limit),
            max: Some(limit),
        };
        PredictiveSpec {
            tracked: vec![0, 1],
            output_weight: vec![1.0, 0.5],
            input_weight: vec![0.3, 0.2],
            limits: vec![limits; 2],
            noise: vec![0.01; 2],
            disturbance: vec![],
            horizon: HORIZON,
        }
    }

    proptest! {
        /// Where no limit is near the plan is that of the closed form, `-hessian^-1 q`; where
        /// limits bind, going down the gradient from it within the box gains nothing.
        #[test]
        fn the_plan_is_optimal(
            entries in prop::collection::vec(-1.0..1.0f64, 8),
            deviation in prop::collection::vec(-1.0..1.0f64, 2),
            limit in prop_oneof![Just(1e3), 0.01..0.3f64],
        ) {
            let (plant, spec) = (plant(&entries), spec(limit));
            let Ok(condensed) = Condensed::new(&plant.modes[0], &spec) else {
                return Err(TestCaseError::reject("cannot be stabilised"));
            };
            let Ok(mut planner) = Planner::new(&plant, &spec, 0) else {
                return Err(TestCaseError::reject("no steady state"));
            };
            let linear = &planner.from_state * DVector::from_column_slice(&deviation);
            let first = planner.first_step(&linear).unwrap();
            let plan = planner.program.minimise(linear.as_slice()).unwrap();
            let plan = DVector::from_column_slice(plan);
            prop_assert_eq!(&first[..], &plan.as_slice()[..2]);
            let cost = |u: &DVector<f64>| {
                0.5 * u.dot(&(&condensed.hessian * u)) + linear.dot(u)
            };
            // The solver promises a duality gap of 1e-8 of the cost, and bounds as well kept.
            let gap = 1e-7 * (1.0 + cost(&plan).abs());
            prop_assert!(plan.amax() <= limit + 1e-7 * (1.0 + limit), "{plan} beyond {limit}");
            let free = -condensed.hessian.clone().cholesky().unwrap().solve(&linear);
            if free.amax() < limit {
                prop_assert!(cost(&plan) <= cost(&free) + gap, "{plan} for {free}");
            }
            // Steps down the gradient, back into the box each time, never raise the cost.
            let step = 1.0 / condensed.hessian.norm();
            let mut better = plan.clone();
            for _ in 0..500 {
                better -= step * (&condensed.hessian * &better + &linear);
                better.apply(|u| *u = u.clamp(-limit, limit));
            }
            prop_assert!(cost(&plan) <= cost(&better) + gap, "{plan} for {better}");
        }
    }

    /// What the states do under a plan is what stepping the model gives.
    #[test]
    fn the_responses_are_those_of_the_model() {
        let plant = plant(&[0.5, 0.2, -0.3, 0.9, 1.0, 0.4, -0.7, 0.6]);
        let (a, b) = (&plant.modes[0].a, &plant.modes[0].b);
        let (free, forced) = responses(a, b, HORIZON);
        let plan = DVector::from_fn(2 * HORIZON, |i, _| (i as f64).sin());
        let mut x = DVector::from_column_slice(&[0.3, -0.8]);
        let states = free * &x + forced * &plan;
        for k in 0..HORIZON {
            x = a * x + b * plan.rows(2 * k, 2);
            assert!((&x - states.rows(2 * k, 2)).amax() < 1e-12, "sample {k}");
        }
    }
}
