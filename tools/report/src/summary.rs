//! The design report, for a person and for a program.

use crate::running_loop;
use crate::text::{count, number, with_units};
use crate::warnings;
use design_file::wording;
use ftc_control::parameters::{Compensation, EstimatorMethod, Hypotheses, ObserverKind};
use ftc_design::apart;
use ftc_design::augmented::assumes_input_disturbance;
use ftc_design::running_loop::TransferCertificate;
use ftc_design::{
    ControlProof, ControlSpec, Design, DesignError, Failure, ObserverProof, StateFeedback,
    mode_models,
};
use serde_json::{Value, json};
use std::fmt::Write;

/// The report a person reads.
pub fn text(design: &Design, warnings: &[String]) -> String {
    let mut text = String::new();
    for (title, lines) in sections(design) {
        let _ = writeln!(text, "{title}");
        for (name, value) in lines {
            let _ = writeln!(text, "  {name:<21} {value}");
        }
        text.push('\n');
    }
    text + &warnings::text(warnings)
}

/// A titled list of named values.
pub type Section = (&'static str, Vec<(String, String)>);

/// The report's contents, also for the FMU's documentation.
pub fn sections(design: &Design) -> Vec<Section> {
    let mut sections = vec![("Design", overview(design))];
    if let Some(synthesis) = design.synthesis() {
        sections.push((
            "State feedback",
            feedback(design, &synthesis.state_feedback),
        ));
    }
    sections.push(("Observer", observer(design)));
    if let Some(proof) = &design.proof {
        sections.push(("Running loop", running_loop::gains(design, proof)));
        sections.push(("Lost sensors", running_loop::lost(design, proof)));
    }
    sections.push(("Fault estimator", estimator(design)));
    let compensation = compensation(design.controller.compensation);
    sections.push(("Compensation", vec![line("method", compensation)]));
    if let Some(proof) = &design.proof {
        sections.push(("Certificate", certificate(&proof.state_feedback)));
    }
    sections
}

fn line(name: impl Into<String>, value: impl Into<String>) -> (String, String) {
    (name.into(), value.into())
}

fn overview(design: &Design) -> Vec<(String, String)> {
    let plant = &design.plant;
    let dims = plant.dimensions();
    let names: Vec<&str> = plant.modes.iter().map(|mode| mode.name.as_str()).collect();
    let lost_sensors = design
        .proof
        .as_ref()
        .map(|proof| line("lost sensors", running_loop::lost_sensors(design, proof)));
    let mut lines: Vec<_> = lost_sensors.into_iter().collect();
    lines.extend([
        line("name", &design.name),
        line("sample time", format!("{} s", plant.sample_time)),
        line(
            "plant",
            format!(
                "{}, {}, {}, {}",
                count(dims.states, "state"),
                count(dims.inputs, "input"),
                count(dims.outputs, "output"),
                count(dims.disturbances, "disturbance")
            ),
        ),
        line("modes", names.join(", ")),
    ]);
    lines
}

fn feedback(design: &Design, control: &StateFeedback) -> Vec<(String, String)> {
    let spec = &control.spec;
    let tracked: Vec<&str> = spec
        .tracked
        .iter()
        .map(|&output| design.signals.outputs[output].name.as_str())
        .collect();
    let mut lines = vec![
        line("tracked outputs", tracked.join(", ")),
        line("latency", count(spec.latency, "sample")),
        line(
            "disturbance",
            match assumes_input_disturbance(&design.plant) {
                true => "none is given (E, F): one at the inputs (E = B) is assumed",
                false => "as given (E, F)",
            },
        ),
        line("decay asked", format!("{} per sample", spec.decay)),
    ];
    lines.extend(internal_model(design, control));
    for (index, radius) in control.spectral_radius.iter().enumerate() {
        let gamma = attenuation(control, index);
        lines.push(line(
            format!("mode {}", index + 1),
            format!("{gamma}, spectral radius {radius:.4}"),
        ));
    }
    lines
}

/// What is proved of the disturbance's way to the performance signal in one mode, and whether that is
/// the best there is.
fn attenuation(control: &StateFeedback, mode: usize) -> String {
    let Some(gamma) = control.gamma.as_ref().map(|gamma| gamma[mode]) else {
        return "no disturbance".into();
    };
    let gamma = match gamma < 1e-3 {
        true => format!("gamma {gamma:.1e}"),
        false => format!("gamma {gamma:.4}"),
    } + " with the state known";
    match control.is_optimal(mode) {
        Some(false) => gamma + " (not proved optimal)",
        _ => gamma,
    }
}

/// The periods at which the tracking error vanishes beside its constant part.
fn internal_model(design: &Design, control: &StateFeedback) -> Option<(String, String)> {
    let sample_time = design.plant.sample_time;
    let angles = control.spec.resonators.iter();
    let periods: Vec<String> = angles
        .map(|angle| format!("{:.6} s", core::f64::consts::TAU / angle * sample_time))
        .collect();
    let named = || format!("resonators at periods {}", periods.join(", "));
    (!periods.is_empty()).then(|| line("internal model", named()))
}

fn observer(design: &Design) -> Vec<(String, String)> {
    let observer = &design.controller.observer;
    let kind = match observer.kind {
        ObserverKind::Uio => "unknown input observer (the state disturbance is decoupled)",
        ObserverKind::Luenberger => "Luenberger observer",
        ObserverKind::Kalman => "Kalman filter in correction form",
    };
    let mut lines = vec![line("kind", kind)];
    lines.extend(observer.note.iter().map(|note| line("because", note)));
    if let Some(proof) = &design.proof {
        lines.extend(observer_decay(&proof.observer));
    }
    lines
}

/// What the estimator trusts where a slow divergence could be a drift or a load.
fn ambiguous(settings: &Hypotheses) -> &'static str {
    if settings.trusts_model() {
        "the model is trusted, a drift is taken out"
    } else {
        "the sensors are trusted, suspect is raised"
    }
}

