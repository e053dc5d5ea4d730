//! Why a request cannot be met, whatever a solver would say.

use super::commissioning::CommissioningError;
use super::controllability::Uncontrollable;
use super::harmonics::DisturbanceError;
use super::spec::SpecError;
use super::words::{counted, entering, interval, least_decay};
use super::work::TooLarge;
use ftc_plant::deviation::DeviationError;
use ftc_plant::{PlantError, ScenarioError};

/// What is wrong with a request. Modes and inputs count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RequestError {
    /// The plant is ill-formed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A number that is asked for is out of its range.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The disturbance that is said to be known cannot be learned.
    #[error(transparent)]
    Disturbance(#[from] DisturbanceError),
    /// The experiment cannot be run on the plant.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The true plant departs from the plant in a way that does not fit it.
    #[error(transparent)]
    Deviation(#[from] DeviationError),
    /// The inputs cannot do what is asked.
    #[error(transparent)]
    Uncontrollable(#[from] Uncontrollable),
    /// The design would exhaust a computer.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    /// The fault estimator finds no response length.
    #[error(transparent)]
    Commissioning(#[from] CommissioningError),
    /// The database of a mode gives no predictor.
    #[error("mode {mode}: {error}")]
    Database {
        /// The mode.
        mode: usize,
        /// Why not.
        error: CommissioningError,
    },
    /// The response length is out of its range.
    #[error(
        "the response length is {length} samples, but with {} it must lie between 1 and {most}: \
         ask for another length, or choose a longer sample time",
        counted(*inputs, "input", "inputs")
    )]
    ResponseLength {
        /// In samples.
        length: usize,
        /// Inputs of the plant.
        inputs: usize,
        /// The longest.
        most: usize,
    },
    /// The log of a mode is too short to fit the mode's matrices to.
    #[error(
        "mode {mode}: the log has fewer than {} samples of this mode in stretches of at least {needed} without a gap: \
         record more of it", 4 * .needed
    )]
    ShortLog {
        /// The mode.
        mode: usize,
        /// Samples of a stretch, which may contain switches.
        needed: usize,
    },
    /// The inputs of a log are commands that act a sample later.
    #[error(
        "mode {mode}: the inputs of the log act one sample after the row they stand in: move them down by one row, or log what the plant is given, not the command"
    )]
    LateLog {
        /// The mode.
        mode: usize,
    },
    /// The log of a mode is longer than the least-squares problem can be.
    #[error(
        "mode {mode}: the log has {samples} samples, more than are needed: shorten it to at most {most}"
    )]
    LongLog {
        /// The mode.
        mode: usize,
        /// Samples found.
        samples: usize,
        /// The most.
        most: usize,
    },
    /// The log of a mode excites an input too little.
    #[error(
        "mode {mode}: the log excites input {input} ({name}) {} back too little (1 : {:.0e} of the strongest \
         direction): record a run in which every input moves on its own",
        counted(*lag, "sample", "samples"), 1.0 / ratio.max(f64::MIN_POSITIVE)
    )]
    Excitation {
        /// The mode.
        mode: usize,
        /// The input.
        input: usize,
        /// What it is called.
        name: String,
        /// How many samples back.
        lag: usize,
        /// The weakest direction over the strongest.
        ratio: f64,
    },
    /// No controller can hold an operating point beyond the limits.
    #[error(
        "mode {mode}: its operating point has {value} at input {input}, which is limited to {}: give \
         an operating point within the limits, or other limits",
        interval(*min, *max)
    )]
    OperatingInput {
        /// The mode.
        mode: usize,
        /// The input.
        input: usize,
        /// Its value at the operating point.
        value: f64,
        /// Its lower limit.
        min: Option<f64>,
        /// Its upper limit.
        max: Option<f64>,
    },
    /// Bumpless transfer cannot be proved.
    #[error(
        "bumpless transfer cannot be proved for this design: do without it, ask for another decay, or for the dwell \
         guarantee"
    )]
    Bumpless,
    /// Part of the disturbance does not show in the outputs at once.
    #[error(
        "no unknown input observer exists for mode {mode}{}: rank(C E) = {seen}, but rank(E) = {wanted}, \
         so part of the disturbance does not show in the outputs at once; use a Luenberger observer or more sensors",
        entering(*mode, *successor)
    )]
    HiddenDisturbance {
        /// The mode.
        mode: usize,
        /// The mode that follows.
        successor: usize,
        /// `rank(C E)`.
        seen: usize,
        /// `rank(E)`.
        wanted: usize,
    },
    /// There is nothing to decouple.
    #[error(
        "an unknown input observer needs a disturbance on the state (E), but there is none: use a Luenberger observer, or leave the \
         choice to the design"
    )]
    NoDisturbance,
    /// The outputs do not show an eigenvalue that decays too slowly.
    #[error("{}", undetectable(*mode, *decay, *magnitude, *decoupled))]
    Undetectable {
        /// The mode.
        mode: usize,
        /// The decay that is asked for.
        decay: f64,
        /// Magnitude of the eigenvalue.
        magnitude: f64,
        /// Whether it is decoupling the disturbance that hides it.
        decoupled: bool,
    },
    /// A theorem as printed does not fit the plant's sizes.
    #[error(
        "equation {equation} as printed needs as many outputs as states, but the plant has {outputs} and {states}: \
         use the corrected theorems"
    )]
    Printed {
        /// Number of the equation.
        equation: &'static str,
        /// Outputs of the plant.
        outputs: usize,
        /// States of the plant.
        states: usize,
    },
    /// The design holds gains that were not made by synthesis.
    #[error("the gains were not made by synthesis: design them again")]
    NotSynthesised,
}

fn undetectable(mode: usize, decay: f64, magnitude: f64, decoupled: bool) -> String {
    let above = least_decay(magnitude);
    let help = match (above < 1.0, decoupled) {
        (true, _) => format!("ask for a decay of the observer above {above:.4}"),
        (false, true) => "leave the choice of the observer to the design, or use more sensors".into(),
        (false, false) => {
            "no observer of any kind moves it: add a sensor that shows it, or take what grows out of the model if the \
             plant does not have it"
                .into()
        }
    };
    let (which, whose) = match decoupled {
        true => ("observer of this kind", "(C, T A)"),
        false => ("observer", "A"),
    };
    format!(
        "no {which} reaches decay {decay} in mode {mode}: {whose} has an eigenvalue of magnitude {magnitude:.4} that the \
         outputs do not show; {help}"
    )
}
