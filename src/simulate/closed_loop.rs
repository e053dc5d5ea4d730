//! The closed loop, controller first and then plant: what two coupled FMUs compute.

use super::metrics::{self, Merit};
use super::plant::{External, PlantSimulator};
use crate::control::{Compensate, Controller, ControllerState, Sample};
use serde::Serialize;

/// A way to run the same controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// The design as it is: faults estimated and compensated.
    Ftc,
    /// The same gains, believing every sensor.
    NoFtc,
    /// The same gains, told the true fault: the bound of any estimator.
    ToldTheFault,
}

impl Variant {
    /// Every variant, in the order they are reported.
    pub const ALL: [Self; 3] = [Self::Ftc, Self::NoFtc, Self::ToldTheFault];

    /// Its name in files.
    pub fn key(self) -> &'static str {
        match self {
            Self::Ftc => "ftc",
            Self::NoFtc => "no_ftc",
            Self::ToldTheFault => "told_the_fault",
        }
    }
}

/// Every signal of one sample.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Record {
    /// Tick.
    pub tick: u64,
    /// Active mode (0-based).
    pub mode: usize,
    /// Reference (r).
    pub reference: Vec<f64>,
    /// Disturbance (s).
    pub disturbance: Vec<f64>,
    /// Noise (p).
    pub noise: Vec<f64>,
    /// True fault (p).
    pub fault: Vec<f64>,
    /// Measured output (p).
    pub y: Vec<f64>,
    /// True output (p).
    pub y_true: Vec<f64>,
    /// Plant state (n).
    pub x: Vec<f64>,
    /// Command (m).
    pub u: Vec<f64>,
    /// State estimate (n).
    pub x_hat: Vec<f64>,
    /// Fault estimate (p).
    pub f_hat: Vec<f64>,
    /// Residual (p).
    pub residual: Vec<f64>,
    /// Declared faults (p).
    pub flagged: Vec<bool>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trajectory {
    /// How the controller was run.
    pub variant: Variant,
    /// One record per sample.
    pub records: Vec<Record>,
}

/// Figures of merit of one tracked output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Merits {
    /// What the sensor says.
    pub measured: Merit,
    /// What the plant does.
    pub truth: Merit,
}

/// Runs the scenario once. With latency 1 the command computed at a tick acts from the next tick on,
/// as it does when a master steps both FMUs in parallel.
pub fn run(plant: &PlantSimulator, controller: &Controller, variant: Variant) -> Trajectory {
    let mut state = plant.initial_state();
    let mut memory = controller.initial_state(state.mode);
    let mut acting = memory.command.clone();
    let delayed = controller.parameters().feedback.latency > 0;
    let silent_fault = vec![0.0; state.y.len()];
    let silent_disturbance = vec![0.0; state.disturbance.len()];
    let external = External {
        fault: &silent_fault,
        disturbance: &silent_disturbance,
        mode: None,
        noise: true,
    };
    let mut records = Vec::with_capacity(plant.scenario().steps as usize);
    for tick in 0..plant.scenario().steps {
        plant.observe(&mut state, &external);
        let compensate = match variant {
            Variant::Ftc => Compensate::Estimate,
            Variant::NoFtc => Compensate::Nothing,
            Variant::ToldTheFault => Compensate::Known(&state.fault),
        };
        controller.tick(
            &mut memory,
            &Sample {
                tick,
                mode: state.mode,
                measurement: &state.y,
                reference: &state.reference,
                thresholds: &controller.parameters().estimator.thresholds,
                compensate,
            },
        );
        records.push(record(&state, &memory));
        if !delayed {
            acting.clone_from(&memory.command);
        }
        plant.advance(&mut state, &acting);
        acting.clone_from(&memory.command);
    }
    Trajectory { variant, records }
}

fn record(plant: &super::PlantState, controller: &ControllerState) -> Record {
    Record {
        tick: plant.tick,
        mode: plant.mode,
        reference: plant.reference.clone(),
        disturbance: plant.disturbance.clone(),
        noise: plant.noise.clone(),
        fault: plant.fault.clone(),
        y: plant.y.clone(),
        y_true: plant.y_true.clone(),
        x: plant.x.clone(),
        u: controller.command.clone(),
        x_hat: controller.observer.estimate.clone(),
        f_hat: controller.estimator.fault.clone(),
        residual: controller.estimator.residual.clone(),
        flagged: controller.estimator.flagged.clone(),
    }
}

impl Trajectory {
    /// Figures of merit of each tracked output (rows of `tracked`, 0-based).
    pub fn merits(&self, tracked: &[usize]) -> Vec<Merits> {
        tracked
            .iter()
            .enumerate()
            .map(|(index, &row)| {
                let column = |pick: &dyn Fn(&Record) -> f64| {
                    self.records.iter().map(pick).collect::<Vec<f64>>()
                };
                let reference = column(&|r| r.reference[index]);
                Merits {
                    measured: metrics::merit(&column(&|r| r.y[row]), &reference),
                    truth: metrics::merit(&column(&|r| r.y_true[row]), &reference),
                }
            })
            .collect()
    }
}