/// How the mode is found, where it is not told.
fn found_mode(design: &Design, settings: &Hypotheses) -> Vec<(String, String)> {
    let Some(rate) = settings.mode_rate else {
        return Vec::new();
    };
    let mut lines = vec![line(
        "mode",
        format!(
            "found from the readings, a switch every {} samples is expected",
            number(1.0 / rate)
        ),
    )];
    let pairs = apart::pairs(design);
    let closest = pairs
        .iter()
        .min_by(|a, b| a.deviations.total_cmp(&b.deviations));
    lines.extend(closest.map(|pair| {
        let [one, other] = pair.modes.map(|mode| &design.plant.modes[mode].name);
        line(
            "modes told apart",
            format!(
                "readings of {one} and {other} differ most by {} deviations of their noise at nominal movements",
                number(pair.deviations)
            ),
        )
    }));
    lines
}

/// What the log says of each mode: which matrices are not the design's, and how well it fits.
fn fitted(design: &Design, settings: &Hypotheses) -> Vec<(String, String)> {
    let percents = |values: &[f64]| {
        let values = values.iter().map(|value| format!("{value:.1} %"));
        values.collect::<Vec<_>>().join(", ")
    };
    let models = mode_models(&design.plant);
    let modes = design.plant.modes.iter().zip(models).zip(&settings.fitted);
    modes
        .map(|((mode, model), fitted)| {
            let (fit, of_model) = (percents(&fitted.fit), percents(&fitted.fit_of_model));
            let changed: Vec<&str> = [
                ("A", model.a != fitted.a),
                ("B", model.b != fitted.b),
                ("C", model.c != fitted.c),
                ("E", model.e != fitted.e),
                ("F", model.f != fitted.f),
            ]
            .into_iter()
            .filter_map(|(name, changed)| changed.then_some(name))
            .collect();
            let what = match changed.is_empty() {
                true => "the design model is kept".to_string(),
                false => format!("{} fitted; the design model {of_model}", changed.join(", ")),
            };
            line(
                format!("fit in mode {}", mode.name),
                format!("{fit} of the outputs on data held back, {what}"),
            )
        })
        .collect()
}

