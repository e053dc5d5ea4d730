//! What was found in logs, for a person.

use ftc_identify::{Coordinates, Identified};
use std::fmt::Write;

/// The orders tried and the fit of each mode, by the names of the outputs.
pub fn text(found: &Identified, outputs: &[String]) -> String {
    let mut text = String::from("order  fit on validation data\n");
    for (order, fit) in &found.tried {
        let mark = if *order == found.order {
            "  <- chosen"
        } else {
            ""
        };
        let _ = writeln!(text, "{order:5}  {fit:6.2} %{mark}");
    }
    for (number, mode) in found.modes.iter().enumerate() {
        let fits: Vec<String> = mode
            .fit
            .iter()
            .zip(outputs)
            .map(|(fit, name)| format!("{name} {fit:.2} %"))
            .collect();
        let _ = writeln!(
            text,
            "mode {}: fit on {} samples held out: {}",
            number + 1,
            mode.held_out,
            fits.join(", ")
        );
    }
    let joined = match found.coordinates {
        Coordinates::Single => None,
        Coordinates::Switches { fit } => Some(format!(
            "the modes share one state; at switches it is continuous to {fit:.1} %"
        )),
        Coordinates::Outputs => Some(
            "too few switches were logged to tell one mode's state from another's: states are outputs"
                .into(),
        ),
    };
    text.extend(joined.map(|line| line + "\n"));
    text
}
