//! When an unknown input observer exists: `rank(C E) = rank(E)` and `(C, T A)` detectable.

use crate::augmented::scaled;
use crate::matrices::dense;
use crate::matrices::pseudo_inverse;
use ftc_plant::{Mode, SwitchedPlant};
use nalgebra::DMatrix;

/// Singular values below this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-10;

/// Units in which ranks are decided.
pub(crate) struct PerUnit<'a> {
    pub states: &'a [f64],
    pub outputs: &'a [f64],
}

impl PerUnit<'_> {
    /// `A` of a mode, in per-unit.
    pub fn a(&self, mode: &Mode) -> DMatrix<f64> {
        scaled(&mode.a, self.states, self.states)
    }

    /// `C` of a mode, in per-unit.
    pub fn c(&self, mode: &Mode) -> DMatrix<f64> {
        scaled(&mode.c, self.outputs, self.states)
    }

    /// `E` of a mode with its columns brought to length one: their scale is the disturbance's own.
    fn e(&self, mode: &Mode) -> DMatrix<f64> {
        let mut e = scaled(&mode.e, self.states, &vec![1.0; mode.e.ncols()]);
        for mut column in e.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        e
    }

    /// `H` (physical units) in per-unit.
    pub fn h(&self, h: &DMatrix<f64>) -> DMatrix<f64> {
        scaled(h, self.states, self.outputs)
    }
}

/// `H_ij = E_i (C_j E_i)^+` (14) in physical units, for every pair of modes.
///
/// # Errors
/// A sentence naming the modes for which `rank(C E) < rank(E)`.
pub(super) fn decoupling(
    plant: &SwitchedPlant,
    units: &PerUnit,
) -> Result<Vec<Vec<DMatrix<f64>>>, String> {
    let modes = plant.modes.iter().enumerate();
    modes
        .map(|(i, left)| {
            let entered = plant.modes.iter().enumerate();
            entered
                .map(|(j, entered)| {
                    check_rank(units, (i, left), (j, entered))?;
                    Ok(&left.e * pseudo_inverse(&(&entered.c * &left.e), RANK_TOLERANCE))
                })
                .collect()
        })
        .collect()
}

/// `rank(C_j E_i) = rank(E_i)`, in per-unit.
fn check_rank(
    units: &PerUnit,
    (i, left): (usize, &Mode),
    (j, entered): (usize, &Mode),
) -> Result<(), String> {
    let e = units.e(left);
    let seen = units.c(entered) * &e;
    let (wanted, found) = (rank(&e), rank(&seen));
    if wanted == found {
        return Ok(());
    }
    let entering = match i == j {
        true => String::new(),
        false => format!(" when mode {} follows", j + 1),
    };
    Err(format!(
        "no unknown input observer exists for mode {}{entering}: rank(C E) = {found}, but rank(E) = {wanted}, \
         so part of the disturbance does not show in the outputs at once; use a luenberger observer or more sensors",
        i + 1
    ))
}

/// Number of singular values that are not negligible.
fn rank(matrix: &DMatrix<f64>) -> usize {
    if matrix.is_empty() {
        return 0;
    }
    let values = matrix.clone().singular_values();
    let largest = values.max();
    values
        .iter()
        .filter(|&&v| v > RANK_TOLERANCE * largest)
        .count()
}

/// Whether a state disturbance is decoupled: `(I - H_ij C_j) E_i` vanishes up to rounding.
///
/// # Errors
/// One sentence that names the modes for which it does not.
pub(crate) fn check_decoupling(
    plant: &SwitchedPlant,
    design: &super::ObserverDesign,
) -> Result<(), String> {
    let units = PerUnit {
        states: &design.certificate.states,
        outputs: &design.certificate.outputs,
    };
    for (i, left) in plant.modes.iter().enumerate() {
        for (j, entered) in plant.modes.iter().enumerate() {
            let e = units.e(left);
            let h = units.h(&dense(&design.observer.decoupling[i][j]));
            let through = &e - &h * (units.c(entered) * &e);
            if through.amax() > 1e-9 * h.amax().max(1.0) {
                return Err(format!(
                    "the observer does not decouple the disturbance from mode {} to mode {}: export the design again",
                    i + 1,
                    j + 1
                ));
            }
        }
    }
    Ok(())
}
