//! The certificate of the loop that runs: plant, observer, integral part and latency together.
//!
//! **Stability.** The observer's error runs by itself and drives the rest: the proofs of the state
//! feedback and of the observer together prove the loop. It is exponentially stable under every
//! switching that both allow; where both ask for a dwell time, the larger one is enough.
//!
//! **Gains.** What the disturbance does to the performance signal, and what sensor noise and an
//! undetected fault do to the true tracking error, are proved of the whole loop, mode by mode, and
//! the first also under arbitrary switching where one Lyapunov function gives it within
//! [`TOLERANCE`] of what a measured state would.

pub(crate) mod frequency;
mod gain;
mod model;
#[cfg(feature = "solver")]
mod selection;
#[cfg(feature = "solver")]
mod switching;
mod transfer;
#[cfg(feature = "solver")]
mod transfer_synthesis;

use crate::blocks::{BlockKind, BlockName};
use crate::certificate::{CertificateError, FactoredLyapunov, require};
use crate::observer::{check_detectable, sets};
use crate::parallel;
use crate::riccati;
use crate::{ObserverDesign, StateFeedback, Units};
use ftc_control::Matrix;
use ftc_plant::SwitchedPlant;
use gain::Channel;
use model::{Loop, Models};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

#[cfg(feature = "solver")]
pub(crate) use selection::choose;
pub use transfer::{TRANSFER_DECAY, TransferCertificate};

/// How far the gain of the running loop may lie above that of a measured state, relatively, before a
/// quieter observer is preferred no longer, and before a claim under arbitrary switching is dropped.
pub const TOLERANCE: f64 = 0.05;

/// What is proved of the running loop. Gains are in physical units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RunningLoop {
    /// l2 gain from the disturbance to the performance signal while a mode lasts, per mode; none
    /// where the plant has no disturbance.
    pub gamma_loop: Option<Vec<f64>>,
    /// Root of the summed mean squares of the true tracking errors under independent white noise of
    /// deviation one on every sensor, per mode.
    pub noise_gain: Vec<f64>,
    /// l2 gain from a fault that is not noticed (all sensors) to the true tracking errors, per mode.
    pub fault_gain: Vec<f64>,
    /// The first gain under arbitrary switching, where one Lyapunov function proves it; none with bumpless
    /// transfer.
    pub switching: Option<SwitchingGain>,
    /// Standard deviation of each command (m), per mode, under the noise the observer was designed
    /// for. Floating point, not proved.
    pub command_noise: Vec<Vec<f64>>,
    /// What losing sensors leaves, for every set that is looked at.
    pub lost: Vec<LostSensors>,
    /// What proves bumpless transfer, where it is asked for.
    #[serde(default)]
    pub transfer: Option<TransferCertificate>,
}

/// A gain that holds under arbitrary switching.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SwitchingGain {
    /// The gain.
    pub gamma: f64,
    /// One Lyapunov matrix of the whole loop for all modes, or one per mode.
    pub lyapunov: Vec<FactoredLyapunov>,
}

/// What the loss of some sensors leaves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LostSensors {
    /// Which sensors (from 0).
    pub sensors: Vec<usize>,
    /// Whether the others show the whole state, per mode.
    pub observable: Vec<bool>,
    /// Whether gains for it are shipped and the loop is proved stable with them.
    pub stable: bool,
    /// l2 gain from the disturbance to the performance signal while set and mode last, per mode; none
    /// where there is no disturbance, or where the set is not served.
    pub gamma_loop: Option<Vec<f64>>,
}

/// The gain of one channel in one loop.
enum Claim {
    Disturbance,
    Noise,
    Fault,
}

/// A channel with what it takes to state its gain in physical units.
struct Scaled {
    parts: [crate::certificate::Enclosure; 4],
    /// Physical over certificate.
    unit: f64,
}

impl Scaled {
    fn of(model: &Loop, units: &Units, tracked: &[usize], claim: &Claim) -> Self {
        use crate::certificate::Enclosure;
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

    fn channel(&self) -> Channel<'_> {
        let [a, b, c, d] = &self.parts;
        Channel { a, b, c, d }
    }

    fn level(&self, claim: &Claim) -> Option<f64> {
        let level = match claim {
            Claim::Noise => self.channel().noise_level(),
            Claim::Disturbance | Claim::Fault => self.channel().level(),
        };
        Some(level? * self.unit)
    }

    fn proves(&self, claim: &Claim, level: f64) -> bool {
        let level = level / self.unit;
        match claim {
            Claim::Noise => self.channel().proves_noise(level),
            Claim::Disturbance | Claim::Fault => self.channel().proves(level),
        }
    }
}

/// The parts of a design that its running loop is made of.
struct Subject<'a> {
    plant: &'a SwitchedPlant,
    control: &'a StateFeedback,
    observer: &'a ObserverDesign,
    models: Models<'a>,
}

