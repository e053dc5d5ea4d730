//! The state observer (11)-(17): unknown input observer, or Luenberger observer.
//!
//! With `H_ij = E_i (C_j E_i)^+` for a switch from mode `i` to mode `j` and `T_ij = I - H_ij C_j`,
//! the estimation error obeys `e(k+1) = (T_ij A_i - K_i C_i) e(k)`: the state disturbance is gone.
//! A Luenberger observer is the same with `H = 0`, `T = I`; a Kalman filter in correction form the
//! same with `K = 0` and one `H_j` whatever mode was left.

mod detectable;
mod dynamics;
mod existence;
mod kalman;
mod lost;
mod lost_synthesis;
mod proof;
mod synthesis;

pub(crate) use detectable::check_detectable;
pub(crate) use existence::check_decoupling;
pub(crate) use lost::gains_fit as lost_gains_fit;
pub use lost::{LostCertificate, MOST_FOR_PAIRS, sets};

pub use synthesis::synthesise;
pub(crate) use synthesis::{Candidate, candidates, with_lost_sensors};

use super::certificate::LyapunovMatrix;
use super::{DwellTime, ObserverSpec};
use ftc_control::parameters::Observer;
use serde::{Deserialize, Serialize};

/// A certified observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ObserverDesign {
    /// What was asked for.
    pub spec: ObserverSpec,
    /// The observer itself, in physical units.
    pub observer: Observer,
    /// Spectral radius of each mode's error dynamics (floating point; the certificate proves the
    /// decay).
    pub spectral_radius: Vec<f64>,
    /// How long modes must last, under [`Lyapunov::Dwell`](super::Lyapunov::Dwell).
    pub dwell: Option<DwellTime>,
    /// What proves it.
    pub certificate: ObserverCertificate,
    /// What proves it with sensors lost; none where no set of lost sensors is served.
    #[serde(default)]
    pub lost: Option<LostCertificate>,
}

/// What, beside the plant and the gains, it takes to prove an observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ObserverCertificate {
    /// Units of the states (n), powers of two.
    pub states: Vec<f64>,
    /// Units of the outputs (p), powers of two.
    pub outputs: Vec<f64>,
    /// Matrices `P` of the functions `e' P e`: one for `common`, else one per mode.
    pub lyapunov: Vec<LyapunovMatrix>,
}