fn estimator(design: &Design) -> Vec<(String, String)> {
    let estimator = &design.controller.estimator;
    let method = match estimator.method {
        EstimatorMethod::Observer => "observer (hypotheses about sensors and plant in competition)",
        EstimatorMethod::Reference => "reference (predictor from a healthy database)",
        EstimatorMethod::Sliding => "sliding window as printed",
        EstimatorMethod::None => "none",
    };
    let mut lines = vec![line("method", method)];
    if estimator.method == EstimatorMethod::None {
        return lines;
    }
    let outputs = &design.signals.outputs;
    if let Some(settings) = &estimator.hypotheses {
        lines.extend(hypotheses(design, settings));
    } else {
        lines.push(line(
            "response length",
            format!(
                "{} ({} s)",
                count(estimator.response_length, "sample"),
                number(estimator.response_length as f64 * design.plant.sample_time)
            ),
        ));
    }
    for (index, predictor) in estimator.predictors.iter().enumerate() {
        lines.push(line(
            format!("mode {}", index + 1),
            format!(
                "{} samples, residual deviation {}",
                predictor.samples,
                with_units(&predictor.deviation, outputs, 3)
            ),
        ));
    }
    lines.push(line(
        "thresholds",
        with_units(&estimator.thresholds, outputs, 3),
    ));
    if estimator.hypotheses.is_none() {
        lines.push(line(
            "debounce",
            count(estimator.debounce as usize, "sample"),
        ));
    }
    if estimator.stuck_after > 0 {
        lines.push(line(
            "stuck after",
            format!("{} repetitions of a reading", estimator.stuck_after),
        ));
    }
    if let Some(harmonics) = &estimator.harmonics {
        lines.push(line(
            "disturbance",
            format!(
                "period {:.6} samples, {}",
                harmonics.period,
                count(harmonics.count, "harmonic")
            ),
        ));
    }
    lines
}

