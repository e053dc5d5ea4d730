//! How a true plant departs from the model that describes it, apart from its matrices.

use crate::number::{self, NumberError};
use crate::scenario::{FaultError, FaultEvent, IntervalError, first_tick, interval};
use crate::{Mode, SwitchedPlant};
use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use core::fmt;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Departures of the true plant; the default is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct Deviation {
    /// Gain of each actuator (m); none given: 1.
    pub input_gain: Vec<f64>,
    /// Samples by which every reading is late.
    pub sensor_delay: usize,
    /// Loads that come and go while the scenario runs.
    pub loads: Vec<Load>,
    /// Faults of actuators while the scenario runs; `sensor` counts inputs from 0, and an actuator
    /// that drops out gives zero.
    pub actuator_faults: Vec<FaultEvent>,
    /// Samples by which the scenario's mode is told late.
    pub mode_delay: u64,
    /// Times at which another mode is told.
    pub told: Vec<Told>,
}

/// A constant that is added somewhere during `[from, until)` seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "where, when, how much")]
pub struct Load {
    /// Where.
    pub at: Port,
    /// First instant in seconds.
    pub from: f64,
    /// End in seconds.
    pub until: f64,
    /// In the units of the signal; of a state per sample.
    pub size: f64,
}

/// Where a load acts, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(clippy::exhaustive_enums, reason = "all that moves the state")]
pub enum Port {
    /// On an input, behind its actuator.
    Input(usize),
    /// On a disturbance, so through `E` and `F`.
    Disturbance(usize),
    /// On a state, in every sample.
    State(usize),
}

/// A mode (0-based) that is told during `[from, until)` seconds, whichever is active.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::exhaustive_structs, reason = "what, when")]
pub struct Told {
    /// First instant in seconds.
    pub from: f64,
    /// End in seconds.
    pub until: f64,
    /// What is told.
    pub mode: usize,
}

/// Whether `tick` lies in `[from, until)` seconds.
fn is_within(tick: u64, from: f64, until: f64, sample_time: f64) -> bool {
    (first_tick(from, sample_time)..first_tick(until, sample_time)).contains(&tick)
}

impl Load {
    /// Whether it acts at `tick`.
    pub fn active(&self, tick: u64, sample_time: f64) -> bool {
        is_within(tick, self.from, self.until, sample_time)
    }
}

impl Told {
    /// Whether it is told at `tick`.
    pub fn active(&self, tick: u64, sample_time: f64) -> bool {
        is_within(tick, self.from, self.until, sample_time)
    }
}

/// The longest delay of the sensors in samples.
pub const LONGEST_DELAY: usize = 1000;

/// Why a deviation does not fit a plant. Inputs, loads, faults and times count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviationError {
    /// Not one gain for each input.
    #[error("the true plant has {found} input gains, but the plant has {needed} inputs")]
    InputGains {
        /// Gains found.
        found: usize,
        /// Inputs of the plant.
        needed: usize,
    },
    /// The gain of an input is no number of practical size.
    #[error("the gain of input {input} {error}")]
    InputGain {
        /// The input.
        input: usize,
        /// What is wrong with it.
        error: NumberError,
    },
    /// A load acts on what does not exist.
    #[error("a load acts on {0}, which the plant does not have")]
    Load(Port),
    /// A load begins or ends at no time.
    #[error("load {load}: {error}")]
    LoadInterval {
        /// Which load.
        load: usize,
        /// What is wrong with it.
        error: IntervalError,
    },
    /// The size of a load is no number of practical size.
    #[error("load {load}: its size {error}")]
    LoadSize {
        /// Which load.
        load: usize,
        /// What is wrong with it.
        error: NumberError,
    },
    /// An actuator fault is ill-formed, or at an input that does not exist.
    #[error("actuator fault {fault}: {error}")]
    ActuatorFault {
        /// Which fault.
        fault: usize,
        /// What is wrong with it.
        error: FaultError,
    },
    /// The mode that is reported does not exist.
    #[error("a mode is told that the plant does not have")]
    ReportedMode,
    /// Another mode is told from or until no time.
    #[error("mode told {told}: {error}")]
    Told {
        /// Which of the times.
        told: usize,
        /// What is wrong with it.
        error: IntervalError,
    },
    /// The readings are too late (samples).
    #[error("the sensors are {0} samples late: give at most {LONGEST_DELAY}")]
    SensorDelay(usize),
}

