//! Verdicts a person can use: which inequality, what went wrong, what to try.

use super::ControlSpec;
use super::blocks::BlockName;
use super::certificate::CertificateError;
use super::request::RequestError;
use super::spec::SpecError;
use ftc_plant::PlantError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// An inequality and how much of the conflict it carries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ConflictingBlock {
    /// Which one.
    #[serde(flatten)]
    pub name: BlockName,
    /// Its share of the dual multiplier, 0 to 1; the shares of all blocks add up to 1.
    pub weight: f64,
}

/// A change of the design that was tried, all the way to certified gains, and works. In its sentence outputs
/// count from 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Advice {
    /// Ask for a slower decay.
    Decay(f64),
    /// Ask for another kind of stability guarantee.
    Lyapunov(super::Lyapunov),
    /// Ask for another kind of guarantee and a slower decay.
    LyapunovAndDecay(super::Lyapunov, f64),
    /// Track fewer outputs (indices from 0).
    Tracked(Vec<usize>),
    /// Ask for a slower decay of the observer's error.
    ObserverDecay(f64),
    /// Ask for another kind of guarantee of the observer.
    ObserverLyapunov(super::Lyapunov),
    /// Keep only so many of the internal model's harmonics.
    Harmonics(usize),
}

impl Advice {
    /// The request with this advice followed.
    pub fn apply(&self, spec: &ControlSpec) -> ControlSpec {
        let mut changed = spec.clone();
        match self {
            Self::Decay(decay) => changed.decay = *decay,
            Self::Lyapunov(lyapunov) => changed.lyapunov = *lyapunov,
            Self::LyapunovAndDecay(lyapunov, decay) => {
                changed.lyapunov = *lyapunov;
                changed.decay = *decay;
            }
            Self::Tracked(outputs) => {
                let kept = |weights: &[f64]| {
                    let all = spec.tracked.iter().zip(weights);
                    all.filter(|(output, _)| outputs.contains(output))
                        .map(|(_, weight)| *weight)
                        .collect()
                };
                changed.output_weight = kept(&spec.output_weight);
                changed.integral_weight = kept(&spec.integral_weight);
                changed.tracked.clone_from(outputs);
            }
            Self::Harmonics(count) => changed.resonators.truncate(*count),
            // These change the observer's request.
            Self::ObserverDecay(_) | Self::ObserverLyapunov(_) => {}
        }
        changed
    }

    /// Decay rates that are tried when a faster one is infeasible.
    pub(crate) const DECAYS: [f64; 10] = [0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999];
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Decay(decay) => {
                write!(f, "a slower decay of the feedback is feasible: {decay}")
            }
            Self::Lyapunov(kind) => {
                write!(f, "another guarantee is feasible: {kind}")
            }
            Self::ObserverDecay(decay) => {
                write!(f, "a slower decay of the observer is feasible: {decay}")
            }
            Self::ObserverLyapunov(kind) => {
                write!(f, "another guarantee is feasible for the observer: {kind}")
            }
            Self::LyapunovAndDecay(kind, decay) => write!(
                f,
                "another guarantee with a slower decay is feasible: {kind} with {decay}"
            ),
            Self::Harmonics(0) => {
                f.write_str("integral action without an internal model is feasible")
            }
            Self::Harmonics(count) => write!(
                f,
                "an internal model of fewer harmonics is feasible: {count}"
            ),
            Self::Tracked(outputs) => {
                let numbers: Vec<String> = outputs.iter().map(|o| (o + 1).to_string()).collect();
                write!(
                    f,
                    "tracking fewer outputs is feasible: {}",
                    numbers.join(", ")
                )
            }
        }
    }
}

/// A conflict between inequalities, found by the margin problem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Infeasibility {
    /// The largest `t` for which every normalised inequality holds with `>= t I`; not positive.
    pub margin: f64,
    /// The inequalities that limit the margin, the largest share first.
    pub blocks: Vec<ConflictingBlock>,
    /// Changes that were tried and help; empty when none of those tried does.
    pub advice: Vec<Advice>,
}

