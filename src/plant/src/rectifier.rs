//! A three-phase PWM rectifier, averaged, in dq coordinates: the nonlinear plant of scenario B.
//!
//! The inner current loops are closed and first order, so the outer loop commands the currents:
//!
//! ```text
//! tau di_d/dt = i_d* - i_d          tau di_q/dt = i_q* - i_q
//! C dv/dt     = p / max(v, v_0) + i_0(v) - v/R_load - i_w
//! p           = 3/2 (V i_d - R (i_d^2 + i_q^2)) - 3/2 L (i_d di_d/dt + i_q di_q/dt)
//! ```
//!
//! Below the line-to-line peak `v_0 = sqrt(3) V` a bridge is no longer a boost rectifier. Its diodes
//! conduct and hold the link up with the current `i_0`, that of a six-pulse rectifier behind the
//! resistance of two lines: zero at the peak, and on the average voltage of the six pulses
//! `3/pi v_0` far below it. And the bridge cannot put out the voltage that its current control asks
//! for, only the share `v/v_0` of it, so only that share of the power `p` passes. Hence `v` nowhere
//! meets a singularity, and energy is conserved everywhere.
//!
//! State `x = [i_d, i_q, v]` (A, A, V), input `u = [i_d*, i_q*]` (A), output `y = [v, i_q]`,
//! disturbance `i_w`: the current of a pulsating load (A). One mode per load resistance.

use super::{Mode, OperatingPoint, SwitchedPlant};
use core::f64::consts::PI;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// `sqrt(3)`, a line-to-line voltage over that of a phase.
const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// Physical parameters, SI units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(
    clippy::exhaustive_structs,
    reason = "the parameters of the equations above"
)]
pub struct Rectifier {
    /// Line inductance `L` in H.
    pub inductance: f64,
    /// Line resistance `R` in ohm.
    pub resistance: f64,
    /// DC-link capacitance `C` in F.
    pub capacitance: f64,
    /// Phase voltage amplitude `V` in V.
    pub phase_voltage: f64,
    /// Time constant of the current loops `tau` in s.
    pub current_loop: f64,
    /// DC voltage around which each mode is linearised, in V.
    pub dc_voltage: f64,
    /// Load resistance per mode in ohm.
    pub loads: Vec<f64>,
}

/// `[i_d, i_q, v]`
pub type RectifierState = [f64; 3];

impl Rectifier {
    /// `dx/dt` in mode `mode` under command `u` and pulsating load current `w`.
    pub fn derivative(
        &self,
        mode: usize,
        x: &RectifierState,
        u: [f64; 2],
        w: f64,
    ) -> RectifierState {
        let [i_d, i_q, v] = *x;
        let rate_d = (u[0] - i_d) / self.current_loop;
        let rate_q = (u[1] - i_q) / self.current_loop;
        let drawn = self.drawn_power(x);
        let into_coils = self.coil_power(x, u);
        let load = self.loads.get(mode).copied().unwrap_or(f64::INFINITY);
        let from_bridge = (drawn - into_coils) / v.max(self.diode_voltage());
        let rate_v = (from_bridge + self.diode_current(v) - v / load - w) / self.capacitance;
        [rate_d, rate_q, rate_v]
    }

    /// The change of [`derivative`](Self::derivative) at `(x, u)` under a small change
    /// `(dx, du, dw)`; it is the same for every `w`.
    pub fn differential(
        &self,
        mode: usize,
        (x, u): (&RectifierState, [f64; 2]),
        (dx, du, dw): (&RectifierState, [f64; 2], f64),
    ) -> RectifierState {
        let ([i_d, i_q, v], [di_d, di_q, dv]) = (*x, *dx);
        let rate = |u: f64, i: f64| (u - i) / self.current_loop;
        let (rate_d, rate_q) = (rate(u[0], i_d), rate(u[1], i_q));
        let (change_d, change_q) = (rate(du[0], di_d), rate(du[1], di_q));
        let drawn =
            1.5 * (self.phase_voltage * di_d - 2.0 * self.resistance * (i_d * di_d + i_q * di_q));
        let into_coils = 1.5
            * self.inductance
            * (di_d * rate_d + i_d * change_d + di_q * rate_q + i_q * change_q);
        let load = self.loads.get(mode).copied().unwrap_or(f64::INFINITY);
        let floor = self.diode_voltage();
        let of_voltage = if v > floor {
            -(self.drawn_power(x) - self.coil_power(x, u)) / (v * v)
        } else {
            self.diode_slope(v)
        };
        let change_v = (drawn - into_coils) / v.max(floor) + of_voltage * dv - dv / load - dw;
        [change_d, change_q, change_v / self.capacitance]
    }

    /// The link voltage (V) below which the diodes conduct: the line-to-line peak `sqrt(3) V`.
    pub fn diode_voltage(&self) -> f64 {
        SQRT_3 * self.phase_voltage
    }

    /// The current (A) that the diodes feed into a link at voltage `v`: `d^2 / (2 R (d + s))`, where
    /// `d` is what `v` lacks of the peak and `s` what the average of six pulses lacks of it.
    pub fn diode_current(&self, v: f64) -> f64 {
        let lacking = (self.diode_voltage() - v).max(0.0);
        lacking * lacking / (2.0 * self.resistance * (lacking + self.ripple()))
    }

    /// Its derivative by `v`, in A/V.
    fn diode_slope(&self, v: f64) -> f64 {
        let lacking = (self.diode_voltage() - v).max(0.0);
        let ripple = self.ripple();
        let whole = lacking + ripple;
        -lacking * (whole + ripple) / (2.0 * self.resistance * whole * whole)
    }

