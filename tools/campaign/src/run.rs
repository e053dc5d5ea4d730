//! One run, and what came of it.

use crate::Options;
use crate::draw::{Drawn, draw};
use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::scenario::{FaultEvent, FaultKind, first_tick};
use ftc_simulate::closed_loop::{self, Seen};
use ftc_simulate::{PlantSimulator, Variant};
use serde::{Deserialize, Serialize};

/// Samples after the end of a fault in which its sensor may still be flagged without a false alarm.
const DETECTION_WINDOW: u64 = 50;
/// Errors beyond this one are all alike: the loop has diverged.
const DIVERGED: f64 = 1e12;

/// What came of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Outcome {
    /// Its number.
    pub run: u64,
    /// Root mean square of the true tracking error, in nominal values, over samples and tracked
    /// outputs: with fault tolerance, without, told the fault.
    pub error: [f64; 3],
    /// The faults, in the order in which they were drawn.
    pub faults: Vec<FaultDetection>,
    /// Per sensor (p): how often it was flagged while it was healthy.
    pub false_alarms: Vec<u64>,
    /// Per sensor (p): samples in which it was healthy.
    pub healthy_samples: Vec<u64>,
    /// Where there was one fault: its sensor, and the first sensor flagged while it lasted.
    pub isolation: Option<(usize, Option<usize>)>,
    /// Switches between modes.
    pub switches: u64,
    /// Largest relative error of the model.
    pub model_error: f64,
    /// Noise, relative to the scenario.
    pub noise: f64,
    /// The mode (from 0) in which the true plant is unstable while the model is not, and the spectral
    /// radius of its `A`; of several the largest.
    pub unstable: Option<(usize, f64)>,
}

/// One fault and whether it was seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FaultDetection {
    /// Name of its kind.
    pub kind: String,
    /// Sensor (0-based).
    pub sensor: usize,
    /// First sample.
    pub from: u64,
    /// Sample after the last.
    pub until: u64,
    /// Size in output units; the loss of a gain; zero for kinds without a size.
    pub size: f64,
    /// Samples until its sensor was flagged, if it was.
    pub delay: Option<u64>,
    /// Whether another fault of the same sensor, or a flag raised before it, leaves it open
    /// whether this one was seen.
    pub hidden: bool,
}

impl FaultDetection {
    fn new(event: &FaultEvent, sample_time: f64) -> Self {
        let (kind, size) = match event.kind {
            FaultKind::Bias { size } => ("bias", size),
            FaultKind::Drift { slope } => ("drift", slope * (event.until - event.from)),
            FaultKind::GainLoss { loss } => ("gain-loss", loss),
            FaultKind::Stuck => ("stuck", 0.0),
            FaultKind::Intermittent { size, .. } => ("intermittent", size),
            FaultKind::Dropout => ("dropout", 0.0),
        };
        Self {
            kind: kind.into(),
            sensor: event.sensor,
            from: first_tick(event.from, sample_time),
            until: first_tick(event.until, sample_time),
            size,
            delay: None,
            hidden: false,
        }
    }

    fn is_present(&self, tick: u64) -> bool {
        (self.from..self.until).contains(&tick)
    }
}

/// Does run number `run`.
pub fn run_one(design: &Design, controller: &Controller, options: &Options, run: u64) -> Outcome {
    let drawn = draw(design, options, run);
    let mut detection = Detection::new(design, &drawn);
    let plant = PlantSimulator::with_true_plant(
        design.plant.clone(),
        drawn.true_plant.clone(),
        drawn.scenario.clone(),
    );
    let error = [Variant::Ftc, Variant::NoFtc, Variant::ToldTheFault].map(|variant| {
        let mut squares = 0.0;
        let stalled = closed_loop::visit(&plant, controller, variant, &mut |seen| {
            squares += square_error(design, seen);
            if variant == Variant::Ftc {
                detection.see(seen);
            }
        });
        let count = drawn.scenario.steps * design.controller.feedback.tracked.len() as u64;
        let error = (squares / count.max(1) as f64).sqrt();
        match stalled {
            None if error < DIVERGED => error,
            _ => DIVERGED,
        }
    });
    let mut outcome = detection.outcome(run, error, &drawn);
    outcome.unstable = unstable(design, &drawn);
    outcome
}