impl Infeasibility {
    /// What conflicts, in words, without what helps.
    pub fn conflict(&self) -> String {
        let margin = format!("the design is infeasible (best margin {:.1e})", self.margin);
        let heavy: Vec<String> = self
            .blocks
            .iter()
            .take(4)
            .map(|block| format!("{} ({:.0} %)", block.name, 100.0 * block.weight))
            .collect();
        match heavy.is_empty() {
            true => margin,
            false => format!("{margin}: these conflict: {}", heavy.join(", ")),
        }
    }
}

impl fmt::Display for Infeasibility {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let help = match self.advice.is_empty() {
            true => "none of the usual changes (slower decay, dwell, fewer tracked outputs) helps"
                .into(),
            false => join(&self.advice),
        };
        write!(f, "{}; {help}", self.conflict())
    }
}

/// Everything that helps, in one line.
fn join(advice: &[Advice]) -> String {
    let advice: Vec<String> = advice.iter().map(ToString::to_string).collect();
    advice.join("; ")
}

/// The solver came back with nothing that could be a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SolverFailure {
    /// It claims that no point satisfies the inequalities.
    #[error("it found the inequalities contradictory")]
    Contradiction,
    /// The objective falls without bound.
    #[error("it found the objective unbounded: give a weight on every input")]
    Unbounded,
    /// The iteration limit was reached.
    #[error("it did not finish within its iteration limit: scale the plant by nominal values")]
    TooManyIterations,
    /// Numbers broke down.
    #[error("its numbers broke down: scale the plant by nominal values")]
    NumericalTrouble,
    /// The problem or the settings were refused.
    #[error("it refused the problem")]
    Refused,
}

/// Why there is no design.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// The request itself cannot be met or is ill-formed.
    #[error(transparent)]
    Request(RequestError),
    /// The inequalities conflict.
    #[error("{0}")]
    Infeasible(Infeasibility),
    /// The solver failed.
    #[error("the solver gave no solution: {0}")]
    Solver(#[from] SolverFailure),
    /// The gains were found, but their certificate does not check.
    #[error("{0}")]
    Uncertified(Uncertified),
}

/// A certificate that does not check, and what would help.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Uncertified {
    /// What could not be proved.
    pub reason: CertificateError,
    /// Changes that were tried and help; empty when none of those tried does.
    pub advice: Vec<Advice>,
}

impl fmt::Display for Uncertified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let help = match self.advice.is_empty() {
            true => "give nominal values of the signals or ask for another decay".into(),
            false => join(&self.advice),
        };
        write!(
            f,
            "the design could not be certified: {}; {help}",
            self.reason
        )
    }
}

impl From<RequestError> for DesignError {
    fn from(error: RequestError) -> Self {
        Self::Request(error)
    }
}

impl From<PlantError> for DesignError {
    fn from(error: PlantError) -> Self {
        Self::Request(error.into())
    }
}

impl From<SpecError> for DesignError {
    fn from(error: SpecError) -> Self {
        Self::Request(error.into())
    }
}

impl From<CertificateError> for DesignError {
    fn from(reason: CertificateError) -> Self {
        Self::Uncertified(Uncertified {
            reason,
            advice: Vec::new(),
        })
    }
}

impl DesignError {
    /// Where advice on this error belongs; `None` where a changed request is not what is missing.
    pub(crate) fn advice_mut(&mut self) -> Option<&mut Vec<Advice>> {
        match self {
            Self::Infeasible(infeasibility) => Some(&mut infeasibility.advice),
            Self::Uncertified(uncertified) => Some(&mut uncertified.advice),
            Self::Request(_) | Self::Solver(_) => None,
        }
    }
}

/// The verdict on a conflict, without advice.
pub(crate) fn infeasible(margin: f64, weights: Vec<(BlockName, f64)>) -> DesignError {
    DesignError::Infeasible(Infeasibility {
        margin: margin.min(0.0),
        blocks: by_weight(weights),
        advice: Vec::new(),
    })
}

/// The blocks that carry a conflict, the heaviest first.
pub(crate) fn by_weight(weights: Vec<(BlockName, f64)>) -> Vec<ConflictingBlock> {
    let mut blocks: Vec<ConflictingBlock> = weights
        .into_iter()
        .filter(|(_, weight)| *weight > 1e-3)
        .map(|(name, weight)| ConflictingBlock { name, weight })
        .collect();
    blocks.sort_by(|x, y| y.weight.total_cmp(&x.weight));
    blocks
}
