//! Section VII-A: the paper's switched example in every variant, and what the paper says of it.

mod claims;
mod page;
mod printed;
mod reachable;

use super::experiment::{self, OutputMerits, design, merits, true_error};
use super::{Error, Findings, Progress};
use claims::Claims;
use ftc_baselines::deadbeat_bound;
use ftc_control::Controller;
use ftc_control::ControllerParameters;
use ftc_control::parameters::{Compensation, EstimatorMethod};
use ftc_design::assembly::Request;
use ftc_design::{Design, Objective};
use ftc_plant::scenario::Waveform;
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run as simulate};
use report::table::number;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;

/// Where the disturbance enters, and the example that says so: its file and text.
const CHANNELS: [(&str, (&str, &str)); 2] = [
    (
        "state",
        (
            "examples/paper.toml",
            include_str!("../../../examples/paper.toml"),
        ),
    ),
    (
        "output",
        (
            "examples/paper_output.toml",
            include_str!("../../../examples/paper_output.toml"),
        ),
    ),
];

/// Standard deviations of the measurement noise.
const NOISES: [f64; 2] = [0.0, 0.005];

/// Names of the references; the paper does not give its own.
const REFERENCES: [&str; 4] = ["constant", "square", "sine", "levels"];

/// What closes the loop in one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum ControllerKind {
    /// The corrected design: gains of T2, reference estimator, virtual sensor.
    Proposed,
    /// The same, told the fault.
    ToldTheFault,
    /// The proposed gains and estimator, with the printed compensation.
    PrintedCompensation,
    /// Section III with the reference estimator.
    AdditiveReference,
    /// Section III with the sliding window, as printed.
    AdditiveSliding,
    /// The proposed gains without fault compensation.
    NoFtc,
}

impl ControllerKind {
    const ALL: [Self; 6] = [
        Self::Proposed,
        Self::ToldTheFault,
        Self::PrintedCompensation,
        Self::AdditiveReference,
        Self::AdditiveSliding,
        Self::NoFtc,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Proposed => "proposed FTC",
            Self::ToldTheFault => "told the fault",
            Self::PrintedCompensation => "proposed, (38) printed",
            Self::AdditiveReference => "additive, reference",
            Self::AdditiveSliding => "additive, as printed",
            Self::NoFtc => "without FTC",
        }
    }

    fn explanation(self) -> &'static str {
        match self {
            Self::Proposed => {
                "gains of the corrected Theorem 2 (attenuation), fault estimated with the reference window, \
                 virtual sensor"
            }
            Self::ToldTheFault => {
                "the same gains, told the true fault; an estimate that also takes up disturbance or noise may do better"
            }
            Self::PrintedCompensation => {
                "the same gains and estimates, compensated by the additive control (37)-(40)"
            }
            Self::AdditiveReference => {
                "section III: gains of the corrected Theorem 1 (decay, no attenuation), additive control, \
                 but the reference window as estimator"
            }
            Self::AdditiveSliding => "the same with the sliding window (44) as printed",
            Self::NoFtc => "the proposed gains without fault compensation",
        }
    }

    fn variant(self) -> Variant {
        match self {
            Self::Proposed | Self::PrintedCompensation => Variant::Ftc,
            Self::ToldTheFault => Variant::ToldTheFault,
            Self::AdditiveReference | Self::AdditiveSliding => Variant::Additive,
            Self::NoFtc => Variant::NoFtc,
        }
    }
}

/// One loop under one scenario.
#[derive(Clone, Debug, Serialize)]
struct Run {
    channel: &'static str,
    reference: &'static str,
    noise: f64,
    controller: ControllerKind,
    outputs: Vec<OutputMerits>,
    /// True mean square error over that of the controller told the fault.
    over_told: f64,
    /// Mean square error of a response one sample late, summed over the outputs.
    deadbeat_bound: f64,
}

/// The designs of one channel and noise level.
struct Designs {
    proposed: Design,
    additive: Design,
    sliding: Design,
}

impl Designs {
    fn new(request: &Request, case: &str) -> Result<Self, Error> {
        let mut additive = request.clone();
        additive.control.objective = Objective::Decay;
        additive.compensation = Compensation::Additive;
        let mut sliding = additive.clone();
        sliding.estimator.method = EstimatorMethod::Sliding;
        Ok(Self {
            proposed: design(request.clone(), case)?,
            additive: design(additive, &format!("{case}, additive control"))?,
            sliding: design(
                sliding,
                &format!("{case}, additive control with the sliding window"),
            )?,
        })
    }

    fn controller(&self, controller: ControllerKind) -> ControllerParameters {
        match controller {
            ControllerKind::Proposed | ControllerKind::ToldTheFault | ControllerKind::NoFtc => {
                self.proposed.parameters()
            }
            ControllerKind::PrintedCompensation => {
                let mut parameters = self.proposed.parameters();
                parameters.compensation = Compensation::Additive;
                parameters
            }
            ControllerKind::AdditiveReference => self.additive.parameters(),
            ControllerKind::AdditiveSliding => self.sliding.parameters(),
        }
    }

    /// Every controller under one reference.
    fn run_all(&self, reference: &[Waveform]) -> Vec<(ControllerKind, Trajectory)> {
        let mut scenario = self.proposed.scenario.clone();
        scenario.reference = reference.to_vec();
        let plant = PlantSimulator::new(self.proposed.plant.clone(), scenario);
        ControllerKind::ALL
            .map(|kind| {
                let controller = Controller::new(self.controller(kind))
                    .expect("a finished design has matching sizes");
                (kind, simulate(&plant, &controller, kind.variant()))
            })
            .into()
    }
}

