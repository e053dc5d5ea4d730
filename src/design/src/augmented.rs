//! The model a controller is designed on: plant, latency, integral action, performance signal.
//!
//! With `x~ = [x; u_prev; Z]` (`u_prev` only under latency 1) a mode reads
//!
//! ```text
//! x~(k+1) = A x~(k) + B u(k) + E w(k) + R y_ref(k)                                 (2), (19), (24)
//! Z(k+1)  = Z(k) + Te (y_ref(k) - S (C x(k) + F w(k)))
//! v(k)    = H x~(k) + D u(k)                v = [W_y S C x; W_z Z; W_u u]
//! ```
//!
//! With an internal model, `Z` holds after the `r` integrators, resonator by resonator and tracked
//! output by tracked output, a pair that turns by the resonator's angle and is driven as the
//! integrator is:
//!
//! ```text
//! a(k+1) = cos a(k) - sin b(k) + Te (y_ref(k) - S (C x(k) + F w(k)))
//! b(k+1) = sin a(k) + cos b(k)
//! ```
//!
//! Sine and cosine are the very doubles the controller turns by. Both states of a pair have the unit
//! and the weight of the integrator of their output: excited at its own frequency, a pair grows
//! at `1 / sqrt(2)` of the rate at which the integrator grows under a constant.

use super::units::power_of_two;
use super::{ControlSpec, Units};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Mode, SwitchedPlant};
use nalgebra::DMatrix;

/// One mode of the augmented model, in the units it was built with.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AugmentedMode {
    /// State matrix (d x d), `d = n + latency m + q` with `q = r (1 + 2 resonators)`.
    pub a: DMatrix<f64>,
    /// Input matrix (d x m).
    pub b: DMatrix<f64>,
    /// Disturbance matrix (d x s).
    pub e: DMatrix<f64>,
    /// Reference matrix (d x r); the reference is in physical units.
    pub r: DMatrix<f64>,
    /// State to performance signal ((r + q + m) x d).
    pub h: DMatrix<f64>,
    /// Input to performance signal ((r + q + m) x m).
    pub d: DMatrix<f64>,
}

/// Whether no disturbance is known (`E = 0` and `F = 0` in every mode): a design then assumes one that
/// acts where the inputs do, so that the weights have something to weigh.
pub fn assumes_input_disturbance(plant: &SwitchedPlant) -> bool {
    let known = |mode: &Mode| mode.e.amax() > 0.0 || mode.f.amax() > 0.0;
    !plant.modes.iter().any(known)
}

/// The disturbance a mode is designed for: `E` (n x s) and `F` (p x s) as given, else `B` and zero.
pub fn design_disturbance(plant: &SwitchedPlant, mode: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let own = &plant.modes[mode];
    match assumes_input_disturbance(plant) {
        true => (own.b.clone(), DMatrix::zeros(own.c.nrows(), own.b.ncols())),
        false => (own.e.clone(), own.f.clone()),
    }
}

/// The augmented model of every mode. Each entry is one product of given numbers (and exact powers
/// of two), so it carries at most one rounding.
pub fn augment(plant: &SwitchedPlant, spec: &ControlSpec, units: &Units) -> Vec<AugmentedMode> {
    (0..plant.modes.len())
        .map(|mode| augment_mode(plant, mode, spec, units))
        .collect()
}

impl Units {
    /// The powers of two nearest the nominal values, with the integrator, the disturbance and the
    /// performance signal brought near one as well.
    pub fn choose(plant: &SwitchedPlant, spec: &ControlSpec, scaling: &Scaling) -> Self {
        let round = |values: &[f64]| values.iter().map(|&v| power_of_two(v)).collect::<Vec<_>>();
        let outputs = round(&scaling.outputs);
        let step = power_of_two(plant.sample_time);
        let mut units = Self {
            integrators: spec.tracked.iter().map(|&o| step * outputs[o]).collect(),
            states: round(&scaling.states),
            inputs: round(&scaling.inputs),
            outputs,
            disturbance: 1.0,
            performance: 1.0,
        };
        let models = augment(plant, spec, &units);
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let disturbance = largest(&mut models.iter().map(|model| model.e.amax()));
        let performance = largest(&mut models.iter().map(|m| m.h.amax().max(m.d.amax())));
        units.disturbance = 1.0 / power_of_two(disturbance);
        units.performance = power_of_two(performance);
        units
    }
}