impl Deviation {
    /// Whether every index, size and time fits this plant.
    ///
    /// # Errors
    /// What does not fit.
    pub fn check(&self, plant: &SwitchedPlant) -> Result<(), DeviationError> {
        let dims = plant.dimensions();
        if !self.input_gain.is_empty() && self.input_gain.len() != dims.inputs {
            return Err(DeviationError::InputGains {
                found: self.input_gain.len(),
                needed: dims.inputs,
            });
        }
        if let Some((at, error)) = number::first(&self.input_gain, number::number) {
            let input = at + 1;
            return Err(DeviationError::InputGain { input, error });
        }
        for (at, load) in self.loads.iter().enumerate() {
            let there = match load.at {
                Port::Input(at) => at < dims.inputs,
                Port::Disturbance(at) => at < dims.disturbances,
                Port::State(at) => at < dims.states,
            };
            if !there {
                return Err(DeviationError::Load(load.at));
            }
            let load_at = at + 1;
            interval(load.from, load.until).map_err(|error| DeviationError::LoadInterval {
                load: load_at,
                error,
            })?;
            number::number(load.size).map_err(|error| DeviationError::LoadSize {
                load: load_at,
                error,
            })?;
        }
        for (at, fault) in self.actuator_faults.iter().enumerate() {
            let ill_formed = |error| DeviationError::ActuatorFault {
                fault: at + 1,
                error,
            };
            fault.check(dims.inputs).map_err(ill_formed)?;
        }
        for (at, told) in self.told.iter().enumerate() {
            if told.mode >= plant.modes.len() {
                return Err(DeviationError::ReportedMode);
            }
            let ill_formed = |error| DeviationError::Told {
                told: at + 1,
                error,
            };
            interval(told.from, told.until).map_err(ill_formed)?;
        }
        if self.sensor_delay > LONGEST_DELAY {
            return Err(DeviationError::SensorDelay(self.sensor_delay));
        }
        Ok(())
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(at) => write!(f, "input {}", at + 1),
            Self::Disturbance(at) => write!(f, "disturbance {}", at + 1),
            Self::State(at) => write!(f, "state {}", at + 1),
        }
    }
}

/// A mode of a true plant that is unstable where the model's is not.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Destabilised {
    /// The mode, from 0.
    pub mode: usize,
    /// Spectral radius of the true plant's `A`.
    pub radius: f64,
    /// Spectral radius of the model's.
    pub model: f64,
}

impl SwitchedPlant {
    /// The modes of this plant that are unstable while those of `model` are stable.
    pub fn destabilised(&self, model: &Self) -> Vec<Destabilised> {
        let pairs = self.modes.iter().zip(&model.modes).enumerate();
        pairs
            .map(|(mode, (own, nominal))| Destabilised {
                mode,
                radius: own.spectral_radius(),
                model: nominal.spectral_radius(),
            })
            .filter(|found| found.radius >= 1.0 && found.model < 1.0)
            .collect()
    }