/// A reference by name; `levels` is the example's own.
fn waveforms(name: &str, request: &Request) -> Vec<Waveform> {
    let same = |signal: Waveform| vec![signal; request.control.tracked.len()];
    match name {
        "constant" => same(Waveform::Constant { value: 0.6 }),
        "square" => same(Waveform::Square {
            amplitude: 0.6,
            period: 400.0,
            offset: 0.0,
        }),
        "sine" => same(Waveform::Sine {
            amplitude: 0.6,
            period: 400.0,
            phase: 0.0,
            offset: 0.0,
        }),
        _ => request.scenario.reference.clone(),
    }
}

/// What is remembered of the runs: all numbers, and the curves of one scenario.
struct Record {
    runs: Vec<Run>,
    references: Vec<reachable::Reference>,
    shown: Option<Shown>,
}

/// The scenario whose curves are drawn.
struct Shown {
    design: Design,
    trajectories: Vec<(ControllerKind, Trajectory)>,
}

impl Shown {
    fn of(&self, controller: ControllerKind) -> Option<&Trajectory> {
        let mut all = self.trajectories.iter();
        all.find(|(who, _)| *who == controller).map(|(_, run)| run)
    }
}

/// Runs everything.
pub fn run(progress: Progress) -> Result<Findings, Error> {
    progress("running the paper's example in every variant");
    let mut record = Record {
        runs: Vec::new(),
        references: Vec::new(),
        shown: None,
    };
    for (channel, example) in CHANNELS {
        for noise in NOISES {
            let mut request = experiment::request(example)?;
            request.scenario.noise.fill(noise);
            record.add(channel, noise, &request)?;
        }
    }
    progress("putting the printed theorems to the test");
    let claims = Claims::find(&record)?;
    Ok(Findings {
        name: "paper",
        page: page::page(&record, &claims),
        numbers: json!({
            "claims": claims,
            "references": record.references,
            "runs": record.runs,
        }),
        table: table(&record.runs)?,
        summary: summary(&record.runs),
    })
}

impl Record {
    fn add(&mut self, channel: &'static str, noise: f64, request: &Request) -> Result<(), Error> {
        let case = format!("paper, disturbance on the {channel}, noise {noise}");
        let designs = Designs::new(request, &case)?;
        for reference in REFERENCES {
            let signals = waveforms(reference, request);
            let trajectories = designs.run_all(&signals);
            self.measure((channel, reference, noise), &designs, &trajectories);
            if (channel, reference) == ("state", "levels") && noise > 0.0 {
                self.shown = Some(Shown {
                    design: designs.proposed.clone(),
                    trajectories,
                });
            }
        }
        Ok(())
    }

    fn measure(
        &mut self,
        (channel, reference, noise): (&'static str, &'static str, f64),
        designs: &Designs,
        trajectories: &[(ControllerKind, Trajectory)],
    ) {
        let found: Vec<(ControllerKind, Vec<OutputMerits>)> = trajectories
            .iter()
            .map(|(controller, run)| (*controller, merits(run, &designs.proposed)))
            .collect();
        let told = found
            .iter()
            .find(|(controller, _)| *controller == ControllerKind::ToldTheFault)
            .map_or(f64::NAN, |(_, merits)| true_error(merits));
        let signals = trajectories
            .first()
            .map_or_else(Vec::new, |(_, run)| reachable::signals(run));
        let bound = signals.iter().map(|y| deadbeat_bound(y, 0.0, 1)).sum();
        if channel == CHANNELS[0].0 && noise == NOISES[0] {
            self.references
                .push(reachable::Reference::new(reference, &signals, &found));
        }
        self.runs
            .extend(found.into_iter().map(|(controller, outputs)| Run {
                channel,
                reference,
                noise,
                controller,
                over_told: true_error(&outputs) / told,
                outputs,
                deadbeat_bound: bound,
            }));
    }

    /// The run of a controller in the scenario whose curves are drawn.
    fn run(
        &self,
        channel: &str,
        reference: &str,
        noise: f64,
        controller: ControllerKind,
    ) -> Option<&Run> {
        self.runs.iter().find(|run| {
            (run.channel, run.reference, run.controller) == (channel, reference, controller)
                && run.noise == noise
        })
    }

    /// The largest of a controller's errors over those of the controller told the fault.
    fn worst_over_told(&self, controller: ControllerKind) -> f64 {
        let runs = self.runs.iter().filter(|run| run.controller == controller);
        runs.map(|run| run.over_told).fold(0.0, f64::max)
    }

    /// The smallest of them.
    fn best_over_told(&self, controller: ControllerKind) -> f64 {
        let runs = self.runs.iter().filter(|run| run.controller == controller);
        runs.map(|run| run.over_told).fold(f64::INFINITY, f64::min)
    }
}

/// One row per output and run.
fn table(runs: &[Run]) -> Result<Vec<u8>, Error> {
    let row = |run: &Run| {
        let controller = json!(run.controller);
        vec![
            run.channel.to_string(),
            run.reference.to_string(),
            number(run.noise),
            controller.as_str().unwrap_or_default().to_string(),
        ]
    };
    experiment::table(
        &["disturbance_on", "reference", "noise", "controller"],
        runs.iter().map(|run| (row(run), run.outputs.as_slice())),
    )
}

/// The worst and best ratios, for the terminal.
fn summary(runs: &[Run]) -> String {
    let mut text = format!(
        "{:<34}{:>12}{:>14}\n",
        "true MSE over told the fault", "best", "worst"
    );
    for controller in ControllerKind::ALL {
        let ratios = runs
            .iter()
            .filter(|run| run.controller == controller)
            .map(|run| run.over_told);
        let (best, worst) = ratios.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), ratio| {
            (low.min(ratio), high.max(ratio))
        });
        let _ = writeln!(text, "{:<34}{best:>12.4}{worst:>14.4}", controller.name());
    }
    text
}
