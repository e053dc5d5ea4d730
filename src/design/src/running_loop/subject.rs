//! A design whose running loop is looked at, and the channels of its loops.

use super::gain::Channel;
use super::model::{Loop, Models};
use crate::certificate::Enclosure;
use crate::observer::check_detectable;
use crate::riccati;
use crate::{ObserverDesign, StateFeedback, Units};
use ftc_control::Matrix;
use ftc_plant::SwitchedPlant;
use nalgebra::DMatrix;

/// The gain of one channel in one loop.
pub(super) enum Claim {
    Disturbance,
    Noise,
    Fault,
}

/// A channel with what it takes to state its gain in physical units.
pub(super) struct Scaled {
    pub(super) parts: [Enclosure; 4],
    /// Physical over certificate.
    pub(super) unit: f64,
}

impl Scaled {
    pub(super) fn of(model: &Loop, units: &Units, tracked: &[usize], claim: &Claim) -> Self {
        let size = model.a.shape().0;
        match claim {
            Claim::Disturbance => Self {
                parts: [
                    model.a.clone(),
                    model.disturbance.clone(),
                    model.performance.clone(),
                    model.direct.clone(),
                ],
                unit: units.performance / units.disturbance,
            },
            Claim::Noise | Claim::Fault => {
                let inward: Vec<f64> = units.outputs.iter().map(|unit| 1.0 / unit).collect();
                let outward: Vec<f64> = tracked.iter().map(|&row| units.outputs[row]).collect();
                let ones = vec![1.0; size];
                Self {
                    parts: [
                        model.a.clone(),
                        model.sensors.in_units(&ones, &inward),
                        model.tracked.in_units(&outward, &ones),
                        Enclosure::zeros(outward.len(), inward.len()),
                    ],
                    unit: 1.0,
                }
            }
        }
    }

    pub(super) fn channel(&self) -> Channel<'_> {
        let [a, b, c, d] = &self.parts;
        Channel { a, b, c, d }
    }

    pub(super) fn level(&self, claim: &Claim) -> Option<f64> {
        let level = match claim {
            Claim::Noise => self.channel().noise_level(),
            Claim::Disturbance | Claim::Fault => self.channel().level(),
        };
        Some(level? * self.unit)
    }

    pub(super) fn proves(&self, claim: &Claim, level: f64) -> bool {
        let level = level / self.unit;
        match claim {
            Claim::Noise => self.channel().proves_noise(level),
            Claim::Disturbance | Claim::Fault => self.channel().proves(level),
        }
    }
}

/// The parts of a design that its running loop is made of.
pub(super) struct Subject<'a> {
    pub(super) plant: &'a SwitchedPlant,
    pub(super) control: &'a StateFeedback,
    pub(super) observer: &'a ObserverDesign,
    pub(super) models: Models<'a>,
}

impl<'a> Subject<'a> {
    pub(super) fn new(
        plant: &'a SwitchedPlant,
        control: &'a StateFeedback,
        observer: &'a ObserverDesign,
    ) -> Self {
        Self {
            plant,
            control,
            observer,
            models: Models::new(plant, control),
        }
    }

    pub(super) fn modes(&self) -> usize {
        self.plant.modes.len()
    }

    pub(super) fn disturbed(&self) -> bool {
        self.models.disturbed()
    }

    pub(super) fn scaled(&self, model: &Loop, claim: &Claim) -> Scaled {
        let tracked = &self.control.spec.tracked;
        Scaled::of(model, self.models.units(), tracked, claim)
    }

    pub(super) fn healthy(&self, mode: usize) -> Loop {
        self.models.healthy(mode, &self.observer.observer)
    }

    /// The loops of a set of lost sensors, where it is served.
    pub(super) fn without(&self, sensors: &[usize]) -> Option<Vec<Loop>> {
        let lost = &self.observer.observer.lost;
        let set = lost.iter().find(|set| set.sensors == sensors)?;
        let of = |(mode, gain): (usize, &Matrix)| self.models.corrected(mode, gain, sensors);
        Some(set.correction.iter().enumerate().map(of).collect())
    }

    /// Whether the sensors that are left show the whole state, per mode.
    pub(super) fn observable(&self, lost: &[usize]) -> Vec<bool> {
        let units = self.models.units();
        let of = |mode: &ftc_plant::Mode| {
            let kept: Vec<usize> = (0..mode.c.nrows()).filter(|k| !lost.contains(k)).collect();
            let a = crate::augmented::scaled(&mode.a, &units.states, &units.states);
            let c = crate::augmented::scaled(&mode.c, &units.outputs, &units.states);
            check_detectable(&a, &c.select_rows(&kept), 0.0).is_ok()
        };
        self.plant.modes.iter().map(of).collect()
    }

    /// Standard deviation of each command of a mode under the sensors' noise.
    pub(super) fn command_noise(&self, mode: usize) -> Option<Vec<f64>> {
        let model = self.healthy(mode);
        let units = self.models.units();
        let noise = &self.observer.spec.noise;
        let deviations: Vec<f64> = match noise.len() == units.outputs.len() {
            true => noise
                .iter()
                .zip(&units.outputs)
                .map(|(d, unit)| d / unit)
                .collect(),
            false => vec![0.0; units.outputs.len()],
        };
        let found = command_deviation(&model, &deviations)?;
        let inputs = found.iter().zip(&units.inputs);
        Some(inputs.map(|(deviation, unit)| deviation * unit).collect())
    }
}

/// Standard deviation of each command (m) for that of each sensor (p), all in per-unit.
pub(super) fn command_deviation(model: &Loop, deviations: &[f64]) -> Option<Vec<f64>> {
    let spread = |matrix: &DMatrix<f64>| {
        let mut scaled = matrix.clone();
        for (mut column, factor) in scaled.column_iter_mut().zip(deviations) {
            column *= *factor;
        }
        scaled
    };
    let b = spread(model.sensors.midpoint());
    let (c, d) = (
        model.command.0.midpoint(),
        spread(model.command.1.midpoint()),
    );
    let covariance = riccati::lyapunov(&model.a.midpoint().transpose(), &(&b * b.transpose()))?;
    let variance = c * covariance * c.transpose() + &d * d.transpose();
    let variance = variance.diagonal();
    Some(variance.iter().map(|v| v.max(0.0).sqrt()).collect())
}
