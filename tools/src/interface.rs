//! What the tables of variables need to know of a design.

use ftc::design::{Design, Signal};
use model_description::{Interface, SignalInfo};

/// Sizes, names and start values: at rest at the operating point of the scenario's first mode.
pub fn interface(design: &Design) -> Interface {
    let controller = &design.controller;
    let plant = &controller.plant;
    let dims = plant.dimensions();
    let mode = design.scenario.mode(0, plant.sample_time);
    let point = &plant.modes[mode].operating_point;
    Interface {
        sample_time: plant.sample_time,
        stop_time: design.scenario.steps as f64 * plant.sample_time,
        inputs: signals(&design.signals.inputs, &point.u),
        outputs: signals(&design.signals.outputs, &point.y),
        states: signals(&design.signals.states, &point.x),
        tracked: controller.feedback.tracked.clone(),
        disturbances: dims.disturbances,
        modes: plant.modes.len(),
        thresholds: controller.estimator.thresholds.clone(),
    }
}

fn signals(signals: &[Signal], start: &[f64]) -> Vec<SignalInfo> {
    let info = |(signal, &start): (&Signal, &f64)| SignalInfo {
        name: signal.name.clone(),
        unit: signal.unit.clone().unwrap_or_default(),
        nominal: Some(signal.nominal),
        min: signal.min,
        max: signal.max,
        start,
    };
    signals.iter().zip(start).map(info).collect()
}
