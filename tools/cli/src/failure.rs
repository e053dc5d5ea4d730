//! Why a command ends without success, and with which exit code.

use design_file::values::NameOrList;
use design_file::wording;
use ftc_design::{ControlSpec, DesignError};
use report::summary;
use std::fmt;
use std::path::Path;

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Something the user gave is at fault; one sentence says what and what to do.
    Input(String),
    /// The inputs are sound, but there is no such controller, or none that can be certified.
    NoDesign {
        /// The design file.
        file: String,
        /// What was asked for.
        asked: Box<ControlSpec>,
        /// Why not.
        error: Box<ftc_design::Failure>,
        /// What to print to standard output beside the error.
        output: Option<String>,
    },
    /// What was looked at does not hold what it promises.
    Refused {
        /// The file looked at.
        file: String,
        /// Why not; one sentence.
        what: String,
        /// What to print to standard output beside the error.
        output: Option<String>,
    },
}

impl Failure {
    /// Sorts a design error: an ill-formed request is the design file's fault. `logs` are those it names.
    pub fn new(
        path: &Path,
        asked: ControlSpec,
        error: ftc_design::Failure,
        logs: Option<&NameOrList>,
    ) -> Self {
        let file = path.display().to_string();
        match error.error {
            DesignError::Request(what) => {
                Self::Input(format!("{file}: {}", wording::of_request(&what, logs)))
            }
            _ => Self::NoDesign {
                file,
                asked: Box::new(asked),
                error: Box::new(error),
                output: None,
            },
        }
    }

    /// The same failure, with a JSON object for standard output where there is a verdict.
    pub fn explained_in_json(self) -> Self {
        match self {
            Self::NoDesign {
                file, asked, error, ..
            } => Self::NoDesign {
                output: Some(summary::json_of_failure(&asked, &error)),
                file,
                asked,
                error,
            },
            other => other,
        }
    }

    /// What goes to standard output.
    pub fn output(&self) -> Option<&str> {
        match self {
            Self::Input(_) => None,
            Self::NoDesign { output, .. } | Self::Refused { output, .. } => output.as_deref(),
        }
    }

    /// See the command line's help.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => crate::INPUT,
            Self::NoDesign { .. } | Self::Refused { .. } => crate::NO_SUCH,
        }
    }
}

impl From<String> for Failure {
    fn from(sentence: String) -> Self {
        Self::Input(sentence)
    }
}

impl From<output::Error> for Failure {
    fn from(error: output::Error) -> Self {
        Self::Input(format!("--out {error}"))
    }
}

impl From<package::Error> for Failure {
    fn from(error: package::Error) -> Self {
        match error {
            package::Error::Output(error) => error.into(),
            package::Error::Key {
                option: name,
                file,
                what,
            } => Self::Input(format!("{} {}: {what}", option(name), file.display())),
            error => Self::Input(error.to_string()),
        }
    }
}

/// Reads a whole number of an option, within bounds.
pub fn whole<T: TryFrom<u64>>(least: u64, most: u64) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| {
        let number = text
            .parse()
            .ok()
            .filter(|number| (least..=most).contains(number));
        number
            .and_then(|number| T::try_from(number).ok())
            .ok_or_else(|| match most {
                u64::MAX => format!("give a whole number, {least} or more"),
                most => format!("give a whole number from {least} to {most}"),
            })
    }
}

/// Reads a number of an option.
pub fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "give a number".into())
}

/// The option that gives the value of this key.
pub fn option(key: &str) -> String {
    format!("--{}", key.replace('_', "-"))
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(what) => f.write_str(what),
            Self::NoDesign { file, error, .. } => {
                write!(f, "{file}: {}", wording::of_error(&error.error))
            }
            Self::Refused { file, what, .. } => write!(f, "{file}: {what}"),
        }
    }
}
