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
mod selection;
mod subject;
mod switching;
mod switching_proof;
mod transfer;
mod transfer_synthesis;

use crate::blocks::{BlockKind, BlockName};
use crate::certificate::{CertificateError, require};
use crate::observer::sets;
use crate::parallel;
use crate::{ObserverDesign, StateFeedback};
use ftc_plant::SwitchedPlant;
use model::Loop;
use serde::{Deserialize, Serialize};
use subject::{Claim, Subject};
use switching_proof::prove_switching;

pub(crate) use selection::choose;
pub use switching_proof::SwitchingGain;
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

impl RunningLoop {
    /// Everything that can be proved of a loop; `None` where not even a gain of a mode can.
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
