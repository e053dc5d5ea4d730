//! The tables of the page.

use super::digest::Digest;
use super::{RANKING, find, name_of, unit_of, variant_name};
use crate::page::{Column, Row, Table};
use crate::text::{aligned, number, significant, with_unit};
use ftc_control::parameters::EstimatorMethod;
use ftc_design::Design;
use ftc_simulate::Variant;

/// MSE and VAF per tracked output and variant, true and measured.
pub fn merits(design: &Design, digests: &[Digest]) -> Table {
    let tracked = &design.controller.feedback.tracked;
    let runs: Vec<_> = RANKING
        .into_iter()
        .filter_map(|variant| find(digests, variant))
        .map(|run| (run.variant, run.merits()))
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
                    significant(merit.true_output.mse),
                    aligned(merit.true_output.vaf, 2),
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
             a faulty sensor follow the reference well, which is why a small measured error alone proves nothing. VAF \
             compares variances, so it is 0 where the output hardly varies and does not see a constant offset."
                .into(),
        ],
    }
}

/// What each variant is.
pub fn variants(digests: &[Digest]) -> Table {
    let rows = RANKING
        .into_iter()
        .filter(|variant| find(digests, *variant).is_some())
        .map(|variant| Row {
            cells: vec![variant_name(variant).into(), explanation(variant).into()],
            emphasised: variant == Variant::Ftc,
            ..Row::default()
        })
        .collect();
    Table {
        caption: "The controllers compared".into(),
        columns: vec![Column::name("controller"), Column::words("what it does")],
        rows,
        notes: Vec::new(),
    }
}

fn explanation(variant: Variant) -> &'static str {
    match variant {
        Variant::Ftc => "the design: faults are estimated and taken out of the measurement",
        Variant::ToldTheFault => {
            "the same gains, told the true fault; an estimate that also takes up disturbance or noise may do better"
        }
        Variant::Predictive => "model predictive control without fault estimation",
        Variant::Additive => {
            "the additive FTC of the paper’s section III: no attenuation of the disturbance"
        }
        Variant::NoFtc => "the same gains without fault compensation",
    }
}

/// The modes: open loop, closed loop as certified, healthy database.
pub fn modes(design: &Design) -> Table {
    let controller = &design.controller;
    let modes = &design.plant.modes;
    let control = design.proof.as_ref().map(|proof| &proof.state_feedback);
    let running = design.proof.as_ref().map(|proof| &proof.running_loop);
    let gamma = control.and_then(|control| control.gamma.as_ref());
    let mut columns = vec![
        Column::name("mode"),
        Column::number("spectral radius, open loop"),
    ];
    let mut cells: Vec<Vec<String>> = modes
        .iter()
        .enumerate()
        .map(|(index, mode)| {
            vec![
                super::mode_name(modes, index),
                number(mode.spectral_radius()),
            ]
        })
        .collect();
    let mut append = |name: &str, values: Vec<String>| {
        columns.push(Column::number(name));
        for (row, value) in cells.iter_mut().zip(values) {
            row.push(value);
        }
    };
    if let Some(control) = control {
        let radii = control.spectral_radius.iter().map(|radius| number(*radius));
        append("closed loop", radii.collect());
    }
    if let Some(gamma) = gamma {
        append(
            "γ, state known",
            gamma.iter().map(|value| aligned(*value, 4)).collect(),
        );
    }
    if let Some(running) = running {
        let column = |values: &[f64]| values.iter().map(|value| aligned(*value, 4)).collect();
        if let Some(gamma) = &running.gamma_loop {
            append("γ of the running loop", column(gamma));
        }
        append("noise gain", column(&running.noise_gain));
        append("gain of an unnoticed fault", column(&running.fault_gain));
    }
    if controller.estimator.method == EstimatorMethod::Reference {
        let samples = controller
            .estimator
            .predictors
            .iter()
            .map(|p| p.samples.to_string());
        append("samples in its healthy database", samples.collect());
    }
    let note = "γ bounds the l2 gain from the disturbance to the weighted outputs, tracking-error integrals and inputs, \
                with a state that is known and of the loop that runs; the noise gain and that of an unnoticed fault \
                lead to the true tracking error. All are proved for the gains as shipped, rounding included.";
    Table {
        caption: "Modes".into(),
        columns,
        rows: cells
            .into_iter()
            .map(|cells| Row {
                cells,
                ..Row::default()
            })
            .collect(),
        notes: gamma.map(|_| note.into()).into_iter().collect(),
    }
}

/// The sensors and their thresholds.
pub fn sensors(design: &Design) -> Table {
    let outputs = &design.signals.outputs;
    let controller = &design.controller;
    let rows = (0..design.plant.dimensions().outputs)
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