/// Of the state-based method.
fn hypotheses(design: &Design, settings: &Hypotheses) -> Vec<(String, String)> {
    let outputs = &design.signals.outputs;
    let source = match settings.fitted.is_empty() {
        true => "assumed",
        false => "left after the fit to the log",
    };
    let error = number(100.0 * settings.model_error);
    let mut lines = vec![line(
        "model error",
        format!(
            "{error} % of each entry, {source}; learned from the readings where the plant moves"
        ),
    )];
    lines.extend(fitted(design, settings));
    if !settings.fitted.is_empty() {
        lines.push(line(
            "noise in the log",
            with_units(&settings.noise, outputs, 3),
        ));
    }
    lines.push(line(
        "fault rate",
        format!("{:e} a sample and sensor", settings.fault_rate),
    ));
    lines.push(line("slow divergence", ambiguous(settings)));
    lines.extend(found_mode(design, settings));
    lines.push(line(
        "largest correction",
        with_units(&settings.authority, outputs, 3),
    ));
    lines
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

fn observer_decay(observer: &ObserverProof) -> Vec<(String, String)> {
    let radius = |(index, radius): (usize, &f64)| {
        line(
            format!("mode {}", index + 1),
            format!("spectral radius of the error {radius:.4}"),
        )
    };
    let mut lines = vec![line(
        "decay asked",
        format!("{} per sample", observer.spec.decay),
    )];
    lines.extend(observer.spectral_radius.iter().enumerate().map(radius));
    lines
}

fn certificate(control: &ControlProof) -> Vec<(String, String)> {
    let guarantee = match &control.dwell {
        None => "stable under arbitrary switching".to_string(),
        Some(dwell) => format!(
            "stable when modes last on average longer than {:.2} samples ({:.4} s)",
            dwell.samples, dwell.seconds
        ),
    };
    vec![
        line("Lyapunov", control.lyapunov.to_string()),
        line("guarantee", guarantee),
        line(
            "proof",
            "every inequality of the shipped gains is proved positive definite, rounding included",
        ),
    ]
}

/// The report a program reads.
pub fn json(design: &Design, warnings: &[String]) -> String {
    let estimator = &design.controller.estimator;
    let synthesis = design.synthesis();
    let control = synthesis.as_ref().map(|found| &found.state_feedback);
    let running = synthesis.as_ref().map(|found| &found.running_loop);
    let deviations: Vec<&Vec<f64>> = estimator.predictors.iter().map(|p| &p.deviation).collect();
    let samples: Vec<usize> = estimator.predictors.iter().map(|p| p.samples).collect();
    let value = json!({
        "name": design.name,
        "feasible": true,
        "certified": control.is_some(),
        "gamma": control.and_then(|c| c.gamma.clone()),
        "gamma_loop": running.and_then(|r| r.gamma_loop.clone()),
        "gamma_loop_switching": running.and_then(|r| r.switching.as_ref().map(|s| s.gamma)),
        "bumpless_samples": running.and_then(|r| r.transfer.as_ref().map(TransferCertificate::samples)),
        "bumpless_needs_dwell": running.and_then(|r| r.transfer.as_ref().map(TransferCertificate::needs_dwell)),
        "noise_gain": running.map(|r| r.noise_gain.clone()),
        "fault_gain": running.map(|r| r.fault_gain.clone()),
        "command_noise": synthesis.as_ref().filter(|s| !s.observer.spec.noise.is_empty()).map(|s| s.running_loop.command_noise.clone()),
        "disturbance": if assumes_input_disturbance(&design.plant) { "assumed at the inputs (B)" } else { "given (E, F)" },
        "lost_sensors": running.map(|r| running_loop::json(design, &r.lost)),
        "lost_sensors_minimum_dwell": design.controller.observer.minimum_dwell,
        "gamma_is_optimal": control.and_then(|c| (0..c.modes.len()).map(|mode| c.is_optimal(mode)).collect::<Option<Vec<_>>>()),
        "decay": control.map(|c| c.spec.decay),
        "spectral_radius": control.map(|c| c.spectral_radius.clone()),
        "dwell_time_samples": control.and_then(|c| c.dwell.map(|dwell| dwell.samples)),
        "dwell_time_seconds": control.and_then(|c| c.dwell.map(|dwell| dwell.seconds)),
        "lyapunov": control.map(|c| c.spec.lyapunov),
        "latency": control.map(|c| c.spec.latency),
        "resonators": control.map(|c| c.spec.resonators.clone()),
        "observer": {
            "kind": design.controller.observer.kind,
            "note": design.controller.observer.note,
            "decay": synthesis.as_ref().map(|s| s.observer.spec.decay),
            "spectral_radius": synthesis.as_ref().map(|s| s.observer.spectral_radius.clone()),
        },
        "estimator": {
            "method": estimator.method,
            "response_length": estimator.response_length,
            "samples": samples,
            "residual_deviation": deviations,
            "thresholds": estimator.thresholds,
            "debounce": estimator.debounce,
            "stuck_after": estimator.stuck_after,
        },
        "warnings": warnings,
    });
    pretty(&value)
}

/// The same object when there is no design.
pub fn json_of_failure(asked: &ControlSpec, failure: &Failure) -> String {
    let (control, observer) = (&failure.state_feedback, &failure.observer);
    let (control, observer) = (control.as_deref(), observer.as_deref());
    let (feasible, blocks, advice) = match &failure.error {
        DesignError::Infeasible(infeasibility) => (
            Value::Bool(false),
            infeasibility
                .blocks
                .iter()
                .map(|block| json!({ "block": block.name.to_string(), "weight": block.weight }))
                .collect(),
            infeasibility.advice.as_slice(),
        ),
        DesignError::Uncertified(uncertified) => {
            (Value::Bool(true), Vec::new(), uncertified.advice.as_slice())
        }
        _ => (Value::Null, Vec::new(), [].as_slice()),
    };
    let advice: Vec<String> = advice.iter().map(wording::of_advice).collect();
    pretty(&json!({
        "feasible": feasible,
        "certified": false,
        "gamma": control.and_then(|c| c.gamma.clone()),
        "decay": asked.decay,
        "spectral_radius": control.map(|c| c.spectral_radius.clone()),
        "dwell_time_samples": control.and_then(|c| c.dwell.map(|dwell| dwell.samples)),
        "observer": observer.map(|observer| json!({
            "kind": observer.observer.kind,
            "decay": observer.spec.decay,
            "spectral_radius": observer.spectral_radius,
        })),
        "lyapunov": asked.lyapunov,
        "latency": asked.latency,
        "blocks": blocks,
        "advice": advice,
        "reason": wording::of_error(&failure.error),
    }))
}

/// JSON as this program prints it.
pub fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}
