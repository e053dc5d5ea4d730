//! Which weights of the performance signal shape the gains.
//!
//! `gamma` bounds the largest response of `v = [W_y S C x; W_z Z; W_u u]` to the disturbance. A weight whose
//! part of `v` is small at every frequency can be changed without changing `gamma`, and so shapes
//! the gains hardly; where only one part is large, its weight scales `gamma` and shapes nothing either.

use crate::augmented::augment;
use crate::running_loop::frequency::Response;
use crate::state_feedback::{StateFeedback, rejection, scaled_gain};
use crate::{Design, Objective, Weight};
use ftc_plant::SwitchedPlant;
use nalgebra::DMatrix;

/// Part of the performance signal, by l2 gain, below which a weight counts as idle: the square of its gain is
/// then less than half a percent of that of the whole.
const IDLE: f64 = 0.07;

/// The l2 gain from the disturbance to what each weight weighs, over that to all of it, with the state
/// known: the largest of all modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightShares([(Weight, f64); 3]);

impl WeightShares {
    /// Of a state feedback; none where no disturbance reaches the performance signal.
    pub fn of(plant: &SwitchedPlant, control: &StateFeedback) -> Option<Self> {
        let (spec, units) = (&control.spec, &control.certificate.units);
        let r = spec.tracked.len();
        let mut shares = [
            (Weight::Output, 0.0_f64),
            (Weight::Integral, 0.0),
            (Weight::Input, 0.0),
        ];
        let models = augment(plant, spec, units);
        for (model, gains) in models.iter().zip(&control.modes) {
            let gain = scaled_gain(gains, units, spec);
            let closed = &model.a + &model.b * &gain;
            let signal = &model.h + &model.d * &gain;
            let norm = |first: usize, count: usize| {
                let rows = signal.rows(first, count).into_owned();
                let direct = DMatrix::zeros(count, model.e.ncols());
                Response::new(&closed, &model.e, &rows, &direct).norm()
            };
            let q = spec.integral_size();
            let whole = norm(0, signal.nrows());
            if !(whole.is_finite() && whole > 0.0) {
                return None;
            }
            let parts = [(0, r), (r, q), (r + q, model.b.ncols())];
            for ((_, share), (first, count)) in shares.iter_mut().zip(parts) {
                *share = share.max(norm(first, count) / whole);
            }
        }
        Some(Self(shares))
    }

    /// The share of a weight.
    pub fn share(&self, weight: Weight) -> f64 {
        let found = self.0.iter().find(|(of, _)| *of == weight);
        found.map_or(0.0, |(_, share)| *share)
    }

    /// Whether changing this weight alone changes the gains hardly.
    pub fn is_idle(&self, weight: Weight) -> bool {
        self.share(weight) < IDLE
    }

    /// The weight that decides `gamma` alone, where all others are idle: then none shapes the gains.
    pub fn alone(&self) -> Option<Weight> {
        let mut acting = self.0.iter().filter(|(weight, _)| !self.is_idle(*weight));
        match (acting.next(), acting.next()) {
            (Some((weight, _)), None) => Some(*weight),
            _ => None,
        }
    }

    /// The largest share of the idle weights.
    pub fn largest_idle(&self) -> f64 {
        let idle = self.0.iter().filter(|(weight, _)| self.is_idle(*weight));
        idle.map(|(_, share)| *share).fold(0.0, f64::max)
    }
}

/// Weights that were asked for and do not shape the state feedback, or hardly.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WithoutEffect {
    /// Which, at least one.
    pub weights: Vec<Weight>,
    /// Why not.
    pub reason: Reason,
}

/// Why a weight has no effect, or hardly any.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reason {
    /// The objective is the decay alone.
    DecayOnly,
    /// No disturbance reaches the state.
    NoDisturbance,
    /// The disturbance can be rejected completely, whatever the weights are.
    Rejected,
    /// One weight decides `gamma` alone, and only the weights' ratios shape the gains.
    Alone {
        /// That weight.
        weight: Weight,
        /// How many times smaller it would have to be, or the others larger.
        times: f64,
    },
    /// Little of the performance signal comes from there.
    Small {
        /// Share of the performance signal, 0 to 1.
        share: f64,
        /// How many times larger a weight would act.
        times: f64,
    },
}

