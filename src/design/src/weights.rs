//! Which weights of the performance signal shape the gains.
//!
//! `gamma` bounds the largest response of `v = [W_y S C x; W_z Z; W_u u]` to the disturbance. A weight whose
//! part of `v` is small at every frequency can be changed without changing `gamma`, and so shapes
//! the gains hardly; where only one part is large, its weight scales `gamma` and shapes nothing either.

use crate::Weight;
use crate::augmented::augment;
use crate::running_loop::frequency::Response;
use crate::state_feedback::{StateFeedback, scaled_gain};
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
