//! The warnings of a design and of its runs, one sentence each.

use crate::text::{count, number};
use design_file::schema::{DesignFile, ObserverKind};
use design_file::sentence::shorten;
use design_file::wording::weight_key;
use ftc_design::warnings::{Doubt, Guess, LoggedMovement, Warning};
use ftc_design::weights::{self, Reason, SmallerCommand};
use ftc_design::{Design, Weight};
use ftc_plant::deviation::Destabilised;
use ftc_simulate::warnings::{RunWarning, RunWatch};
use std::fmt::Write;

/// Of a design and the file it was made from.
pub fn of_design(
    file: &DesignFile,
    logged: Option<&LoggedMovement>,
    design: &Design,
) -> Vec<String> {
    let unknown = design_file::noise_is_unknown(file).then(|| UNKNOWN_NOISE.to_string());
    let warnings = ftc_design::warnings::of_design(design, logged);
    let sentences = warnings
        .iter()
        .map(|warning| of_warning(file, design, warning));
    let idle = idle_weights(file, design);
    unknown.into_iter().chain(idle).chain(sentences).collect()
}

/// Weights that were given.
fn given_weights(file: &DesignFile) -> Vec<Weight> {
    let asked = &file.controller;
    let given = [
        (Weight::Output, asked.output_weight.is_some()),
        (Weight::Integral, asked.integral_weight.is_some()),
        (Weight::Input, asked.input_weight.is_some()),
    ];
    let given = given.iter().filter(|(_, given)| *given);
    given.map(|(weight, _)| *weight).collect()
}

/// Weights that were given and shape nothing, or hardly anything.
fn idle_weights(file: &DesignFile, design: &Design) -> Option<String> {
    let found = weights::without_effect(design, &given_weights(file))?;
    let (none, hardly) = ("no effect", "hardly any effect on the state feedback");
    let (effect, reason) = match found.reason {
        Reason::DecayOnly => (
            none,
            "objective = \"decay\" looks at nothing but the decay: ask for \"attenuation\"".into(),
        ),
        Reason::NoDisturbance => (
            none,
            "no disturbance reaches the state: give E, F or a B that is not zero".into(),
        ),
        Reason::Rejected => (
            none,
            "the disturbance can be rejected completely, whatever they are".into(),
        ),
        Reason::Alone { weight, times } => (
            hardly,
            format!(
                "{} alone decides gamma, and only the weights' ratios shape the gains: make it {} times smaller, or \
                 the others larger",
                weight_key(weight),
                number(times)
            ),
        ),
        Reason::Small { share, times } => (
            hardly,
            format!(
                "at most {:.1} % of the performance signal comes from there: a weight {} times larger would act",
                100.0 * share,
                number(times)
            ),
        ),
        other => (hardly, format!("{other:?}")),
    };
    let names = found.weights.iter().map(|weight| weight_key(*weight));
    let names: Vec<&str> = names.collect();
    let have = if names.len() == 1 { "has" } else { "have" };
    Some(format!("{} {have} {effect}: {reason}", names.join(", ")))
}

const UNKNOWN_NOISE: &str = "neither scenario.noise nor estimator.threshold is given: a residual of a thousandth of an \
    output's nominal value is then a fault; give the noise of your sensors";

