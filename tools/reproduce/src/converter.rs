//! Section VII-B: the AC/DC converter under every kind of sensor fault, against predictive control.
//!
//! The plant is the nonlinear averaged rectifier of examples/converter.toml; the paper gives no
//! parameters of its own.

#[cfg(test)]
mod fairness;
mod page;

use super::experiment::{self, OutputMerits, design, merits};
use super::{Error, Findings, Progress};
use ftc_baselines::predictive::{Predictive, PredictiveError, PredictiveSpec};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::scenario::{FaultEvent, FaultKind};
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run as simulate, run_with};
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;

/// The paper's Table 2: VAF in percent, proposed and predictive; for which fault is not said.
const REPORTED: [f64; 2] = [98.39, 96.0];

const EXAMPLE: (&str, &str) = (
    "examples/converter.toml",
    include_str!("../../../examples/converter.toml"),
);

/// When the sensor is faulty, in seconds.
const FAULTY: [f64; 2] = [5.0, 15.0];

/// Samples the predictive controller looks ahead.
const HORIZON: usize = 25;

/// Its weight of the inputs, per ampere: small, so that following the reference is what counts.
const INPUT_WEIGHT: f64 = 1e-3;

/// Who closes the loop, in the order of the tables.
const COMPARED: [Variant; 4] = [
    Variant::Ftc,
    Variant::Predictive,
    Variant::ToldTheFault,
    Variant::NoFtc,
];

/// What every table and figure calls them.
fn name(variant: Variant) -> &'static str {
    match variant {
        Variant::Ftc => "proposed FTC",
        Variant::Predictive => "predictive control",
        Variant::ToldTheFault => "told the fault",
        Variant::NoFtc => "without FTC",
        Variant::Additive => "additive FTC",
    }
}

/// A fault to be survived.
struct Case {
    /// Name in files, the first letter that of the sensor.
    key: &'static str,
    /// In words.
    words: String,
    fault: Option<(usize, FaultKind)>,
}

/// No fault, and every kind on each sensor.
fn cases() -> Vec<Case> {
    let case = |key, words: &str, sensor, kind| Case {
        key,
        words: words.into(),
        fault: Some((sensor, kind)),
    };
    let intermittent = |size| FaultKind::Intermittent { size, period: 2.0 };
    let dropout = FaultKind::Dropout;
    vec![
        Case {
            key: "none",
            words: "no fault".into(),
            fault: None,
        },
        case("v_bias", "bias 20 V", 0, FaultKind::Bias { size: 20.0 }),
        case(
            "v_gain_loss",
            "5 % too little",
            0,
            FaultKind::GainLoss { loss: 0.05 },
        ),
        case("v_drift", "drift 4 V/s", 0, FaultKind::Drift { slope: 4.0 }),
        case("v_stuck", "stuck", 0, FaultKind::Stuck),
        case("v_intermittent", "20 V, on and off", 0, intermittent(20.0)),
        case("v_dropout", "no reading", 0, dropout),
        case("i_bias", "bias 5 A", 1, FaultKind::Bias { size: 5.0 }),
        case(
            "i_gain_loss",
            "60 % too little",
            1,
            FaultKind::GainLoss { loss: 0.6 },
        ),
        case("i_drift", "drift 1 A/s", 1, FaultKind::Drift { slope: 1.0 }),
        case("i_stuck", "stuck", 1, FaultKind::Stuck),
        case("i_intermittent", "5 A, on and off", 1, intermittent(5.0)),
        case("i_dropout", "no reading", 1, dropout),
    ]
}

/// One loop under one fault.
#[derive(Clone, Debug, Serialize)]
struct Run {
    fault: &'static str,
    /// Name of the faulty sensor's output; none without fault.
    sensor: Option<String>,
    controller: Variant,
    outputs: Vec<OutputMerits>,
}

/// Every controller under one fault.
struct Trial {
    case: Case,
    runs: Vec<Run>,
    trajectories: Vec<Trajectory>,
}

impl Trial {
    fn of(&self, variant: Variant) -> Option<&Trajectory> {
        self.trajectories.iter().find(|run| run.variant == variant)
    }

    /// The figures of merit of every output.
    fn outputs(&self, variant: Variant) -> &[OutputMerits] {
        let run = self.runs.iter().find(|run| run.controller == variant);
        run.map_or(&[], |run| &run.outputs)
    }

