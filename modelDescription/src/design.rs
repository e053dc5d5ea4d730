//! The design as an FMU carries it, and what the tables need of it.

use crate::{Interface, SignalInfo};
use ftc_design::{ControllerDesign, Design, RecordError, Signal, Signals};
use ftc_plant::{Scenario, SwitchedPlant, TruePlant};
use serde::Deserialize;

/// Name of the design in an FMU's `resources` folder: MessagePack, the record as a map of its fields.
pub const DESIGN_FILE: &str = "design.msgpack";

/// Why the bytes of [`DESIGN_FILE`] cannot be written, or hold no design.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DesignFileError {
    /// The writer fails.
    #[cfg(feature = "write")]
    #[error(transparent)]
    Write(#[from] rmp_serde::encode::Error),
    /// The bytes are no record of a design.
    #[error("{DESIGN_FILE}: {0}")]
    Read(#[from] rmp_serde::decode::Error),
    /// Sizes do not agree, or a value is out of its range.
    #[error("{DESIGN_FILE}: {0}")]
    Check(#[from] RecordError),
}

/// The bytes of [`DESIGN_FILE`]: what the binaries read of a design, which is all but its proof.
///
/// # Errors
/// What the writer says.
#[cfg(feature = "write")]
pub fn write_design(design: &Design) -> Result<Vec<u8>, DesignFileError> {
    let mut running = design.clone();
    running.proof = None;
    Ok(rmp_serde::to_vec_named(&running)?)
}

/// [`Design`] without its proof, which is not there: to be able to read it, too, took a seventh of a binary.
#[derive(Deserialize)]
struct Running {
    format: u32,
    name: String,
    signals: Signals,
    plant: SwitchedPlant,
    controller: ControllerDesign,
    #[serde(default)]
    true_plant: TruePlant,
    scenario: Scenario,
}

impl From<Running> for Design {
    fn from(read: Running) -> Self {
        let mut design = Self::new(
            &read.name,
            read.plant,
            read.signals,
            read.controller,
            read.scenario,
        );
        design.format = read.format;
        design.true_plant = read.true_plant;
        design
    }
}

/// Reads the bytes of [`DESIGN_FILE`] and checks that all sizes agree.
///
/// # Errors
/// Bytes that hold no design, or one whose sizes do not agree.
pub fn read_design(bytes: &[u8]) -> Result<Design, DesignFileError> {
    let running: Running = rmp_serde::from_slice(bytes)?;
    let design = Design::from(running);
    design.check()?;
    Ok(design)
}

/// The disturbances as described, or else by their number alone.
fn disturbances(design: &Design, count: usize) -> Vec<SignalInfo> {
    let described = &design.signals.disturbances;
    (0..count)
        .map(|at| match described.get(at) {
            Some(signal) => SignalInfo {
                name: signal.name.clone(),
                unit: signal.unit.clone().unwrap_or_default(),
                nominal: Some(signal.nominal),
                ..SignalInfo::default()
            },
            None => SignalInfo {
                nominal: Some(1.0),
                ..SignalInfo::default()
            },
        })
        .collect()
}

impl From<&Design> for Interface {
    fn from(design: &Design) -> Self {
        let plant = &design.plant;
        let sample_time = plant.sample_time;
        let first = design.scenario.mode(0, sample_time);
        let point = plant.modes.get(first).map(|mode| &mode.operating_point);
        let describe = |signals: &[Signal], start: Option<&Vec<f64>>| {
            signals
                .iter()
                .enumerate()
                .map(|(at, signal)| SignalInfo {
                    name: signal.name.clone(),
                    unit: signal.unit.clone().unwrap_or_default(),
                    nominal: Some(signal.nominal),
                    min: signal.min,
                    max: signal.max,
                    start: start
                        .and_then(|values| values.get(at))
                        .copied()
                        .unwrap_or(0.0),
                })
                .collect()
        };
        Self {
            sample_time,
            stop_time: design.scenario.steps as f64 * sample_time,
            inputs: describe(&design.signals.inputs, point.map(|p| &p.u)),
            outputs: describe(&design.signals.outputs, point.map(|p| &p.y)),
            states: describe(&design.signals.states, point.map(|p| &p.x)),
            tracked: design.controller.feedback.tracked.clone(),
            disturbances: disturbances(design, plant.dimensions().disturbances),
            modes: plant.modes.len(),
            finds_the_mode: design.controller.estimator.finds_the_mode(),
            thresholds: design.controller.estimator.thresholds.clone(),
        }
    }
}
