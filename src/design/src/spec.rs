//! What the user asks for.

use super::Lyapunov;
use super::defaults::{DECAY, INPUT_WEIGHT, INTEGRAL_WEIGHT, OUTPUT_WEIGHT};
use super::words::counted;
use core::f64::consts::{PI, TAU};
use ftc_control::estimator::hypotheses::MOST_MODES;
pub use ftc_control::parameters::LONGEST_LATENCY;
use ftc_plant::Dimensions;
pub use ftc_plant::number::{LARGEST, SMALLEST};
use ftc_plant::number::{NumberError, positive};
use ftc_plant::scaling::Scaling;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::RangeInclusive;

/// The state feedback that is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ControlSpec {
    /// Indices (from 0) of the `r` outputs that follow a reference.
    pub tracked: Vec<usize>,
    /// Samples between a measurement and the first effect of its command: 0 or 1.
    pub latency: usize,
    /// Which guarantee of stability under switching.
    pub lyapunov: Lyapunov,
    /// Decay rate `alpha`: the state shrinks by this factor per sample, `0 < alpha <= 1`.
    pub decay: f64,
    /// What is optimised.
    pub objective: Objective,
    /// Angle per sample (radians, between 0 and pi) of each resonator of the internal model: the
    /// tracking error vanishes at these frequencies too. None without an internal model.
    #[serde(default)]
    pub resonators: Vec<f64>,
    /// `W_y`: weight of each tracked output (r), per physical unit.
    pub output_weight: Vec<f64>,
    /// `W_z`: weight of each integrator state (r), per physical unit times second; also that of both
    /// states of each resonator of the same output.
    pub integral_weight: Vec<f64>,
    /// `W_u`: weight of each input (m), per physical unit.
    pub input_weight: Vec<f64>,
}

/// What is wrong with a request, whatever the plant's numbers. Outputs and harmonics count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecError {
    /// No output is tracked.
    #[error("no output is tracked: name at least one")]
    NothingTracked,
    /// More outputs are tracked than there are inputs.
    #[error(
        "{tracked} tracked outputs need as many inputs, but the plant has {inputs}: track fewer outputs"
    )]
    TooFewInputs {
        /// Tracked outputs.
        tracked: usize,
        /// Inputs of the plant.
        inputs: usize,
    },
    /// An output that does not exist is tracked.
    #[error("output {output} is to be tracked, but the plant has {outputs}: name one that it has")]
    UnknownOutput {
        /// The output.
        output: usize,
        /// Outputs of the plant.
        outputs: usize,
    },
    /// An output is tracked twice.
    #[error("output {0} is to be tracked twice: name it once")]
    TrackedTwice(usize),
    /// The latency is longer than [`LONGEST_LATENCY`].
    #[error("the latency is {0} samples: give 0 to {LONGEST_LATENCY}")]
    Latency(usize),
    /// A decay rate outside (0, 1].
    #[error("{of} is {decay}: give a number above 0 and at most 1")]
    Decay {
        /// Which decay rate.
        of: DecayRate,
        /// Its value.
        decay: f64,
    },
    /// Decay rate 1 under the dwell guarantee.
    #[error("{0} is 1, which gives no finite dwell time: give a number below 1")]
    NoDwellTime(DecayRate),
    /// A harmonic lies where no resonator can be told from the integrator or the highest frequency.
    #[error(
        "the internal model cannot hold harmonic {harmonic} of the disturbance, whose period is {samples:.6} samples: \
         choose a sample time at which it lies between {shortest:.4} and {longest:.0} samples, or use fewer harmonics or none"
    )]
    Harmonic {
        /// The harmonic.
        harmonic: usize,
        /// Its period in samples.
        samples: f64,
        /// The shortest period a resonator can have.
        shortest: f64,
        /// The longest.
        longest: f64,
    },
    /// Two resonators have one frequency.
    #[error(
        "resonator {resonator} turns by {angle} radians per sample, as an earlier one does: name each frequency once"
    )]
    SameFrequency {
        /// The later one.
        resonator: usize,
        /// Its angle in radians per sample.
        angle: f64,
    },
    /// A list of weights has the wrong length.
    #[error("the {weight} weight has {}: give {needed}", counted(*.found, "entry", "entries"))]
    WeightCount {
        /// Which weight.
        weight: Weight,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
    /// A weight is negative, no number or beyond [`LARGEST`].
    #[error("the {weight} weight has the entry {value}: give a number from 0 to {LARGEST:e}")]
    Weight {
        /// Which weight.
        weight: Weight,
        /// The entry.
        value: f64,
    },
    /// A number of the estimator is out of its range.
    #[error("{of} is {value}: give a number from {least} to {most}")]
    Estimator {
        /// Which number.
        of: EstimatorNumber,
        /// Its value.
        value: f64,
        /// The least allowed.
        least: f64,
        /// The most allowed.
        most: f64,
    },
    /// A size that the estimator is told is not positive.
    #[error("{of} {error}")]
    EstimatorSize {
        /// Which size.
        of: EstimatorNumber,
        /// What is wrong with it.
        error: NumberError,
    },
    /// The plant has more modes than can be told apart by the readings.
    #[error(
        "the mode is to be found among {0}, but at most {MOST_MODES} can be told apart: tell the mode"
    )]
    TooManyModes(usize),
    /// A list of the estimator's numbers has the wrong length.
    #[error("{of} has {}: give {needed}", counted(*.found, "entry", "entries"))]
    EstimatorCount {
        /// Which numbers.
        of: EstimatorNumber,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
    },
}

