//! The paper's theorems as printed, for a person and for a program.

use crate::summary;
use ftc_design::as_printed::PrintedVerdict;
use serde_json::json;
use std::fmt::Write;

/// What came of each theorem, by its name.
pub type Verdicts = [(&'static str, PrintedVerdict)];

/// What a person reads of the design of this name.
pub fn text(name: &str, verdicts: &Verdicts) -> String {
    let mut text = format!("{name}: the theorems as printed\n");
    for (theorem, verdict) in verdicts {
        let PrintedVerdict {
            equation,
            feasible,
            margin,
            blocks,
            reason,
            ..
        } = verdict;
        let word = if *feasible { "feasible" } else { "infeasible" };
        let _ = writeln!(text, "\n{theorem}, equation {equation}: {word}");
        let _ = writeln!(text, "  best margin  {margin:.3e}");
        for block in blocks {
            let share = 100.0 * block.weight;
            let _ = writeln!(text, "  held down by {} ({share:.0} %)", block.name);
        }
        let _ = writeln!(text, "  reason       {reason}");
    }
    text.push('\n');
    text
}

/// The same as JSON.
pub fn json(verdicts: &Verdicts) -> String {
    let theorems: Vec<_> = verdicts
        .iter()
        .map(|(theorem, verdict)| json!({ "theorem": theorem, "verdict": verdict }))
        .collect();
    let feasible = verdicts.iter().all(|(_, verdict)| verdict.feasible);
    summary::pretty(&json!({ "as_printed": true, "feasible": feasible, "theorems": theorems }))
}

/// Which are infeasible, as the beginning of a sentence; none where all are feasible.
pub fn infeasible(verdicts: &Verdicts) -> Option<String> {
    let names: Vec<&str> = verdicts
        .iter()
        .filter(|(_, verdict)| !verdict.feasible)
        .map(|(name, _)| *name)
        .collect();
    match names.as_slice() {
        [] => None,
        [one] => Some(format!("as printed, {one} is infeasible")),
        all => Some(format!("as printed, {} are infeasible", all.join(" and "))),
    }
}
