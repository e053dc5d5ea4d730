//! `design --as-printed`: the paper's Theorems 1 and 2 as they stand, put to the margin problem.

use crate::failure::Failure;
use ftc_design::DesignError;
use ftc_design::as_printed::{PrintedVerdict, theorem_1, theorem_2};
use ftc_design::assembly::Request;
use report::summary;
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// Reports both theorems.
///
/// # Errors
/// [`Failure::Refused`] with the report where a theorem is infeasible, else as the theorems.
pub fn report(path: &Path, request: Request, as_json: bool) -> Result<String, Failure> {
    let verdicts = solve(&request)
        .map_err(|error| Failure::new(path, request.control.clone(), error.into()))?;
    let output = match as_json {
        true => json(&verdicts),
        false => text(&request.name, &verdicts),
    };
    let infeasible: Vec<&str> = verdicts
        .iter()
        .filter(|(_, verdict)| !verdict.feasible)
        .map(|(name, _)| *name)
        .collect();
    match infeasible.is_empty() {
        true => Ok(output),
        false => Err(Failure::Refused {
            file: path.display().to_string(),
            what: format!(
                "as printed, {} infeasible: design without --as-printed",
                match infeasible.as_slice() {
                    [one] => format!("{one} is"),
                    all => format!("{} are", all.join(" and ")),
                }
            ),
            output: Some(output),
        }),
    }
}

type Verdicts = [(&'static str, PrintedVerdict); 2];

fn solve(request: &Request) -> Result<Verdicts, DesignError> {
    Ok([
        ("Theorem 1", theorem_1(&request.plant)?),
        ("Theorem 2", theorem_2(&request.plant, &request.control)?),
    ])
}

fn text(name: &str, verdicts: &Verdicts) -> String {
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

fn json(verdicts: &Verdicts) -> String {
    let theorems: Vec<_> = verdicts
        .iter()
        .map(|(theorem, verdict)| json!({ "theorem": theorem, "verdict": verdict }))
        .collect();
    let feasible = verdicts.iter().all(|(_, verdict)| verdict.feasible);
    summary::pretty(&json!({ "as_printed": true, "feasible": feasible, "theorems": theorems }))
}