/// One of the numbers that the estimator is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EstimatorNumber {
    /// Relative error of the plant's matrices.
    ModelError,
    /// Faults per sample and sensor.
    FaultRate,
    /// Mean length of a fault in samples.
    FaultLength,
    /// Mean length of a mode in samples.
    ModeLength,
    /// Largest correction of a sensor.
    Authority,
    /// Size of a load on an input.
    InputLoad,
    /// A threshold of a residual.
    Threshold,
    /// Thresholds in standard deviations of the residual.
    Sigmas,
    /// Consecutive samples that raise or release a fault.
    Debounce,
    /// Repetitions after which a sensor counts as frozen.
    StuckAfter,
}

impl fmt::Display for EstimatorNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ModelError => "the model error",
            Self::FaultRate => "the rate of faults",
            Self::FaultLength => "the mean length of a fault",
            Self::ModeLength => "the mean length of a mode",
            Self::Authority => "the authority of the compensation",
            Self::InputLoad => "the size of a load on an input",
            Self::Threshold => "the threshold",
            Self::Sigmas => "the threshold in standard deviations",
            Self::Debounce => "the debounce",
            Self::StuckAfter => "the count of repetitions of a frozen sensor",
        })
    }
}

/// One of the weights of (T2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Weight {
    /// `W_y`, of the tracked outputs.
    Output,
    /// `W_z`, of the integrators.
    Integral,
    /// `W_u`, of the inputs.
    Input,
}

impl fmt::Display for Weight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Output => "output",
            Self::Integral => "integral",
            Self::Input => "input",
        })
    }
}

/// One of the two decay rates that are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DecayRate {
    /// `alpha`, of the state feedback.
    Feedback,
    /// `beta`, of the observer's error.
    Observer,
}

impl fmt::Display for DecayRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Feedback => "the decay of the feedback",
            Self::Observer => "the decay of the observer",
        })
    }
}

/// What the gains are chosen for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(clippy::exhaustive_enums, reason = "Theorems T1 and T2")]
pub enum Objective {
    /// The least l2 gain `gamma` from the disturbance to the performance signal (T2).
    #[default]
    Attenuation,
    /// Stability with the decay rate only (T1, the corrected form of Theorem 1).
    Decay,
}

impl ControlSpec {
    /// The latency, in samples, where none is asked for.
    pub const LATENCY: usize = 0;

    /// What is asked for where nothing else is: the first outputs are tracked, as many as there are
    /// inputs, and [`ControlSpec::tracking`] gives the rest.
    pub fn new(scaling: &Scaling) -> Self {
        let r = scaling.outputs.len().min(scaling.inputs.len());
        Self::tracking((0..r).collect(), scaling)
    }