/// The most unstable of the modes that the true plant's matrices make unstable.
fn unstable(design: &Design, drawn: &Drawn) -> Option<(usize, f64)> {
    let lost = drawn.true_plant.linear(&design.plant);
    let lost = lost.destabilised(&design.plant);
    let largest = lost.iter().max_by(|a, b| a.radius.total_cmp(&b.radius))?;
    Some((largest.mode, largest.radius))
}

/// The squares of the true tracking errors in nominal values, added up.
fn square_error(design: &Design, seen: &Seen<'_>) -> f64 {
    let tracked = design.controller.feedback.tracked.iter();
    tracked
        .zip(&seen.plant.reference)
        .map(|(&row, reference)| {
            let error = (seen.plant.y_true[row] - reference) / design.signals.outputs[row].nominal;
            error * error
        })
        .sum()
}

/// Which sensor was flagged when.
struct Detection {
    faults: Vec<FaultDetection>,
    flagged: Vec<bool>,
    false_alarms: Vec<u64>,
    healthy_samples: Vec<u64>,
    flagged_first: Option<usize>,
}

impl Detection {
    fn new(design: &Design, drawn: &Drawn) -> Self {
        let sensors = design.signals.outputs.len();
        let te = design.plant.sample_time;
        let events = drawn.scenario.events.iter();
        let mut faults: Vec<FaultDetection> =
            events.map(|event| FaultDetection::new(event, te)).collect();
        for at in 0..faults.len() {
            let (sensor, from) = (faults[at].sensor, faults[at].from);
            faults[at].hidden = faults.iter().enumerate().any(|(other, fault)| {
                other != at
                    && fault.sensor == sensor
                    && (fault.from..fault.until + DETECTION_WINDOW).contains(&from)
            });
        }
        Self {
            faults,
            flagged: vec![false; sensors],
            false_alarms: vec![0; sensors],
            healthy_samples: vec![0; sensors],
            flagged_first: None,
        }
    }

    fn see(&mut self, seen: &Seen<'_>) {
        let tick = seen.plant.tick;
        for (sensor, &flagged) in seen.report.flagged.iter().enumerate() {
            let raised = flagged && !self.flagged[sensor];
            let mut own = self.faults.iter().filter(|fault| fault.sensor == sensor);
            let excused =
                own.any(|fault| (fault.from..fault.until + DETECTION_WINDOW).contains(&tick));
            if !excused {
                self.healthy_samples[sensor] += 1;
                self.false_alarms[sensor] += u64::from(raised);
            }
            let before = self.flagged[sensor];
            for fault in self
                .faults
                .iter_mut()
                .filter(|fault| fault.sensor == sensor)
            {
                fault.hidden |= tick == fault.from && before;
                if flagged && fault.delay.is_none() && fault.is_present(tick) {
                    fault.delay = Some(tick - fault.from);
                }
            }
            if let [fault] = &self.faults[..]
                && raised
                && fault.is_present(tick)
            {
                self.flagged_first.get_or_insert(sensor);
            }
            self.flagged[sensor] = flagged;
        }
    }

    fn outcome(self, run: u64, error: [f64; 3], drawn: &Drawn) -> Outcome {
        let isolation = match &self.faults[..] {
            [fault] if !fault.hidden => Some((fault.sensor, self.flagged_first)),
            _ => None,
        };
        Outcome {
            run,
            error,
            faults: self.faults,
            false_alarms: self.false_alarms,
            healthy_samples: self.healthy_samples,
            isolation,
            switches: drawn.scenario.schedule.len() as u64 - 1,
            model_error: drawn.model_error,
            noise: drawn.noise,
            unstable: None,
        }
    }
}
