//! Off line: gains, observers, predictor and certificate.
//!
//! The data types and the certificate need no solver; making gains does (feature `solver`, on by
//! default). The solver links eight symbols of a BLAS and LAPACK: leave the feature `lapack` off in a
//! program that links one, switch it on in a program that does not.
//!
//! ```
//! use ftc_design::{ControlSpec, state_feedback};
//! use ftc_plant::{Mode, OperatingPoint, SwitchedPlant, scaling::Scaling};
//! use nalgebra::dmatrix;
//!
//! let mode = |pole: f64| Mode {
//!     name: "mode".into(),
//!     a: dmatrix![pole, 0.1; 0.0, 0.5],
//!     b: dmatrix![0.0; 1.0],
//!     c: dmatrix![1.0, 0.0],
//!     e: dmatrix![0.1; 0.0],
//!     f: dmatrix![0.0],
//!     operating_point: OperatingPoint::zero(2, 1, 1),
//! };
//! let plant = SwitchedPlant { sample_time: 1.0, modes: vec![mode(0.9), mode(0.8)] };
//! let spec = ControlSpec { decay: 0.98, ..ControlSpec::new(plant.dimensions()) };
//! let control = state_feedback::synthesise(&plant, &spec, &Scaling::automatic(&plant))?;
//! control.verify(&plant)?; // from the very doubles, without the solver
//! assert!(control.spectral_radius.iter().all(|&radius| radius < 0.98));
//! # Ok::<(), ftc_design::DesignError>(())
//! ```

#[cfg(feature = "solver")]
pub mod as_printed;
#[cfg(feature = "solver")]
pub mod assembly;
pub mod augmented;
pub mod certificate;
pub mod commissioning;
mod controllability;
#[cfg(feature = "solver")]
pub mod coverage;
#[cfg(feature = "solver")]
mod feedforward;
pub mod harmonics;
#[cfg(feature = "solver")]
mod hypotheses;
#[cfg(feature = "solver")]
mod interior_point;
#[cfg(feature = "solver")]
pub mod lmi;
mod lyapunov;
mod matrices;
pub mod observer;
mod record;
pub(crate) mod riccati;
pub mod running_loop;
#[cfg(feature = "solver")]
mod solver;
mod spec;
pub mod state_feedback;
mod units;
mod verdict;
#[cfg(feature = "solver")]
pub mod warnings;
pub mod work;

use ftc_plant::SwitchedPlant;
#[cfg(feature = "solver")]
use ftc_plant::scaling::Scaling;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

pub use certificate::{CertificateError, ControlCertificate};
pub use controllability::check_controllable;
#[cfg(feature = "solver")]
pub use hypotheses::HypothesesSpec;
pub use lyapunov::{DwellTime, Lyapunov};
pub use matrices::{dense, mode_models, plain};
pub use observer::{LostCertificate, ObserverCertificate, ObserverDesign};
pub use record::{ControllerDesign, Design, FORMAT, Signal, Signals};
pub use running_loop::{LostSensors, RunningLoop, SwitchingGain};
#[cfg(feature = "solver")]
pub use solver::{Run, Solver, Step};
pub use spec::{ControlSpec, Objective, ObserverChoice, ObserverSpec};
pub use state_feedback::{ModeGains, StateFeedback};
pub use units::Units;
pub use verdict::{
    Advice, BlockKind, BlockName, ConflictingBlock, DesignError, Infeasibility, Partial,
    SolverFailure, Uncertified,
};

/// A certified state feedback and a certified observer for one plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Synthesis {
    /// The gains of theorem T1 or T2.
    pub state_feedback: StateFeedback,
    /// The observer (11)-(17).
    pub observer: ObserverDesign,
    /// What is proved of both together, as the controller runs them.
    pub running_loop: RunningLoop,
}

impl Synthesis {
    /// Proves again everything it claims on this plant, without solving anything.
    ///
    /// # Errors
    /// The first inequality that cannot be proved, or what does not fit.
    pub fn verify(&self, plant: &SwitchedPlant) -> Result<(), CertificateError> {
        self.state_feedback.verify(plant)?;
        self.observer.verify(plant)?;
        let (control, observer) = (&self.state_feedback, &self.observer);
        self.running_loop.verify(plant, control, observer)
    }

    /// Proves bumpless transfer of the loop as well; `false` where no proof is found.
    #[cfg(feature = "solver")]
    pub fn certify_transfer(&mut self, plant: &SwitchedPlant) -> bool {
        let (control, observer) = (&self.state_feedback, &self.observer);
        self.running_loop.certify_transfer(plant, control, observer)
    }
}

/// Designs and certifies state feedback and observer; `scaling` holds the nominal values of the
/// signals (see [`Scaling::automatic`]).
///
/// # Errors
/// As [`state_feedback::synthesise`] and [`observer::synthesise`].
#[cfg(feature = "solver")]
pub fn synthesise(
    plant: &SwitchedPlant,
    control: &ControlSpec,
    observer: &ObserverSpec,
    scaling: &Scaling,
) -> Result<Synthesis, DesignError> {
    synthesise_with(plant, control, observer, scaling, &Run::default())
}

/// [`synthesise`] with a chosen solver and someone who watches. That there is no observer is said only
/// after another scaling has confirmed it.
///
/// # Errors
/// As [`synthesise`]; [`DesignError::Partial`] where one of the two was found.
#[cfg(feature = "solver")]
pub fn synthesise_with(
    plant: &SwitchedPlant,
    control: &ControlSpec,
    observer: &ObserverSpec,
    scaling: &Scaling,
    run: &Run,
) -> Result<Synthesis, DesignError> {
    let state_feedback = match state_feedback::synthesise_with(plant, control, scaling, run) {
        Ok(found) => found,
        Err(error @ DesignError::Request(_)) => return Err(error),
        Err(error) => {
            let observer = observer::synthesise(plant, observer, scaling);
            return Err(error.with_parts(None, observer.ok()));
        }
    };
    let choose =
        |scaling: &Scaling| running_loop::choose(plant, &state_feedback, observer, scaling);
    let chosen = choose(scaling);
    match chosen.or_else(|error| choose(&units::other_scaling(plant, scaling)).or(Err(error))) {
        Ok((observer, running_loop)) => Ok(Synthesis {
            state_feedback,
            observer,
            running_loop,
        }),
        Err(error @ DesignError::Request(_)) => Err(error),
        Err(error) => Err(error.with_parts(Some(state_feedback), None)),
    }
}

/// The Moore-Penrose inverse; singular values below `tolerance` times the largest count as zero.
pub(crate) fn pseudo_inverse(matrix: &DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let zero = DMatrix::zeros(matrix.ncols(), matrix.nrows());
    // The decomposition panics on what is not a number.
    let regular = matrix.iter().all(|value| value.abs() < 1e150);
    if matrix.is_empty() || matrix.amax() == 0.0 || !regular {
        return zero;
    }
    let svd = matrix.clone().svd(true, true);
    let threshold = tolerance * svd.singular_values.max();
    svd.pseudo_inverse(threshold).unwrap_or(zero)
}
