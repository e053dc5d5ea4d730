//! What the modes' matrices explain of a window, and how that changes with each of them.

use super::parameters::{Entry, Matrices, MatrixName, Parameter};
use super::windows::Segment;
use ftc_plant::Mode;
use nalgebra::{DMatrix, DVector};

/// The modes, and what is asked of the fit.
pub(super) struct GreyBox<'a> {
    pub(super) modes: &'a [Mode],
    pub(super) parameters: Vec<Parameter>,
    /// The model's values of the parameters.
    pub(super) design: DVector<f64>,
    pub(super) prior: DVector<f64>,
    /// Standard deviation of each sensor (p) in each mode.
    pub(super) deviation: Vec<DVector<f64>>,
    /// The usual movement: inputs that jump at random between nominal values.
    pub(super) usual: Vec<Segment>,
}

/// A window under given matrices, outputs in units of the sensors' deviations.
pub(super) struct Explained {
    /// Residual of the readings (samples p).
    pub(super) residual: DVector<f64>,
    /// An orthonormal basis of what the nuisance parameters can do to the outputs (samples p x parameters).
    pub(super) basis: DMatrix<f64>,
    /// States that explain the readings (n x samples).
    pub(super) states: DMatrix<f64>,
    /// The disturbance that does (s x samples).
    pub(super) disturbance: DMatrix<f64>,
}

