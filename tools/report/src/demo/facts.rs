//! What was designed, in words.

use crate::text::{count, number};
use ftc_control::parameters::{Compensation, EstimatorMethod, Harmonics, ObserverKind};
use ftc_design::Design;
use ftc_plant::Mode;

/// `mode 2`, and its name where the user gave one that says more.
pub fn mode_name(modes: &[Mode], index: usize) -> String {
    let number = index + 1;
    match modes.get(index) {
        Some(mode)
            if !mode.name.is_empty()
                && mode.name != number.to_string()
                && mode.name != format!("mode {number}") =>
        {
            format!("mode {number}: {}", mode.name)
        }
        _ => format!("mode {number}"),
    }
}

/// Names and values, in the order of the signal path.
pub fn facts(design: &Design) -> Vec<(String, String)> {
    let controller = &design.controller;
    let dims = controller.plant.dimensions();
    let te = controller.plant.sample_time;
    let estimator = &controller.estimator;
    let feedback = &controller.feedback;
    let mut facts = vec![
        (
            "Plant",
            format!(
                "{} of {}, {}, {}, {}",
                count(controller.plant.modes.len(), "mode"),
                count(dims.states, "state"),
                count(dims.inputs, "input"),
                count(dims.outputs, "output"),
                count(dims.disturbances, "disturbance")
            ),
        ),
        ("Sample time", format!("{} s", number(te))),
        ("Tracked", crate::text::list(&tracked_names(design))),
        ("Latency", count(feedback.latency, "sample")),
        ("Stability", stability(design)),
        ("Observer", observer(design)),
        ("Fault estimator", method(estimator.method).into()),
    ];
    if estimator.method != EstimatorMethod::None {
        let length = estimator.response_length;
        facts.push((
            "Response length",
            format!(
                "{} ({} s)",
                count(length, "sample"),
                number(length as f64 * te)
            ),
        ));
        facts.push(("Debounce", count(estimator.debounce as usize, "sample")));
        if estimator.stuck_after > 0 {
            let repetitions = count(estimator.stuck_after as usize, "repetition");
            facts.push(("Frozen sensor", format!("after {repetitions} of a reading")));
        }
    }
    if let Some(harmonics) = &estimator.harmonics {
        facts.push(("Periodic disturbance", periodic(harmonics, te)));
    }
    facts.push(("Compensation", compensation(controller.compensation).into()));
    facts
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

fn tracked_names(design: &Design) -> Vec<String> {
    design
        .controller
        .feedback
        .tracked
        .iter()
        .map(|&row| super::name_of(&design.signals.outputs, row, "y"))
        .collect()
}

/// What the certificate says about switching.
fn stability(design: &Design) -> String {
    match &design.synthesis {
        None => "not certified: the gains were not made by synthesis".into(),
        Some(synthesis) => match &synthesis.state_feedback.dwell {
            None => "certified under arbitrary switching".into(),
            Some(dwell) => format!(
                "certified while modes last on average longer than {} samples ({} s)",
                number(dwell.samples),
                number(dwell.seconds)
            ),
        },
    }
}

fn observer(design: &Design) -> String {
    let observer = &design.controller.observer;
    let kind = match observer.kind {
        ObserverKind::Uio => {
            "unknown input observer: the disturbance is decoupled from the state estimate"
        }
        ObserverKind::Luenberger => "Luenberger observer",
        ObserverKind::Kalman => "Kalman filter",
    };
    match &observer.note {
        Some(note) => format!("{kind} ({note})"),
        None => kind.into(),
    }
}

fn method(method: EstimatorMethod) -> &'static str {
    match method {
        EstimatorMethod::Reference => "projection on a healthy database (reference window)",
        EstimatorMethod::Sliding => "projection on a sliding window, as printed in the paper",
        EstimatorMethod::None => "none",
    }
}

fn periodic(harmonics: &Harmonics, te: f64) -> String {
    format!(
        "period {} s, {} learned on line",
        number(harmonics.period * te),
        count(harmonics.count, "harmonic")
    )
}

fn compensation(compensation: Compensation) -> &'static str {
    match compensation {
        Compensation::VirtualSensor => {
            "virtual sensor: observer and integrator see the corrected measurement"
        }
        Compensation::Additive => "additive control, as printed in the paper",
        Compensation::None => "none: the estimate is only reported",
    }
}