    /// The defaults for these tracked outputs (from 0): decay 0.95, one Lyapunov function, least `gamma`, and
    /// weights 1 (outputs), 0.3 (their integrals) and 0.1 (inputs) divided by the nominal values.
    pub fn tracking(tracked: Vec<usize>, scaling: &Scaling) -> Self {
        let weights = |weight: f64| {
            let nominal = tracked.iter().map(|&output| scaling.outputs[output]);
            nominal.map(|nominal| weight / nominal).collect()
        };
        Self {
            latency: Self::LATENCY,
            lyapunov: Lyapunov::Common,
            decay: DECAY,
            objective: Objective::Attenuation,
            resonators: Vec::new(),
            output_weight: weights(OUTPUT_WEIGHT),
            integral_weight: weights(INTEGRAL_WEIGHT),
            input_weight: scaling
                .inputs
                .iter()
                .map(|nominal| INPUT_WEIGHT / nominal)
                .collect(),
            tracked,
        }
    }

    /// Theorem T2 without weighing anything, to compare with other solvers: decay 1, every weight 1.
    pub fn unweighted(dims: Dimensions) -> Self {
        let scaling = Scaling::unit(dims.states, dims.inputs, dims.outputs);
        let usual = Self::new(&scaling);
        let r = usual.tracked.len();
        Self {
            decay: 1.0,
            integral_weight: vec![1.0; r],
            input_weight: vec![1.0; dims.inputs],
            ..usual
        }
    }

    /// Size `q` of the integral part: one integrator per tracked output, and two states per tracked
    /// output and resonator.
    pub fn integral_size(&self) -> usize {
        self.tracked.len() * (1 + 2 * self.resonators.len())
    }

    /// Whether the request fits a plant of these sizes.
    ///
    /// # Errors
    /// A size, an index or a number is out of its range.
    pub fn check(&self, dims: Dimensions) -> Result<(), SpecError> {
        let r = self.tracked.len();
        if r == 0 {
            return Err(SpecError::NothingTracked);
        }
        if r > dims.inputs {
            return Err(SpecError::TooFewInputs {
                tracked: r,
                inputs: dims.inputs,
            });
        }
        for (at, output) in self.tracked.iter().enumerate() {
            if *output >= dims.outputs {
                return Err(SpecError::UnknownOutput {
                    output: output + 1,
                    outputs: dims.outputs,
                });
            }
            if self.tracked[..at].contains(output) {
                return Err(SpecError::TrackedTwice(output + 1));
            }
        }
        if self.latency > LONGEST_LATENCY {
            return Err(SpecError::Latency(self.latency));
        }
        check_decay(DecayRate::Feedback, self.decay, self.lyapunov)?;
        check_resonators(&self.resonators)?;
        for (weight, weights, size) in [
            (Weight::Output, &self.output_weight, r),
            (Weight::Integral, &self.integral_weight, r),
            (Weight::Input, &self.input_weight, dims.inputs),
        ] {
            if weights.len() != size {
                return Err(SpecError::WeightCount {
                    weight,
                    found: weights.len(),
                    needed: size,
                });
            }
            let sound = |value: &&f64| (0.0..=LARGEST).contains(*value);
            if let Some(&value) = weights.iter().find(|value| !sound(value)) {
                return Err(SpecError::Weight { weight, value });
            }
        }
        Ok(())
    }
}

/// Angles between resonators, and between a resonator and the integrator (0) or the highest
/// frequency there is (pi), below which no gains could tell them apart in double precision.
const CLOSEST_ANGLES: f64 = 1e-3;