impl<'a> Subject<'a> {
    fn new(
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

    fn modes(&self) -> usize {
        self.plant.modes.len()
    }

    fn disturbed(&self) -> bool {
        self.models.disturbed()
    }

    fn scaled(&self, model: &Loop, claim: &Claim) -> Scaled {
        let tracked = &self.control.spec.tracked;
        Scaled::of(model, self.models.units(), tracked, claim)
    }

    fn healthy(&self, mode: usize) -> Loop {
        self.models.healthy(mode, &self.observer.observer)
    }

    /// The loops of a set of lost sensors, where it is served.
    fn without(&self, sensors: &[usize]) -> Option<Vec<Loop>> {
        let lost = &self.observer.observer.lost;
        let set = lost.iter().find(|set| set.sensors == sensors)?;
        let of = |(mode, gain): (usize, &Matrix)| self.models.corrected(mode, gain, sensors);
        Some(set.correction.iter().enumerate().map(of).collect())
    }

    /// Whether the sensors that are left show the whole state, per mode.
    fn observable(&self, lost: &[usize]) -> Vec<bool> {
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
    fn command_noise(&self, mode: usize) -> Option<Vec<f64>> {
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
fn command_deviation(model: &Loop, deviations: &[f64]) -> Option<Vec<f64>> {
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

impl RunningLoop {
    /// Everything that can be proved of a loop; `None` where not even a gain of a mode can.
    #[cfg(feature = "solver")]
    pub(crate) fn of(
        plant: &SwitchedPlant,
        control: &StateFeedback,
        observer: &ObserverDesign,
    ) -> Option<Self> {
        let subject = Subject::new(plant, control, observer);
        let loops: Vec<Loop> = (0..subject.modes()).map(|i| subject.healthy(i)).collect();
        let levels = |loops: &[Loop], claim: Claim| -> Option<Vec<f64>> {
            parallel::every(loops, |model| subject.scaled(model, &claim).level(&claim))
        };
        let disturbed = subject.disturbed();
        let table = parallel::each(&sets(plant.dimensions().outputs), |sensors| {
            let served = subject.without(sensors);
            LostSensors {
                observable: subject.observable(sensors),
                stable: served.is_some(),
                gamma_loop: served
                    .filter(|_| disturbed)
                    .and_then(|loops| levels(&loops, Claim::Disturbance)),
                sensors: sensors.clone(),
            }
        });
        Some(Self {
            transfer: None,
            lost: table,
            gamma_loop: match disturbed {
                true => Some(levels(&loops, Claim::Disturbance)?),
                false => None,
            },
            noise_gain: levels(&loops, Claim::Noise)?,
            fault_gain: levels(&loops, Claim::Fault)?,
            switching: disturbed
                .then(|| switching::gain(&subject, TOLERANCE))
                .flatten(),
            command_noise: (0..subject.modes())
                .map(|mode| subject.command_noise(mode))
                .collect::<Option<_>>()?,
        })
    }

    /// Proves every gain again from the shipped numbers.
    ///
    /// # Errors
    /// The first claim that cannot be proved, or that does not fit the design.
    pub(crate) fn verify(
        &self,
        plant: &SwitchedPlant,
        control: &StateFeedback,
        observer: &ObserverDesign,
    ) -> Result<(), CertificateError> {
        let subject = Subject::new(plant, control, observer);
        self.check_sizes(&subject)?;
        for mode in 0..subject.modes() {
            let model = subject.healthy(mode);
            if let Some(gamma) = &self.gamma_loop {
                proved(&subject, &model, &Claim::Disturbance, gamma[mode], mode)?;
            }
            proved(&subject, &model, &Claim::Noise, self.noise_gain[mode], mode)?;
            proved(&subject, &model, &Claim::Fault, self.fault_gain[mode], mode)?;
            self.check_command_noise(&subject, mode)?;
        }
        if let Some(switching) = &self.switching {
            prove_switching(&subject, switching)?;
        }
        parallel::all(&self.lost, |entry| verify_entry(&subject, entry))?;
        match &self.transfer {
            Some(certificate) => transfer::prove(&subject, certificate),
            None => Ok(()),
        }
    }

    /// Proves bumpless transfer of the loop as well; `false` where no proof is found. A gain across switches
    /// is then claimed no longer: its proof knows nothing of what a switch does to the command.
    #[cfg(feature = "solver")]
    pub(crate) fn certify_transfer(
        &mut self,
        plant: &SwitchedPlant,
        control: &StateFeedback,
        observer: &ObserverDesign,
    ) -> bool {
        self.transfer = transfer_synthesis::certify(&Subject::new(plant, control, observer));
        if self.transfer.is_some() {
            self.switching = None;
        }
        self.transfer.is_some()
    }

    fn check_sizes(&self, subject: &Subject) -> Result<(), CertificateError> {
        let modes = subject.modes();
        let inputs = subject.plant.dimensions().inputs;
        let asked = sets(subject.plant.dimensions().outputs);
        let listed = self.lost.iter().map(|entry| &entry.sensors);
        require(&[
            (
                self.gamma_loop.as_ref().is_none_or(|g| g.len() == modes)
                    && self.gamma_loop.is_some() == subject.disturbed()
                    && self.noise_gain.len() == modes
                    && self.fault_gain.len() == modes
                    && self.command_noise.len() == modes
                    && self.command_noise.iter().all(|mode| mode.len() == inputs),
                "the gains of the running loop are not one per mode",
            ),
            (
                listed.eq(asked.iter()),
                "the table of lost sensors is not the one of the plant's sensors",
            ),
            (
                self.switching.is_none() || self.transfer.is_none(),
                "a gain under arbitrary switching is claimed of a loop with bumpless transfer",
            ),
        ])
    }

    fn check_command_noise(&self, subject: &Subject, mode: usize) -> Result<(), CertificateError> {
        let found = subject.command_noise(mode).unwrap_or_default();
        let close = found.len() == self.command_noise[mode].len()
            && found
                .iter()
                .zip(&self.command_noise[mode])
                .all(|(found, stated)| {
                    (found - stated).abs() <= 1e-6 * found.abs() + f64::MIN_POSITIVE
                });
        require(&[(
            close,
            "the noise on the command is not what the loop makes of its sensors",
        )])
    }
}

fn proved(
    subject: &Subject,
    model: &Loop,
    claim: &Claim,
    level: f64,
    mode: usize,
) -> Result<(), CertificateError> {
    let kind = match claim {
        Claim::Disturbance => BlockKind::RunningLoop,
        Claim::Noise => BlockKind::NoiseGain,
        Claim::Fault => BlockKind::FaultGain,
    };
    match level.is_finite() && subject.scaled(model, claim).proves(claim, level) {
        true => Ok(()),
        false => Err(CertificateError::Unproved(BlockName::new(kind, mode, mode))),
    }
}

/// The gain under arbitrary switching.
fn prove_switching(subject: &Subject, switching: &SwitchingGain) -> Result<(), CertificateError> {
    let loops = subject.models.switching(&subject.observer.observer);
    let arbitrary = subject.control.spec.lyapunov != crate::Lyapunov::Dwell
        && subject.observer.spec.lyapunov != crate::Lyapunov::Dwell;
    let size = |matrix: &FactoredLyapunov| [matrix.basis.shape(), matrix.core.shape()];
    let lyapunov = &switching.lyapunov;
    let Some(loops) = loops.filter(|_| arbitrary) else {
        return require(&[(
            false,
            "a gain is claimed under a switching that is not proved",
        )]);
    };
    let n = loops[0].2.a.shape().0;
    require(&[(
        (lyapunov.len() == 1 || lyapunov.len() == subject.modes())
            && lyapunov.iter().all(|matrix| size(matrix) == [(n, n); 2])
            && switching.gamma.is_finite(),
        "the Lyapunov matrices of the running loop do not have its size",
    )])?;
    let matrix = |mode: usize| &lyapunov[if lyapunov.len() == 1 { 0 } else { mode }];
    for (i, j, model) in &loops {
        let scaled = subject.scaled(model, &Claim::Disturbance);
        let level = switching.gamma / scaled.unit;
        let followers: Vec<usize> = match lyapunov.len() > 1 && i == j {
            true => (0..subject.modes()).collect(),
            false => vec![*j],
        };
        for next in followers {
            let after = (lyapunov.len() > 1).then(|| matrix(next));
            if !scaled.channel().proves_with(level, matrix(*i), after) {
                let name = BlockName::new(BlockKind::RunningLoop, *i, next);
                return Err(CertificateError::Unproved(name));
            }
        }
    }
    Ok(())
}

/// A row of the table of lost sensors.
fn verify_entry(subject: &Subject, entry: &LostSensors) -> Result<(), CertificateError> {
    let served = subject.without(&entry.sensors);
    require(&[
        (
            entry.stable == served.is_some()
                && entry.observable == subject.observable(&entry.sensors),
            "the table of lost sensors does not say what the design serves",
        ),
        (
            entry.gamma_loop.as_ref().is_none_or(|gamma| {
                served.is_some() && subject.disturbed() && gamma.len() == subject.modes()
            }),
            "a gain is claimed with sensors lost that are not served",
        ),
    ])?;
    let loops = served.unwrap_or_default();
    for (mode, (model, level)) in loops
        .iter()
        .zip(entry.gamma_loop.iter().flatten())
        .enumerate()
    {
        proved(subject, model, &Claim::Disturbance, *level, mode)?;
    }
    Ok(())
}
