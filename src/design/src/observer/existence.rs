//! When an unknown input observer exists: `rank(C E) = rank(E)` and `(C, T A)` detectable.

use crate::RequestError;
use crate::augmented::scaled;
use crate::pseudo_inverse::pseudo_inverse_in;
use crate::units::power_of_two;
use ftc_plant::{Mode, SwitchedPlant};
use ftc_record::dense;
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

    /// `E` of a mode with its columns brought near length one: their scale is the disturbance's own.
    fn e(&self, mode: &Mode) -> DMatrix<f64> {
        scaled(&mode.e, self.states, &self.disturbances(mode))
    }

    /// The units of a mode's disturbances (s), in which the columns of `E` are near one.
    fn disturbances(&self, mode: &Mode) -> Vec<f64> {
        let e = scaled(&mode.e, self.states, &vec![1.0; mode.e.ncols()]);
        e.column_iter()
            .map(|column| 1.0 / power_of_two(column.norm()))
            .collect()
    }

    /// `H` (physical units) in per-unit.
    pub fn h(&self, h: &DMatrix<f64>) -> DMatrix<f64> {
        scaled(h, self.states, self.outputs)
    }
}

/// `H_ij = E_i (C_j E_i)^+` (14) in physical units, for every pair of modes.
///
/// # Errors
/// The modes for which `rank(C E) < rank(E)`.
pub(super) fn decoupling(
    plant: &SwitchedPlant,
    units: &PerUnit,
) -> Result<Vec<Vec<DMatrix<f64>>>, RequestError> {
    let modes = plant.modes.iter().enumerate();
    modes
        .map(|(i, left)| {
            let entered = plant.modes.iter().enumerate();
            entered
                .map(|(j, entered)| {
                    check_rank(units, (i, left), (j, entered))?;
                    let (seen, own) = (&entered.c * &left.e, units.disturbances(left));
                    Ok(&left.e * pseudo_inverse_in(&seen, units.outputs, &own, RANK_TOLERANCE))
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
) -> Result<(), RequestError> {
    let e = units.e(left);
    let seen = units.c(entered) * &e;
    let (wanted, seen) = (rank(&e), rank(&seen));
    match wanted == seen {
        true => Ok(()),
        false => Err(RequestError::HiddenDisturbance {
            mode: i + 1,
            successor: j + 1,
            seen,
            wanted,
        }),
    }
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
/// The modes (from 0) for which it does not.
pub(crate) fn check_decoupling(
    plant: &SwitchedPlant,
    design: &super::ObserverDesign,
) -> Result<(), [usize; 2]> {
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
                return Err([i, j]);
            }
        }
    }
    Ok(())
}