/// Which of the weights that were asked for have no effect on the state feedback, or hardly any.
pub fn without_effect(design: &Design, asked: &[Weight]) -> Option<WithoutEffect> {
    let control = design.synthesis()?.state_feedback;
    let reason = match (&control.gamma, control.spec.objective) {
        (_, Objective::Decay) => Reason::DecayOnly,
        (None, Objective::Attenuation) => Reason::NoDisturbance,
        (Some(gamma), Objective::Attenuation) => {
            let rejection = rejection(&control.certificate.units);
            if gamma.iter().any(|&gamma| gamma > rejection) {
                return WeightShares::of(&design.plant, &control)?.without_effect(asked);
            }
            Reason::Rejected
        }
    };
    let weights = asked.to_vec();
    (!weights.is_empty()).then_some(WithoutEffect { weights, reason })
}

/// What makes the command of a design smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SmallerCommand {
    /// A slower decay.
    SlowerDecay,
    /// The objective [`Objective::Decay`]: the weight of the inputs decides `gamma` alone, so that a larger one
    /// hardly changes the gains.
    DecayObjective,
    /// A larger weight of the inputs, or a slower decay.
    LargerInputWeight,
}

impl SmallerCommand {
    /// Of a design.
    pub fn of(design: &Design) -> Self {
        let Some(synthesis) = design.synthesis() else {
            return Self::LargerInputWeight;
        };
        let control = &synthesis.state_feedback;
        if control.spec.objective == Objective::Decay {
            return Self::SlowerDecay;
        }
        let shares = WeightShares::of(&design.plant, control);
        match shares.and_then(|shares| shares.alone()) {
            Some(Weight::Input) => Self::DecayObjective,
            _ => Self::LargerInputWeight,
        }
    }
}

impl WeightShares {
    /// Which of these weights have hardly any effect; where one weight decides `gamma` alone, none has.
    fn without_effect(&self, asked: &[Weight]) -> Option<WithoutEffect> {
        let alone = self.alone();
        let weak = |weight: &Weight| alone.is_some() || self.is_idle(*weight);
        let weights: Vec<Weight> = asked.iter().copied().filter(weak).collect();
        let times = |share: f64| (0.5 / share.max(1e-12)).ceil();
        let reason = match alone {
            Some(weight) => Reason::Alone {
                weight,
                times: times(self.largest_idle()),
            },
            None => {
                let shares = weights.iter().map(|&weight| self.share(weight));
                let share = shares.fold(0.0, f64::max);
                Reason::Small {
                    share,
                    times: times(share),
                }
            }
        };
        (!weights.is_empty()).then_some(WithoutEffect { weights, reason })
    }
}

#[cfg(test)]
mod tests {
    use super::{Reason, WeightShares, WithoutEffect};
    use crate::Weight::{Input, Integral, Output};

    fn shares(output: f64, integral: f64, input: f64) -> WeightShares {
        WeightShares([(Output, output), (Integral, integral), (Input, input)])
    }

    #[test]
    fn a_weight_with_a_small_share_hardly_acts() {
        let found = shares(0.9, 0.4, 0.05);
        assert_eq!(found.without_effect(&[Output, Integral]), None);
        assert_eq!(
            found.without_effect(&[Output, Input]),
            Some(WithoutEffect {
                weights: vec![Input],
                reason: Reason::Small {
                    share: 0.05,
                    times: 10.0
                },
            })
        );
    }

    #[test]
    fn beside_a_weight_that_decides_alone_none_acts() {
        let found = shares(0.02, 0.01, 1.0);
        assert_eq!(
            found.without_effect(&[Output, Input]),
            Some(WithoutEffect {
                weights: vec![Output, Input],
                reason: Reason::Alone {
                    weight: Input,
                    times: 25.0
                },
            })
        );
        assert_eq!(found.without_effect(&[]), None);
    }
}