    /// The figures of merit of the outputs the trial is about: the faulty one, or all.
    fn judged(&self, variant: Variant) -> &[OutputMerits] {
        let outputs = self.outputs(variant);
        match self.case.fault {
            Some((sensor, _)) => outputs.get(sensor..=sensor).unwrap_or_default(),
            None => outputs,
        }
    }

    /// Their true VAF.
    fn vaf(&self, variant: Variant) -> Vec<f64> {
        let judged = self.judged(variant).iter();
        judged.map(|merit| merit.true_output.vaf).collect()
    }
}

/// Runs everything.
pub fn run(progress: Progress) -> Result<Findings, Error> {
    progress("designing for the converter");
    let design = design(experiment::request(EXAMPLE)?, "converter")?;
    progress("running the converter under every fault");
    let trials: Vec<Trial> = cases()
        .into_iter()
        .map(|case| attempt(&design, case))
        .collect::<Result<_, Error>>()?;
    let runs: Vec<&Run> = trials.iter().flat_map(|trial| &trial.runs).collect();
    Ok(Findings {
        name: "converter",
        numbers: json!({ "runs": runs }),
        table: table(&runs)?,
        summary: summary(&trials),
        page: page::page(&design, &trials),
    })
}

/// Every controller under one fault.
fn attempt(design: &Design, case: Case) -> Result<Trial, Error> {
    let mut scenario = design.scenario.clone();
    scenario.events = case
        .fault
        .map(|(sensor, kind)| FaultEvent {
            sensor,
            from: FAULTY[0],
            until: FAULTY[1],
            kind,
        })
        .into_iter()
        .collect();
    let plant =
        PlantSimulator::with_true_plant(design.plant.clone(), design.true_plant.clone(), scenario);
    let controller =
        Controller::new(design.parameters()).expect("a finished design has matching sizes");
    let trajectories = COMPARED
        .into_iter()
        .map(|variant| match variant {
            Variant::Predictive => {
                let run = predict(design, &plant, HORIZON, INPUT_WEIGHT);
                run.map_err(|error| Error::Baseline {
                    case: format!("converter, {}", case.key),
                    error,
                })
            }
            _ => Ok(simulate(&plant, &controller, variant)),
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let runs = trajectories
        .iter()
        .map(|run| Run {
            fault: case.key,
            sensor: case
                .fault
                .map(|(sensor, _)| design.signals.outputs[sensor].name.clone()),
            controller: run.variant,
            outputs: merits(run, design),
        })
        .collect();
    Ok(Trial {
        case,
        runs,
        trajectories,
    })
}

/// The predictive controller: the same model, weights and limits, told the noise and the
/// disturbance's size.
fn predict(
    design: &Design,
    plant: &PlantSimulator,
    horizon: usize,
    input_weight: f64,
) -> Result<Trajectory, PredictiveError> {
    let controller = &design.controller;
    let tracked = controller.feedback.tracked.clone();
    let mut spec = PredictiveSpec::new(&design.plant, tracked, design.scenario.noise.clone());
    if let Some(proof) = &design.proof {
        (spec.output_weight).clone_from(&proof.state_feedback.output_weight);
    }
    spec.input_weight.fill(input_weight);
    spec.limits = design.signals.input_limits();
    spec.horizon = horizon;
    let mode = plant.initial_state().mode;
    let mut predictive = Predictive::new(&design.plant, &spec, mode)?;
    Ok(run_with(plant, &mut predictive, Variant::Predictive, false))
}

/// One row per output and run.
fn table(runs: &[&Run]) -> Result<Vec<u8>, Error> {
    let row = |run: &Run| {
        vec![
            run.fault.to_string(),
            run.sensor.clone().unwrap_or_default(),
            run.controller.key().to_string(),
        ]
    };
    experiment::table(
        &["fault", "faulty_sensor", "controller"],
        runs.iter().map(|run| (row(run), run.outputs.as_slice())),
    )
}

/// True VAF of the faulty output, for the terminal.
fn summary(trials: &[Trial]) -> String {
    let mut text = format!("{:<18}", "true VAF in %");
    for variant in COMPARED {
        let _ = write!(text, "{:>20}", name(variant));
    }
    text.push('\n');
    for trial in trials {
        let _ = write!(text, "{:<18}", trial.case.key);
        for variant in COMPARED {
            let values: Vec<String> = trial
                .vaf(variant)
                .iter()
                .map(|v| format!("{v:.2}"))
                .collect();
            let _ = write!(text, "{:>20}", values.join(" / "));
        }
        text.push('\n');
    }
    text
}