fn augment_mode(
    plant: &SwitchedPlant,
    index: usize,
    spec: &ControlSpec,
    units: &Units,
) -> AugmentedMode {
    let (mode, sample_time) = (&plant.modes[index], plant.sample_time);
    let (given_e, given_f) = design_disturbance(plant, index);
    let (n, m, s) = (mode.a.nrows(), mode.b.ncols(), given_e.ncols());
    let r = spec.tracked.len();
    let previous = spec.latency * m;
    let (first_z, q) = (n + previous, spec.integral_size());
    let size = first_z + q;

    let mut a = DMatrix::zeros(size, size);
    let mut b = DMatrix::zeros(size, m);
    let mut e = DMatrix::zeros(size, s);
    let mut reference = DMatrix::zeros(size, r);
    let mut h = DMatrix::zeros(r + q + m, size);
    let mut d = DMatrix::zeros(r + q + m, m);

    let input = scaled(&mode.b, &units.states, &units.inputs);
    a.view_mut((0, 0), (n, n))
        .copy_from(&scaled(&mode.a, &units.states, &units.states));
    if spec.latency == 0 {
        b.view_mut((0, 0), (n, m)).copy_from(&input);
    } else {
        a.view_mut((0, n), (n, m)).copy_from(&input);
        b.view_mut((n, 0), (m, m)).fill_with_identity();
    }
    let all_disturbances = vec![units.disturbance; s];
    e.view_mut((0, 0), (n, s))
        .copy_from(&scaled(&given_e, &units.states, &all_disturbances));

    for (row, &output) in spec.tracked.iter().enumerate() {
        for k in 0..n {
            let c = mode.c[(output, k)] * (units.states[k] / units.performance);
            h[(row, k)] = spec.output_weight[row] * c;
        }
    }
    for (index, of) in integral_states(spec).iter().enumerate() {
        let z = first_z + index;
        let output = spec.tracked[of.row];
        let unit = units.integrators[of.row];
        for (column, value) in of.turn {
            a[(z, first_z + column)] = value;
        }
        if of.driven {
            reference[(z, of.row)] = sample_time / unit;
            for k in 0..n {
                let c = mode.c[(output, k)] * (units.states[k] / unit);
                a[(z, k)] = -sample_time * c;
            }
            for k in 0..s {
                e[(z, k)] = -sample_time * (given_f[(output, k)] * (units.disturbance / unit));
            }
        }
        h[(r + index, z)] = spec.integral_weight[of.row] * (unit / units.performance);
    }
    for k in 0..m {
        d[(r + q + k, k)] = spec.input_weight[k] * (units.inputs[k] / units.performance);
    }
    AugmentedMode {
        a,
        b,
        e,
        r: reference,
        h,
        d,
    }
}

/// One state of the integral part.
struct IntegralState {
    /// Which of the tracked outputs it belongs to.
    row: usize,
    /// Its row of the autonomous dynamics: (index in the integral part, entry).
    turn: [(usize, f64); 2],
    /// Whether the tracking error enters it.
    driven: bool,
}

/// The integral part, state by state, in the order of [`ftc_control::integrator`].
fn integral_states(spec: &ControlSpec) -> Vec<IntegralState> {
    let r = spec.tracked.len();
    let integrator = |row| IntegralState {
        row,
        turn: [(row, 1.0); 2],
        driven: true,
    };
    let mut states: Vec<_> = (0..r).map(integrator).collect();
    for angle in &spec.resonators {
        let (sine, cosine) = libm::sincos(*angle);
        for row in 0..r {
            let (first, second) = (states.len(), states.len() + 1);
            let pair = [
                ([(first, cosine), (second, -sine)], true),
                ([(first, sine), (second, cosine)], false),
            ];
            states.extend(pair.map(|(turn, driven)| IntegralState { row, turn, driven }));
        }
    }
    states
}

/// What a reading (p) adds to the augmented state (d x p): `-Te` where it drives an integrator.
pub(crate) fn readings(plant: &SwitchedPlant, spec: &ControlSpec, units: &Units) -> DMatrix<f64> {
    let dims = plant.dimensions();
    let first_z = dims.states + spec.latency * dims.inputs;
    let mut matrix = DMatrix::zeros(first_z + spec.integral_size(), dims.outputs);
    for (index, of) in integral_states(spec).iter().enumerate() {
        if of.driven {
            let output = spec.tracked[of.row];
            let ratio = units.outputs[output] / units.integrators[of.row];
            matrix[(first_z + index, output)] = -plant.sample_time * ratio;
        }
    }
    matrix
}

/// `rows^-1 matrix columns`; when the units are powers of two, exact but for underflow.
pub(crate) fn scaled(matrix: &DMatrix<f64>, rows: &[f64], columns: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |r, c| {
        matrix[(r, c)] * (columns[c] / rows[r])
    })
}