    /// This plant with every entry of `A`, `B` and `E` multiplied by `1 + error r`, where `r` is drawn
    /// uniformly from -1 to 1: the same for the same `seed`.
    pub fn perturbed(&self, error: f64, seed: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform =
            || 2.0 * ((generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64) - 1.0;
        let mut off = |matrix: &DMatrix<f64>| matrix.map(|entry| entry * (1.0 + error * uniform()));
        let modes = self
            .modes
            .iter()
            .map(|mode| Mode {
                a: off(&mode.a),
                b: off(&mode.b),
                e: off(&mode.e),
                ..mode.clone()
            })
            .collect();
        Self {
            sample_time: self.sample_time,
            modes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OperatingPoint;
    use crate::scenario::FaultKind;
    use nalgebra::dmatrix;

    fn plant() -> SwitchedPlant {
        SwitchedPlant {
            sample_time: 0.5,
            modes: vec![Mode {
                name: "only".into(),
                a: dmatrix![0.5, 0.0; 0.2, 0.4],
                b: dmatrix![1.0; 2.0],
                c: dmatrix![1.0, 0.0],
                e: dmatrix![1.0; 0.0],
                f: dmatrix![0.0],
                operating_point: OperatingPoint::zero(2, 1, 1),
            }],
        }
    }

    #[test]
    fn entries_are_off_by_at_most_the_error_and_zeros_stay() {
        let (nominal, off) = (plant(), plant().perturbed(0.1, 3));
        assert_eq!(off, plant().perturbed(0.1, 3));
        assert_ne!(off, plant().perturbed(0.1, 4));
        let (old, new) = (&nominal.modes[0], &off.modes[0]);
        for (old, new) in [(&old.a, &new.a), (&old.b, &new.b), (&old.e, &new.e)] {
            for (old, new) in old.iter().zip(new.iter()) {
                assert!((new - old).abs() <= 0.1 * old.abs());
            }
        }
        assert_eq!((&new.c, old.a[(0, 1)]), (&old.c, 0.0));
    }

    #[test]
    fn what_does_not_fit_the_plant_is_refused() {
        let load = |at| Deviation {
            loads: vec![Load {
                at,
                from: 0.0,
                until: 1.0,
                size: 1.0,
            }],
            ..Deviation::default()
        };
        assert!(load(Port::State(1)).check(&plant()).is_ok());
        let error = load(Port::State(2)).check(&plant()).unwrap_err();
        assert_eq!(error, DeviationError::Load(Port::State(2)));
        assert!(error.to_string().contains("state 3"), "{error}");
        assert!(load(Port::Input(1)).check(&plant()).is_err());
        assert!(load(Port::Disturbance(1)).check(&plant()).is_err());
        let gains = Deviation {
            input_gain: vec![1.0; 2],
            ..Deviation::default()
        };
        assert!(gains.check(&plant()).is_err());
        let told = Deviation {
            told: vec![Told {
                from: 0.0,
                until: 1.0,
                mode: 1,
            }],
            ..Deviation::default()
        };
        assert!(told.check(&plant()).is_err());
    }

    #[test]
    fn what_has_no_size_or_no_time_is_refused() {
        let said = |deviation: Deviation| deviation.check(&plant()).unwrap_err().to_string();
        let (at, size) = (Port::State(0), 1.0);
        let load = |from, until, size| Deviation {
            loads: vec![Load {
                at,
                from,
                until,
                size,
            }],
            ..Deviation::default()
        };
        assert!(load(0.0, 1.0, size).check(&plant()).is_ok());
        assert!(said(load(2.0, 1.0, size)).starts_with("load 1: it ends at 1: "));
        assert!(said(load(f64::NAN, 1.0, size)).starts_with("load 1: it begins at NaN: "));
        assert!(said(load(0.0, 1.0, f64::NAN)).starts_with("load 1: its size is NaN: "));
        let (from, until, mode) = (-1.0, 1.0, 0);
        let told = Deviation {
            told: vec![Told { from, until, mode }],
            ..Deviation::default()
        };
        assert!(said(told).starts_with("mode told 1: it begins at -1: "));
        let actuator = Deviation {
            actuator_faults: vec![FaultEvent {
                sensor: 1,
                from: 0.0,
                until: 1.0,
                kind: FaultKind::Stuck,
            }],
            ..Deviation::default()
        };
        assert!(said(actuator).starts_with("actuator fault 1: it is at channel 2 of 1"));
        let gain = Deviation {
            input_gain: vec![f64::INFINITY],
            ..Deviation::default()
        };
        assert!(said(gain).starts_with("the gain of input 1 is inf: "));
    }
}
