//! `identify`: from logs of healthy operation to a design file.

use crate::failure::{Failure, number, whole};
use design_file::identification::{self, Asked, MOST_HARMONICS};
use ftc_design::harmonics::KnownDisturbance;
use std::path::{Path, PathBuf};

/// The arguments of `identify`.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// Logs (delimited text). A column `mode` (from 1) tells the active mode; without one, several
    /// logs are one mode each.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Design file to write (TOML); its name names the design.
    #[arg(long, value_name = "DESIGN")]
    out: PathBuf,
    /// Columns of the inputs; by default u[1], u[2] and so on.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    inputs: Vec<String>,
    /// Columns of the outputs; by default y[1], y[2] and so on.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    outputs: Vec<String>,
    /// Column of the time, where it has none of the usual names (t, time, timestamp).
    #[arg(long, value_name = "NAME")]
    time: Option<String>,
    /// Seconds between two rows, where no column tells the time.
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_negative_numbers = true)]
    sample_time: Option<f64>,
    /// Period of a disturbance that is in the logs and that was not measured: it is told from the plant.
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_negative_numbers = true)]
    period: Option<f64>,
    /// Harmonics of that disturbance, the fundamental included.
    #[arg(long, default_value_t = KnownDisturbance::HARMONICS as u32, requires = "period", allow_negative_numbers = true,
          value_parser = whole::<u32>(1, MOST_HARMONICS as u64))]
    harmonics: u32,
    /// Number of states; by default the smallest that fits nearly as well as the best.
    #[arg(long, value_parser = whole::<usize>(1, u64::MAX), allow_negative_numbers = true)]
    order: Option<usize>,
}

impl Arguments {
    /// The folder and the name of the design file.
    pub fn target(&self) -> (PathBuf, String) {
        let folder = self.out.parent();
        let folder = folder.filter(|folder| !folder.as_os_str().is_empty());
        let name = self.out.file_name();
        (
            folder.unwrap_or(Path::new(".")).into(),
            name.map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        )
    }
}

/// Identifies a plant; returns the text of the design file, and what there is to say.
pub fn identify(arguments: &Arguments) -> Result<(String, String), Failure> {
    let given = arguments.clone();
    let asked = Asked {
        logs: given.logs,
        out: given.out,
        inputs: given.inputs,
        outputs: given.outputs,
        time: given.time,
        sample_time: given.sample_time,
        period: given.period,
        harmonics: given.harmonics,
        order: given.order,
    };
    let found = identification::identify(&asked)
        .map_err(|error| Failure::Input(error.worded(crate::failure::option)))?;
    let report = report::identification::text(&found.identified, &found.outputs);
    Ok((found.text, report))
}
