//! `reproduce`: the paper's two experiments, each as a page with its numbers beside it.
//!
//! Both begin with a design file of examples/, so that what a page shows can be changed and run
//! again by whoever reads it. Every number on a page is computed in the run.

mod converter;
mod experiment;
mod paper;

use crate::output::Staging;
use crate::progress::Progress;
use crate::report::page::Page;
use serde_json::Value;

/// What can be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Experiment {
    /// Section VII-A: the switched example, in every variant.
    Paper,
    /// Section VII-B: the AC/DC converter, against model predictive control.
    Converter,
}

/// What an experiment leaves behind.
struct Findings {
    /// Begins the names of the files.
    name: &'static str,
    page: Page,
    numbers: Value,
    /// One row per output and run.
    table: Vec<u8>,
    /// What to print.
    summary: String,
}

/// Runs an experiment and adds `NAME.html`, `NAME.json` and `NAME.csv`.
///
/// # Errors
/// One sentence: a design that could not be made, or the output directory.
pub fn write(
    experiment: Experiment,
    staging: &Staging,
    progress: &Progress,
) -> Result<String, String> {
    let findings = match experiment {
        Experiment::Paper => paper::run(progress)?,
        Experiment::Converter => converter::run(progress)?,
    };
    let name = findings.name;
    let page = format!("{name}.html");
    staging.add(&page, findings.page.render().as_bytes())?;
    staging.add(
        &format!("{name}.json"),
        format!("{:#}\n", findings.numbers).as_bytes(),
    )?;
    staging.add(&format!("{name}.csv"), &findings.table)?;
    Ok(format!(
        "{}\nwrote {}, {name}.json and {name}.csv\n",
        findings.summary,
        staging.target(&page).display()
    ))
}