    /// By how much the average of six pulses lies below their peak, in V.
    fn ripple(&self) -> f64 {
        (1.0 - 3.0 / PI) * self.diode_voltage()
    }

    /// Power that the coils take up, in W.
    fn coil_power(&self, x: &RectifierState, u: [f64; 2]) -> f64 {
        let [i_d, i_q, _] = *x;
        let rate_d = (u[0] - i_d) / self.current_loop;
        let rate_q = (u[1] - i_q) / self.current_loop;
        1.5 * self.inductance * (i_d * rate_d + i_q * rate_q)
    }

    /// Power that coils, capacitor and loads get from the grid, losses in lines and diodes taken
    /// off, in W.
    pub fn supplied_power(&self, x: &RectifierState, u: [f64; 2]) -> f64 {
        let v = x[2];
        let coils = self.coil_power(x, u);
        let share = v / v.max(self.diode_voltage());
        coils + (self.drawn_power(x) - coils) * share + v * self.diode_current(v)
    }

    /// Power taken from the grid less the loss in the line, in W.
    pub fn drawn_power(&self, x: &RectifierState) -> f64 {
        let [i_d, i_q, _] = *x;
        1.5 * (self.phase_voltage * i_d - self.resistance * (i_d * i_d + i_q * i_q))
    }

    /// Energy in coils and capacitor, in J.
    pub fn stored_energy(&self, x: &RectifierState) -> f64 {
        let [i_d, i_q, v] = *x;
        0.75 * self.inductance * (i_d * i_d + i_q * i_q) + 0.5 * self.capacitance * v * v
    }

    /// The steady state of a mode at the nominal DC voltage, no reactive current.
    ///
    /// # Errors
    /// The grid cannot supply the load.
    pub fn operating_point(&self, mode: usize) -> Result<OperatingPoint, RectifierError> {
        let power = self.dc_voltage * self.dc_voltage / self.loads[mode];
        let half = self.phase_voltage / (2.0 * self.resistance);
        let root = half * half - power / (1.5 * self.resistance);
        if root < 0.0 || root.is_nan() {
            return Err(RectifierError::Overload {
                mode: mode + 1,
                power,
                resistance: self.resistance,
            });
        }
        let i_d = half - root.sqrt();
        Ok(OperatingPoint {
            x: vec![i_d, 0.0, self.dc_voltage],
            u: vec![i_d, 0.0],
            y: vec![self.dc_voltage, 0.0],
        })
    }

    /// The switched linear plant: each load linearised at its operating point and discretised exactly
    /// for an input held over `sample_time` seconds.
    ///
    /// # Errors
    /// The grid cannot supply a load, or the DC voltage is one that the diodes hold up.
    pub fn linearise(&self, sample_time: f64) -> Result<SwitchedPlant, RectifierError> {
        if self.dc_voltage <= self.diode_voltage() {
            return Err(RectifierError::DcVoltage {
                given: self.dc_voltage,
                diodes: self.diode_voltage(),
            });
        }
        let modes = (0..self.loads.len())
            .map(|mode| {
                let point = self.operating_point(mode)?;
                let continuous = self.jacobian(mode, &point);
                let exponential = (continuous * sample_time).exp();
                Ok(Mode {
                    name: format!("load {} ohm", self.loads[mode]),
                    a: exponential.view((0, 0), (3, 3)).into_owned(),
                    b: exponential.view((0, 3), (3, 2)).into_owned(),
                    c: DMatrix::from_row_slice(2, 3, &[0.0, 0.0, 1.0, 0.0, 1.0, 0.0]),
                    e: exponential.view((0, 5), (3, 1)).into_owned(),
                    f: DMatrix::zeros(2, 1),
                    operating_point: point,
                })
            })
            .collect::<Result<_, RectifierError>>()?;
        Ok(SwitchedPlant { sample_time, modes })
    }

    /// `[A B E; 0]` (6 x 6) of the continuous model at an operating point, by central differences.
    fn jacobian(&self, mode: usize, point: &OperatingPoint) -> DMatrix<f64> {
        let at = |z: &[f64; 6]| self.derivative(mode, &[z[0], z[1], z[2]], [z[3], z[4]], z[5]);
        let centre = [
            point.x[0], point.x[1], point.x[2], point.u[0], point.u[1], 0.0,
        ];
        let mut jacobian = DMatrix::zeros(6, 6);
        for column in 0..6 {
            let width = 1e-5 * centre[column].abs().max(1.0);
            let (mut above, mut below) = (centre, centre);
            above[column] += width;
            below[column] -= width;
            let (high, low) = (at(&above), at(&below));
            for row in 0..3 {
                jacobian[(row, column)] = (high[row] - low[row]) / (2.0 * width);
            }
        }
        jacobian
    }
}

/// Why a rectifier has no operating point.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RectifierError {
    /// The grid cannot supply the load.
    #[error(
        "mode {mode}: the grid cannot supply {power:.0} W through {resistance} ohm: raise the load resistance"
    )]
    Overload {
        /// The mode, from 1.
        mode: usize,
        /// Power of the load in W.
        power: f64,
        /// Resistance of the coils in ohm.
        resistance: f64,
    },
    /// The diodes hold the DC link above the voltage that is asked for.
    #[error(
        "the DC voltage is {given} V, but the diodes hold the link at sqrt(3) times the phase voltage, {diodes:.1} V: \
         give a DC voltage above it"
    )]
    DcVoltage {
        /// Asked for, in V.
        given: f64,
        /// What the diodes hold, in V.
        diodes: f64,
    },
}