/// Every resonator's angle lies between 0 and pi and keeps its distance from both and from the others.
fn check_resonators(angles: &[f64]) -> Result<(), SpecError> {
    let admissible = CLOSEST_ANGLES..=PI - CLOSEST_ANGLES;
    for (index, angle) in angles.iter().enumerate() {
        let harmonic = index + 1;
        if !admissible.contains(angle) {
            let samples = TAU / angle;
            return Err(SpecError::Harmonic {
                harmonic,
                samples,
                shortest: TAU / admissible.end(),
                longest: TAU / admissible.start(),
            });
        }
        let near = |other: &f64| (other - angle).abs() < CLOSEST_ANGLES;
        if angles[..index].iter().any(near) {
            return Err(SpecError::SameFrequency {
                resonator: harmonic,
                angle: *angle,
            });
        }
    }
    Ok(())
}

/// Whether a number of the estimator lies in its range.
pub(crate) fn within(
    of: EstimatorNumber,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<(), SpecError> {
    match range.contains(&value) {
        true => Ok(()),
        false => Err(SpecError::Estimator {
            of,
            value,
            least: *range.start(),
            most: *range.end(),
        }),
    }
}

/// Whether there are as many sizes as channels, each positive and of practical magnitude.
pub(crate) fn sizes_within(
    of: EstimatorNumber,
    sizes: &[f64],
    channels: usize,
) -> Result<(), SpecError> {
    if sizes.len() != channels {
        return Err(SpecError::EstimatorCount {
            of,
            found: sizes.len(),
            needed: channels,
        });
    }
    let mut sizes = sizes.iter();
    sizes.try_for_each(|&size| size_within(of, size))
}

/// Whether a size is positive and of practical magnitude.
pub(crate) fn size_within(of: EstimatorNumber, size: f64) -> Result<(), SpecError> {
    positive(size).map_err(|error| SpecError::EstimatorSize { of, error })
}

/// A decay rate lies in (0, 1]; strictly below 1 where a dwell time must come out of it.
fn check_decay(of: DecayRate, decay: f64, lyapunov: Lyapunov) -> Result<(), SpecError> {
    if !(decay > 0.0 && decay <= 1.0) {
        return Err(SpecError::Decay { of, decay });
    }
    if lyapunov == Lyapunov::Dwell && decay == 1.0 {
        return Err(SpecError::NoDwellTime(of));
    }
    Ok(())
}

/// Which observer is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new kind must be designed and read: the compiler says where"
)]
pub enum ObserverChoice {
    /// The one that serves the running loop best: a Kalman filter, or the unknown input observer where
    /// it exists and the command is quieter with it.
    #[default]
    Auto,
    /// The unknown input observer (11)-(17): the state disturbance does not reach the estimate.
    Uio,
    /// No decoupling: `H = 0`, `T = I`.
    Luenberger,
    /// A Kalman filter in correction form, its ratio of noises chosen for the running loop.
    Kalman,
}

/// The observer that is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ObserverSpec {
    /// Which kind.
    pub kind: ObserverChoice,
    /// Decay rate `beta` of the estimation error, `0 < beta <= 1`.
    pub decay: f64,
    /// Which guarantee of stability under switching.
    pub lyapunov: Lyapunov,
    /// Standard deviation of each sensor's noise (p), in output units; only their proportions matter.
    /// Empty: in proportion to the nominal values.
    #[serde(default)]
    pub noise: Vec<f64>,
}

impl ObserverSpec {
    /// An observer of this kind, decay and guarantee for noises in proportion to the nominal values.
    pub fn new(kind: ObserverChoice, decay: f64, lyapunov: Lyapunov) -> Self {
        Self {
            kind,
            decay,
            lyapunov,
            noise: Vec::new(),
        }
    }

    /// The defaults beside a controller of this decay and guarantee: the kind that serves the loop best, a
    /// decay as fast as the controller's.
    pub fn beside(control: &ControlSpec) -> Self {
        Self {
            kind: ObserverChoice::Auto,
            decay: control.decay,
            lyapunov: control.lyapunov,
            noise: Vec::new(),
        }
    }

    /// Whether the request can be met by any observer.
    ///
    /// # Errors
    /// The decay rate is out of its range.
    pub fn check(&self) -> Result<(), SpecError> {
        check_decay(DecayRate::Observer, self.decay, self.lyapunov)
    }
}