impl GreyBox<'_> {
    /// The modes' matrices.
    pub(super) fn matrices(&self, theta: &DVector<f64>) -> Vec<Matrices> {
        let mut modes: Vec<_> = self.modes.iter().map(Matrices::of).collect();
        for (of, &value) in self.parameters.iter().zip(theta.iter()) {
            for &mode in &of.modes {
                let Entry {
                    matrix,
                    row,
                    column,
                } = of.entry;
                modes[mode].get_mut(matrix)[(row, column)] = value;
            }
        }
        modes
    }

    /// States (n x samples) from `x` on under the `drive` (n x samples).
    pub(super) fn run(
        modes: &[Matrices],
        window: &Segment,
        x: DVector<f64>,
        drive: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut states = DMatrix::zeros(x.len(), drive.ncols());
        let mut x = x;
        for (k, &mode) in window.modes.iter().enumerate() {
            states.set_column(k, &x);
            x = &modes[mode].a * x + drive.column(k);
        }
        states
    }

    /// What the inputs do to the states (n x samples), and that the operating point changes with the mode.
    fn input_drive(&self, modes: &[Matrices], window: &Segment) -> DMatrix<f64> {
        let mut drive = DMatrix::zeros(modes[0].a.nrows(), window.modes.len());
        for (k, &mode) in window.modes.iter().enumerate() {
            let mut next = &modes[mode].b * window.u.column(k);
            let after = window.modes.get(k + 1).copied().unwrap_or(mode);
            if after != mode {
                let points = [mode, after].map(|mode| &self.modes[mode].operating_point.x);
                for (i, value) in next.iter_mut().enumerate() {
                    *value += points[0][i] - points[1][i];
                }
            }
            drive.set_column(k, &next);
        }
        drive
    }

    /// Outputs in units of the deviations, one sample below the other: of each sample its mode and its outputs.
    fn weighed(
        &self,
        window: &Segment,
        outputs: impl Fn(usize, usize) -> DVector<f64>,
    ) -> DVector<f64> {
        let p = self.deviation[0].len();
        let mut all = DVector::zeros(p * window.modes.len());
        for (k, &mode) in window.modes.iter().enumerate() {
            let weighed = outputs(k, mode).component_div(&self.deviation[mode]);
            all.rows_mut(k * p, p).copy_from(&weighed);
        }
        all
    }

    /// Response to each nuisance parameter of the window: states (n x samples), and outputs in units of the
    /// deviations.
    fn nuisance_responses(
        &self,
        modes: &[Matrices],
        window: &Segment,
    ) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        let (n, samples) = (modes[0].a.nrows(), window.modes.len());
        let still = DMatrix::zeros(n, samples);
        let starts = (0..n).map(|i| {
            let start = DVector::from_fn(n, |row, _| f64::from(row == i));
            let states = Self::run(modes, window, start, &still);
            let outputs = self.weighed(window, |k, mode| &modes[mode].c * states.column(k));
            (states, outputs)
        });
        let waves = (0..modes[0].e.ncols()).flat_map(|channel| {
            window.waves.column_iter().map(move |wave| {
                let mut drive = DMatrix::zeros(n, samples);
                for (k, &mode) in window.modes.iter().enumerate() {
                    drive.set_column(k, &(modes[mode].e.column(channel) * wave[k]));
                }
                let states = Self::run(modes, window, DVector::zeros(n), &drive);
                let outputs = self.weighed(window, |k, mode| {
                    &modes[mode].c * states.column(k) + modes[mode].f.column(channel) * wave[k]
                });
                (states, outputs)
            })
        });
        starts.chain(waves).collect()
    }

    /// What explains the readings of `window` best, and what it leaves.
    pub(super) fn explain(&self, window: &Segment, modes: &[Matrices]) -> Explained {
        let (n, s) = modes[0].e.shape();
        let drive = self.input_drive(modes, window);
        let mut states = Self::run(modes, window, DVector::zeros(n), &drive);
        let read = self.weighed(window, |k, mode| {
            window.y.column(k) - &modes[mode].c * states.column(k)
        });
        let nuisance = self.nuisance_responses(modes, window);
        let columns: Vec<_> = nuisance
            .iter()
            .map(|(_, outputs)| outputs.clone())
            .collect();
        let free = DMatrix::from_columns(&columns);
        let mut disturbance = DMatrix::zeros(s, window.modes.len());
        let lost = Explained {
            residual: DVector::from_element(read.len(), f64::INFINITY),
            basis: DMatrix::zeros(read.len(), 0),
            states: states.clone(),
            disturbance: disturbance.clone(),
        };
        if !free
            .iter()
            .chain(read.iter())
            .all(|value| value.is_finite())
        {
            return lost;
        }
        // Directions that the window cannot tell apart are left at none.
        let svd = free.svd(true, true);
        let least = 1e-9 * svd.singular_values.max();
        let kept = svd.singular_values.iter().filter(|&&value| value > least);
        let kept = kept.count();
        let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
            return lost;
        };
        let basis = u.columns(0, kept).into_owned();
        let found = basis.tr_mul(&read);
        let residual = &read - &basis * &found;
        let coordinates = DVector::from_fn(kept, |k, _| found[k] / svd.singular_values[k]);
        let amounts = vt.rows(0, kept).tr_mul(&coordinates);
        for ((response, _), amount) in nuisance.iter().zip(amounts.iter()) {
            states += response * *amount;
        }
        let waves = window.waves.ncols();
        for channel in 0..s {
            let amounts = amounts.rows(n + channel * waves, waves);
            let course = &window.waves * amounts;
            disturbance.set_row(channel, &course.transpose());
        }
        Explained {
            residual,
            basis,
            states,
            disturbance,
        }
    }

    /// Sensitivity of the outputs to each parameter, projected to what the nuisance parameters cannot do
    /// (samples p x parameters): minus the Jacobian of the residual.
    pub(super) fn sensitivity(
        &self,
        window: &Segment,
        modes: &[Matrices],
        found: &Explained,
    ) -> DMatrix<f64> {
        let (n, samples) = (modes[0].a.nrows(), window.modes.len());
        let p = self.deviation[0].len();
        let mut sensitivity = DMatrix::zeros(found.residual.len(), self.parameters.len());
        for (at, of) in self.parameters.iter().enumerate() {
            let mine = |mode: usize| f64::from(u8::from(of.modes.contains(&mode)));
            if !window.modes.iter().any(|mode| of.modes.contains(mode)) {
                continue;
            }
            let Entry {
                matrix,
                row,
                column,
            } = of.entry;
            let factor = match matrix {
                MatrixName::A | MatrixName::C => found.states.row(column),
                MatrixName::B => window.u.row(column),
                MatrixName::E | MatrixName::F => found.disturbance.row(column),
            };
            let signal = |k: usize, mode: usize| mine(mode) * factor[k];
            let effect = if matches!(matrix, MatrixName::A | MatrixName::B | MatrixName::E) {
                let mut drive = DMatrix::zeros(n, samples);
                for (k, &mode) in window.modes.iter().enumerate() {
                    drive[(row, k)] = signal(k, mode);
                }
                let states = Self::run(modes, window, DVector::zeros(n), &drive);
                self.weighed(window, |k, mode| &modes[mode].c * states.column(k))
            } else {
                self.weighed(window, |k, mode| {
                    DVector::from_fn(p, |q, _| if q == row { signal(k, mode) } else { 0.0 })
                })
            };
            sensitivity.set_column(at, &effect);
        }
        &sensitivity - &found.basis * found.basis.tr_mul(&sensitivity)
    }
}