/// Of the runs of a design, each with the first tick that it could not be integrated through.
pub fn of_runs(design: &Design, runs: &[(RunWatch<'_>, Option<u64>)]) -> Vec<String> {
    let proof = design.proof.as_ref();
    let noise = proof.map_or(&[][..], |proof| &proof.running_loop.command_noise);
    let warnings = ftc_simulate::warnings::of_runs(design, noise, runs);
    let smaller_command = smaller_command(design);
    warnings
        .iter()
        .map(|warning| of_run(design, smaller_command, warning))
        .collect()
}

/// The warnings as a person reads them below a report.
pub fn text(warnings: &[String]) -> String {
    warnings.iter().fold(String::new(), |mut text, warning| {
        let _ = writeln!(text, "warning: {warning}");
        text
    })
}

fn of_warning(file: &DesignFile, design: &Design, warning: &Warning) -> String {
    match *warning {
        Warning::ModesTooShortToJudge {
            short,
            switches,
            response_length,
        } => format!(
            "scenario.schedule: before {short} of {switches} switches a mode lasts no longer than response_length = \
             {response_length} samples, and no sensor is judged in that time: let modes last longer, or set a shorter \
             estimator.response_length"
        ),
        Warning::ModesTooShortToBeProved { mean, needed } => format!(
            "scenario.schedule: modes last {mean:.2} samples on average, but stability is proved only where they \
             last longer than {needed:.2}: let them last longer"
        ),
        Warning::ModesTooShortForTransfer { shortest, needed } => format!(
            "scenario.schedule: a mode lasts {} only, but with controller.bumpless stability is proved only where each \
             lasts at least {needed}: let modes last longer, or leave bumpless out",
            count(shortest as usize, "sample")
        ),
        Warning::ModesAlike(pair) => {
            let [one, other] = pair.modes.map(|mode| &design.plant.modes[mode].name);
            format!(
                "estimator.mode = \"estimated\": modes \"{one}\" and \"{other}\" are not told apart: while states and \
                 inputs move by their nominal values, their readings differ by at most {} standard deviations of the \
                 noise: measure more, or tell the mode",
                number(pair.deviations)
            )
        }
        Warning::CostlyObserver {
            mode,
            running,
            times,
        } => {
            let remedy = match file.observer.kind {
                Some(ObserverKind::Auto) | None => {
                    "ask for a slower observer.decay, or measure more"
                }
                _ => "observer.kind = auto looks for one that serves the loop better",
            };
            format!(
                "mode {}: with this observer gamma_loop is {running:.4}, {times:.1} times gamma with the state known: \
                 {remedy}",
                mode + 1
            )
        }
        Warning::OutsideTheDatabase {
            mode,
            input,
            value,
            widening,
        } => format!(
            "mode {}: the reference needs {} = {} in steady state, far outside what the healthy database spans, and \
             thresholds are {} times wider there: raise its nominal (signals.inputs), or log a run there",
            mode + 1,
            design.signals.inputs[input].name,
            number(value),
            number(widening.round())
        ),
        Warning::DoubtfulLog {
            mode,
            output,
            ref doubt,
        } => {
            let database = file.estimator.database.as_ref();
            format!(
                "{}: mode {} ({}), {}: {}",
                shorten(database.map_or("", |files| files.of_mode(mode))),
                mode + 1,
                design.plant.modes[mode].name,
                design.signals.outputs[output].name,
                of_doubt(doubt)
            )
        }
        ref other => format!("{other:?}"),
    }
}

fn of_doubt(doubt: &Doubt) -> String {
    match doubt {
        Doubt::Response { distance, guess } => {
            let guess = match guess {
                Guess::ReversedSign => "the sensor's sign seems to be reversed",
                Guess::OtherUnit => "the unit seems to be another",
                _ => "is it of this mode, with this sign and unit?",
            };
            format!(
                "the response in the log differs from the model's by {distance:.2} times its size ({guess}): \
                 check the log, or correct the model"
            )
        }
        Doubt::Unexplained { deviation, share } => format!(
            "the inputs do not explain {:.0} % of what the output moves in the log (deviation {deviation:.3e}): \
             look for a fault or a disturbance in it, or for a response_length that is too short",
            100.0 * share
        ),
        other => format!("{other:?}"),
    }
}

/// What makes the command smaller.
fn smaller_command(design: &Design) -> &'static str {
    match SmallerCommand::of(design) {
        SmallerCommand::SlowerDecay => "ask for a slower decay",
        SmallerCommand::DecayObjective => {
            "try controller.objective = decay (input_weight alone decides gamma: a larger one hardly changes the state feedback)"
        }
        _ => "raise controller.input_weight, ask for a slower decay",
    }
}

/// What lets a fault be noticed that was missed.
fn missed(design: &Design) -> &'static str {
    match &design.controller.estimator.hypotheses {
        Some(settings) if settings.trusts_model() => {
            "the model explains it within estimator.model_error: give a smaller one if the plant is known better"
        }
        Some(_) => {
            "what grows slowly could be the plant's doing, and the sensor is trusted: where it is the sensor's, set \
             estimator.ambiguous = \"trust-model\", and a smaller estimator.model_error if the plant is known better"
        }
        None => "lower estimator.sigmas or threshold, or give modes more time",
    }
}

fn of_run(design: &Design, smaller_command: &str, warning: &RunWarning) -> String {
    let inputs = &design.signals.inputs;
    let percent = |share: f64| format!("{:.1} % of the samples", 100.0 * share);
    match *warning {
        RunWarning::Unjudged {
            share,
            response_length,
        } => format!(
            "ftc: in {} no sensor was judged, since a mode had just been entered: for response_length = \
             {response_length} samples then no fault is found or cleared",
            percent(share)
        ),
        RunWarning::OutsideTheDatabase { share, widening } => format!(
            "ftc: in {} the inputs lay outside what the healthy database spans, and thresholds were up to {} times \
             wider: raise the inputs' nominal values, or log a run there",
            percent(share),
            number(widening.round())
        ),
        RunWarning::Saturated { input, share } => format!(
            "ftc: {} is at a limit in {}, and what is proved holds only while no input is: {smaller_command}, \
             or widen its min and max",
            inputs[input].name,
            percent(share)
        ),
        RunWarning::Capped {
            sensor,
            share,
            size,
        } => format!(
            "ftc: in {} the estimated fault of {} stood at its largest size, {}: a larger fault is taken out only in \
             part; {}",
            percent(share),
            design.signals.outputs[sensor].name,
            number(size),
            match design.controller.estimator.hypotheses {
                Some(_) => "raise estimator.authority",
                None => "widen the output's min and max",
            }
        ),
        RunWarning::Unnoticed {
            sensor,
            share,
            largest,
        } => format!(
            "ftc: a fault of {} of up to {} was missed in {:.1} % of the samples that had one above three \
             thresholds: {}",
            design.signals.outputs[sensor].name,
            number(largest),
            100.0 * share,
            missed(design)
        ),
        RunWarning::NoisyCommand { input, deviation } => format!(
            "ftc: the noise of the sensors moves {} by {} (standard deviation), more than a tenth of its range: \
             {smaller_command}, or a slower observer.decay",
            inputs[input].name,
            number(deviation)
        ),
        RunWarning::UnstablePlant(Destabilised {
            mode,
            radius,
            model,
            ..
        }) => format!(
            "the true plant is unstable in mode {} ({}): the spectral radius of its A is {radius:.4}, that of the \
             model's {model:.4}; errors of the entries of a sampled A can do that: lower them, or give the true \
             plant's matrices themselves",
            mode + 1,
            design.plant.modes[mode].name
        ),
        RunWarning::Stopped { variant, time } => format!(
            "{}: the plant's equations cannot be integrated beyond {time} s: the figures end there",
            variant.key()
        ),
        RunWarning::DiodesConduct {
            variant,
            voltage,
            time,
            share,
        } => format!(
            "{}: the DC link fell to where its diodes conduct, below {voltage:.1} V, at {time} s, and was there in {}",
            variant.key(),
            percent(share)
        ),
        other => format!("{other:?}"),
    }
}
