//! What is proved of the loop that runs, in words and as JSON.

use crate::text::{count, with_units};
use ftc_design::running_loop::{TRANSFER_DECAY, TransferCertificate};
use ftc_design::{Design, LostSensors, Lyapunov, Proof, Signal};
use serde_json::{Value, json};

type Lines = Vec<(String, String)>;

/// Gains of the whole loop, and under which switching it is stable.
pub fn gains(design: &Design, proof: &Proof) -> Lines {
    let running = &proof.running_loop;
    let inputs = &design.signals.inputs;
    let mut lines = vec![("stability".to_owned(), stability(proof))];
    if let Some(proved) = &running.transfer {
        lines.push(("bumpless transfer".to_owned(), bumpless(proved)));
    }
    for mode in 0..running.noise_gain.len() {
        let gamma = match &running.gamma_loop {
            Some(gamma) => format!("gamma_loop {}", short(gamma[mode])),
            None => "no disturbance".into(),
        };
        lines.push((
            format!("mode {}", mode + 1),
            format!(
                "{gamma}, noise gain {}, gain of an unnoticed fault {}, {}",
                short(running.noise_gain[mode]),
                short(running.fault_gain[mode]),
                match proof.observer.spec.noise.is_empty() {
                    true => "noise on the command not known without scenario.noise".into(),
                    false => format!(
                        "noise on the command {}",
                        with_units(&running.command_noise[mode], inputs, 2)
                    ),
                }
            ),
        ));
    }
    if design.controller.estimator.finds_the_mode() {
        lines.push((
            "mode".to_owned(),
            "all this is proved while the mode found is the plant's; nothing is proved of the samples in which it is \
             another"
                .into(),
        ));
    }
    lines.push((
        "holds".to_owned(),
        match &running.switching {
            Some(switching) => format!(
                "each gain while its mode lasts; gamma_loop {} under arbitrary switching",
                short(switching.gamma)
            ),
            None if running.noise_gain.len() == 1 => "always: there is one mode".into(),
            None => "each gain while its mode lasts; no gain is claimed across a switch".into(),
        },
    ));
    lines
}

/// What bumpless transfer does, and how often.
pub fn bumpless(proved: &TransferCertificate) -> String {
    let samples = proved.samples();
    match proved.needs_dwell() {
        true => "the command is continuous at every switch, where each mode lasts as long as above"
            .into(),
        false => format!(
            "the command is continuous at a switch {} or more after the last such one; at others it may jump",
            count(samples, "sample")
        ),
    }
}

/// Under which switching the running loop is proved stable.
pub fn stability(proof: &Proof) -> String {
    if proof.running_loop.transfer.is_some() {
        return with_transfer(proof);
    }
    let decay = proof.state_feedback.decay.max(proof.observer.spec.decay);
    match proof.dwell() {
        None => {
            format!("proved under arbitrary switching, any decay slower than {decay} per sample")
        }
        Some(samples) => format!(
            "proved when modes last on average longer than {samples:.2} samples, any decay slower than {decay} per sample within a mode"
        ),
    }
}

/// The same with bumpless transfer, whose proof has a rate within a mode only.
fn with_transfer(proof: &Proof) -> String {
    let decay = proof.state_feedback.decay.max(proof.observer.spec.decay);
    let within = format!(
        "any decay slower than {} per sample within a mode",
        decay.max(TRANSFER_DECAY)
    );
    match proof.shortest_mode() {
        Some(samples) => format!(
            "proved when each mode lasts at least {}, {within}",
            count(samples, "sample")
        ),
        None => format!("proved under arbitrary switching with bumpless transfer, {within}"),
    }
}

