//! The tables of the page.

use super::{find, name_of, unit_of, variant_name};
use crate::report::page::{Column, Row, Table};
use crate::report::text::{aligned, number, significant, with_unit};
use ftc::control::parameters::EstimatorMethod;
use ftc::design::Design;
use ftc::simulate::{Trajectory, Variant};

/// MSE and VAF per tracked output and variant, true and measured.
pub fn merits(design: &Design, trajectories: &[Trajectory]) -> Table {
    let tracked = &design.controller.feedback.tracked;
    let runs: Vec<_> = [Variant::Ftc, Variant::ToldTheFault, Variant::NoFtc]
        .into_iter()
        .filter_map(|variant| find(trajectories, variant))
        .map(|run| (run.variant, run.merits(tracked)))
        .collect();
    let mut rows = Vec::new();
    for (index, &output) in tracked.iter().enumerate() {
        let name = name_of(&design.signals.outputs, output, "y");
        for (place, (variant, merits)) in runs.iter().enumerate() {
            let merit = &merits[index];
            rows.push(Row {
                cells: vec![
                    if place == 0 {
                        name.clone()
                    } else {
                        String::new()
                    },
                    variant_name(*variant).into(),
                    significant(merit.truth.mse),
                    aligned(merit.truth.vaf, 2),
                    significant(merit.measured.mse),
                    aligned(merit.measured.vaf, 2),
                ],
                emphasised: *variant == Variant::Ftc,
                begins_group: place == 0 && index > 0,
            });
        }
    }
    Table {
        caption: "Mean square error (MSE) and variance accounted for (VAF) of each tracked output about its reference".into(),
        columns: vec![
            Column::name("output"),
            Column::name("controller"),
            Column::number("true MSE"),
            Column::number("true VAF (%)"),
            Column::number("measured MSE"),
            Column::number("measured VAF (%)"),
        ],
        rows,
        notes: vec![
            "True: the output of the plant. Measured: what its sensor says, fault and noise included; integral action makes \
             a lying sensor follow the reference well, which is why a small measured error alone proves nothing. VAF \
             compares variances, so it is 0 where the output hardly varies and does not see a constant offset."
                .into(),
        ],
    }
}

/// The modes.
pub fn modes(design: &Design) -> Table {
    let controller = &design.controller;
    let modes = &controller.plant.modes;
    let learned = controller.estimator.method == EstimatorMethod::Reference;
    let mut columns = vec![Column::name("mode"), Column::number("spectral radius of A")];
    if learned {
        columns.push(Column::number("samples in its healthy database"));
    }
    let rows = modes
        .iter()
        .enumerate()
        .map(|(index, mode)| {
            let mut cells = vec![
                super::facts::mode_name(modes, index),
                number(mode.spectral_radius()),
            ];
            if learned {
                let samples = controller
                    .estimator
                    .predictors
                    .get(index)
                    .map(|p| p.samples.to_string());
                cells.push(samples.unwrap_or_else(|| "–".into()));
            }
            Row {
                cells,
                ..Row::default()
            }
        })
        .collect();
    Table {
        caption: "Modes of the plant, open loop".into(),
        columns,
        rows,
        notes: Vec::new(),
    }
}

/// The sensors and their thresholds.
pub fn sensors(design: &Design) -> Table {
    let outputs = &design.signals.outputs;
    let controller = &design.controller;
    let rows = (0..controller.plant.dimensions().outputs)
        .map(|sensor| {
            let threshold = controller.estimator.thresholds.get(sensor);
            let noise = design.scenario.noise.get(sensor);
            let cell =
                |value: Option<&f64>| value.map_or_else(|| "–".into(), |value| number(*value));
            Row {
                cells: vec![
                    with_unit(&name_of(outputs, sensor, "y"), unit_of(outputs, sensor)),
                    if controller.feedback.tracked.contains(&sensor) {
                        "yes"
                    } else {
                        "no"
                    }
                    .into(),
                    cell(threshold),
                    cell(noise),
                ],
                ..Row::default()
            }
        })
        .collect();
    Table {
        caption: "Sensors".into(),
        columns: vec![
            Column::name("sensor"),
            Column::name("tracked"),
            Column::number("fault threshold"),
            Column::number("noise in the scenario (standard deviation)"),
        ],
        rows,
        notes: Vec::new(),
    }
}
