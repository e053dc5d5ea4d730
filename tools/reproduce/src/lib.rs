//! `reproduce`: the paper's two experiments, each as a page with its numbers beside it.
//!
//! Both begin with a design file of examples/, so that what a page shows can be changed and run
//! again by whoever reads it. Every number on a page is computed in the run.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use reproduce::{Experiment, run};
//!
//! let found = run(Experiment::Paper, &|step| println!("{step}"))?;
//! println!("{}", found.summary);
//! let names: Vec<&str> = found.files.iter().map(|(name, _)| name.as_str()).collect();
//! assert!(names.contains(&"paper.html") && names.contains(&"paper.csv"));
//! # Ok(())
//! # }
//! ```

mod converter;
mod experiment;
mod paper;

use design_file::wording;
use ftc_baselines::predictive::PredictiveError;
use ftc_design::DesignError;
use report::page::Page;
use serde_json::Value;

/// What can be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::exhaustive_enums, reason = "the paper's two experiments")]
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

/// Is told what is going on now.
pub type Progress<'a> = &'a dyn Fn(&'static str);

/// An experiment that was run.
#[non_exhaustive]
pub struct Reproduction {
    /// Begins the names of the files.
    pub name: &'static str,
    /// Name and contents of `NAME.html`, `NAME.json` and `NAME.csv`.
    pub files: Vec<(String, Vec<u8>)>,
    /// The most important numbers as a table for a person.
    pub summary: String,
}

/// Why an experiment was not run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The design file of an example.
    #[error(transparent)]
    Example(#[from] design_file::Error),
    /// There is no such design, or none that can be certified.
    #[error("{case}: {}", wording::of_error(error))]
    Design {
        /// What was to be designed.
        case: String,
        /// Why not.
        error: DesignError,
    },
    /// The controller that is compared with.
    #[error("{case}: the predictive controller: {error}")]
    Baseline {
        /// In which case.
        case: String,
        /// Why there is none.
        error: PredictiveError,
    },
    /// A table that cannot be written.
    #[error(transparent)]
    Table(#[from] csv::Error),
}

/// Runs an experiment.
///
/// # Errors
/// A design that could not be made.
pub fn run(experiment: Experiment, progress: Progress) -> Result<Reproduction, Error> {
    let findings = match experiment {
        Experiment::Paper => paper::run(progress)?,
        Experiment::Converter => converter::run(progress)?,
    };
    let name = findings.name;
    let numbers = format!("{:#}\n", findings.numbers);
    Ok(Reproduction {
        name,
        files: vec![
            (format!("{name}.html"), findings.page.render().into_bytes()),
            (format!("{name}.json"), numbers.into_bytes()),
            (format!("{name}.csv"), findings.table),
        ],
        summary: findings.summary,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ftc_design::RequestError;

    #[test]
    fn a_case_without_a_design_is_named_with_the_keys_to_change() {
        let case = "paper, disturbance on the state, noise 0".to_string();
        let error = RequestError::Bumpless.into();
        let said = Error::Design { case, error }.to_string();
        assert!(
            said.starts_with(
                "paper, disturbance on the state, noise 0: controller.bumpless = true"
            ),
            "{said}"
        );
    }
}