/// The sentence an engineer wants first: "Survives the loss of level 1; survives both by the model
/// alone; does not survive angle".
pub fn lost_sensors(design: &Design, proof: &Proof) -> String {
    let table = &proof.running_loop.lost;
    let outputs = &design.signals.outputs;
    let all = |entry: &&LostSensors| entry.sensors.len() == outputs.len();
    let singles = table.iter().filter(|entry| entry.sensors.len() == 1);
    let named = |wanted: bool, shown: Option<bool>| -> Vec<&str> {
        let singles = singles
            .clone()
            .filter(|entry| outputs.len() > 1 || !all(entry));
        let kept = singles.filter(|entry| {
            entry.stable == wanted
                && shown.is_none_or(|shown| entry.observable.iter().all(|o| *o) == shown)
        });
        kept.map(|entry| outputs[entry.sensors[0]].name.as_str())
            .collect()
    };
    let mut parts = Vec::new();
    let clause = |names: Vec<&str>, before: &str, after: &str| {
        (!names.is_empty()).then(|| format!("{before}{}{after}", names.join(", ")))
    };
    parts.extend(clause(named(true, Some(true)), "survives the loss of ", ""));
    parts.extend(clause(
        named(true, Some(false)),
        "survives the loss of ",
        " with the model for what the others do not show",
    ));
    let several: Vec<String> = table
        .iter()
        .filter(|entry| entry.sensors.len() == 2 && entry.sensors.len() < outputs.len())
        .filter(|entry| !entry.stable)
        .map(|entry| names(entry, outputs))
        .collect();
    let everything = table.iter().find(all).map(|entry| {
        let which = match outputs.len() {
            1 => outputs[0].name.as_str(),
            2 => "both",
            _ => "the loss of all",
        };
        match entry.stable {
            true => format!("survives {which} by the model alone"),
            false => format!("does not survive {which}"),
        }
    });
    parts.extend(everything);
    parts.extend(clause(named(false, None), "does not survive ", ""));
    if !several.is_empty() && named(false, None).is_empty() {
        parts.push(format!(
            "does not survive {} together",
            several.join(", nor ")
        ));
    }
    let mut text = parts.join("; ");
    if let Some(first) = text.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    text
}

fn names(entry: &LostSensors, outputs: &[Signal]) -> String {
    let names: Vec<&str> = entry
        .sensors
        .iter()
        .map(|&sensor| outputs[sensor].name.as_str())
        .collect();
    names.join(" + ")
}

/// The table of lost sensors, and how often the set may change.
pub fn lost(design: &Design, proof: &Proof) -> Lines {
    let outputs = &design.signals.outputs;
    let row = |entry: &LostSensors| {
        let seen = match entry.observable.iter().filter(|o| **o).count() {
            0 => "not observable from the rest",
            count if count == entry.observable.len() => "observable from the rest",
            _ => "observable from the rest in some modes",
        };
        let stable = match (entry.stable, &entry.gamma_loop) {
            (false, _) => "not served".to_owned(),
            (true, Some(gamma)) => {
                let gamma: Vec<String> = gamma.iter().map(|g| short(*g)).collect();
                format!("proved stable, gamma_loop {}", gamma.join(", "))
            }
            (true, None) => "proved stable".to_owned(),
        };
        (names(entry, outputs), format!("{seen}; {stable}"))
    };
    let mut lines: Lines = proof.running_loop.lost.iter().map(row).collect();
    if proof.running_loop.lost.iter().any(|entry| entry.stable) {
        lines.push(("changes".to_owned(), changes(design, proof)));
    }
    lines
}

fn changes(design: &Design, proof: &Proof) -> String {
    let dwell = design.controller.observer.minimum_dwell;
    let by_mode = proof
        .observer
        .lost
        .as_ref()
        .is_some_and(|lost| lost.lyapunov.iter().any(|list| list.len() > 1));
    if proof.running_loop.transfer.is_some() {
        return match dwell {
            0 => "proved when the set changes at any sample while a mode lasts; a bumpless switch is proved with all sensors"
                .into(),
            samples => format!(
                "proved when a set lasts for at least {samples} samples while a mode lasts; a bumpless switch is proved \
                 with all sensors"
            ),
        };
    }
    match (dwell, by_mode) {
        (0, _) if proof.observer.spec.lyapunov == Lyapunov::Dwell => {
            "proved when the set changes at any sample, and the modes last as above".into()
        }
        (0, _) => "proved when set and mode change at any sample".into(),
        (samples, false) => format!("proved when a set lasts for at least {samples} samples"),
        (samples, true) => format!(
            "proved when neither set nor mode changes for at least {samples} samples after either did"
        ),
    }
}

/// The table as JSON; sensors are numbered from 1.
pub fn json(design: &Design, table: &[LostSensors]) -> Value {
    let outputs = &design.signals.outputs;
    let row = |entry: &LostSensors| {
        let numbers: Vec<usize> = entry.sensors.iter().map(|sensor| sensor + 1).collect();
        let names: Vec<&str> = entry
            .sensors
            .iter()
            .map(|&sensor| outputs[sensor].name.as_str())
            .collect();
        json!({
            "sensors": numbers,
            "names": names,
            "observable": entry.observable,
            "stable": entry.stable,
            "gamma_loop": entry.gamma_loop,
        })
    };
    table.iter().map(row).collect()
}

fn short(gain: f64) -> String {
    match gain < 1e-3 {
        true => format!("{gain:.1e}"),
        false => format!("{gain:.4}"),
    }
}
