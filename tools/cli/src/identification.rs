//! `identify`: from logs of healthy operation to a design file.

use crate::failure::Failure;
use ftc_identify::{Coordinates, Identified, IdentifiedMode, Log, Settings};
use ftc_tables::{Clock, Table, find_time_column};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What is asked for.
#[derive(Clone, Debug, clap::Args)]
pub struct Asked {
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
    /// Column of the time, where it is called neither t nor time.
    #[arg(long, value_name = "NAME")]
    time: Option<String>,
    /// Seconds between two rows, where no column tells the time.
    #[arg(long, value_name = "SECONDS")]
    sample_time: Option<f64>,
    /// Period of a disturbance that is in the logs and that was not measured: it is told from the plant.
    #[arg(long, value_name = "SECONDS")]
    period: Option<f64>,
    /// Harmonics of that disturbance, the fundamental included.
    #[arg(long, default_value_t = 1, requires = "period", value_parser = clap::value_parser!(u32).range(1..=50))]
    harmonics: u32,
    /// Number of states; by default the smallest that fits nearly as well as the best.
    #[arg(long)]
    order: Option<usize>,
}

impl Asked {
    /// Periods of the disturbance in samples.
    fn periods(&self, sample_time: f64) -> Vec<f64> {
        let of =
            |period: f64| (1..=self.harmonics).map(move |n| period / f64::from(n) / sample_time);
        self.period.into_iter().flat_map(of).collect()
    }

    /// The folder and the name of the design file.
    pub fn target(&self) -> (PathBuf, String) {
        let folder = self
            .out
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let name = self
            .out
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        (
            folder.unwrap_or(Path::new(".")).into(),
            name.unwrap_or_default(),
        )
    }
}

/// Why a log cannot be used: the end of a sentence that begins with its name.
type Unusable = Box<dyn std::error::Error>;

/// One file that was read.
struct Read {
    log: Log,
    sample_time: Option<f64>,
    has_modes: bool,
    inputs: Vec<String>,
    outputs: Vec<String>,
}

/// Identifies a plant; returns the text of the design file, and what there is to say.
///
/// # Errors
/// One sentence that names the file and what to do.
pub fn identify(asked: &Asked) -> Result<(String, String), Failure> {
    let name = name_of(&asked.out)?;
    let mut files: Vec<Read> = Vec::new();
    for path in &asked.logs {
        let file = read(path, asked).map_err(|what| format!("{}: {what}", path.display()))?;
        files.push(file);
    }
    let several = files.len() > 1 && files.iter().all(|file| !file.has_modes);
    if several {
        for (mode, file) in files.iter_mut().enumerate() {
            file.log.modes.fill(mode);
        }
    }
    let sample_time = sample_time(asked, &files)?;
    let logs: Vec<Log> = files.iter().map(|file| file.log.clone()).collect();
    let mut settings = Settings::default();
    settings.order = asked.order;
    settings.periods = asked.periods(sample_time);
    let found = ftc_identify::identify(&logs, &settings).map_err(|error| error.to_string())?;
    let first = files
        .first()
        .ok_or_else(|| Failure::Input("name at least one log".into()))?;
    let text = design_file(&name, sample_time, &found, first, asked, several)?;
    Ok((text, report(&found, &first.outputs)))
}

/// The design's name: the file's, which must be a C identifier.
fn name_of(out: &Path) -> Result<String, String> {
    let stem = out
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or_default();
    design_file::check::identifier(stem)
        .map(|()| stem.to_string())
        .map_err(|what| format!("--out {}: the file's name {what}", out.display()))
}

fn read(path: &Path, asked: &Asked) -> Result<Read, Unusable> {
    let mut table = Table::open(path)?;
    let names = table.names().to_vec();
    let inputs = columns(&names, &asked.inputs, "u", "--inputs")?;
    let outputs = columns(&names, &asked.outputs, "y", "--outputs")?;
    let taken: Vec<usize> = inputs.iter().chain(&outputs).copied().collect();
    let mode = names
        .iter()
        .position(|name| name.eq_ignore_ascii_case("mode"));
    let time = find_time_column(&names, asked.time.as_deref(), &taken)?;
    let mut clock = time.map(Clock::new);
    let (mut u, mut y, mut modes) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(row) = table.next_row()? {
        if let Some(clock) = &mut clock {
            clock.read(&mut table, &row)?;
        }
        for &column in &inputs {
            u.push(table.number(&row, column, f64::is_finite)?);
        }
        for &column in &outputs {
            y.push(table.number(&row, column, f64::is_finite)?);
        }
        let whole = |value: f64| (1.0..=64.0).contains(&value) && value.fract() == 0.0;
        modes.push(match mode {
            Some(column) => table.number(&row, column, whole)? as usize - 1,
            None => 0,
        });
    }
    let sample_time = clock.map(|clock| even(&clock)).transpose()?;
    let matrix = |values: &[f64], width: usize| {
        nalgebra::DMatrix::from_row_slice(modes.len(), width, values)
    };
    let named = |columns: &[usize]| columns.iter().map(|&at| names[at].clone()).collect();
    Ok(Read {
        sample_time,
        has_modes: mode.is_some(),
        inputs: named(&inputs),
        outputs: named(&outputs),
        log: Log::new(matrix(&u, inputs.len()), matrix(&y, outputs.len())).in_modes(modes),
    })
}

/// The mean step of an even clock.
fn even(clock: &Clock) -> Result<f64, Unusable> {
    let times = clock.times();
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Err("it has no rows: record healthy operation".into());
    };
    let step = (last - first) / (times.len().max(2) - 1) as f64;
    // Printed times are rounded: a step of 4.9999999 s is one of 5 s.
    let step = format!("{step:.6e}").parse().unwrap_or(step);
    clock.check_ascending()?;
    clock.check_uniform(step)?;
    Ok(step)
}

/// Where the signals of a kind stand: those that are named, else `letter[1]`, `letter[2]`, ...
fn columns(
    names: &[String],
    said: &[String],
    letter: &str,
    option: &str,
) -> Result<Vec<usize>, String> {
    if !said.is_empty() {
        let find = |wanted: &String| {
            let found = names.iter().position(|name| name == wanted);
            found.ok_or_else(|| {
                format!(
                    "has no column \"{wanted}\": {option} may name {}",
                    names.join(", ")
                )
            })
        };
        return said.iter().map(find).collect();
    }
    let numbered = |number: usize| {
        let wanted = format!("{letter}[{number}]");
        names.iter().position(|name| *name == wanted)
    };
    let found: Vec<usize> = (1..).map_while(numbered).collect();
    match found.is_empty() {
        true => Err(format!(
            "has no column {letter}[1]: say which are meant by {option} NAME,NAME; it has {}",
            names.join(", ")
        )),
        false => Ok(found),
    }
}

fn sample_time(asked: &Asked, files: &[Read]) -> Result<f64, String> {
    let told = files.iter().find_map(|file| file.sample_time);
    let step = asked.sample_time.or(told).ok_or(
        "no column is called t or time: give the seconds between two rows by --sample-time",
    )?;
    let differs = |file: &Read| {
        file.sample_time
            .is_some_and(|other| (other - step).abs() > 0.01 * step)
    };
    match files.iter().position(differs) {
        Some(index) => Err(format!(
            "{}: its rows are {} s apart, not {step} s: give logs of one sample time",
            asked.logs[index].display(),
            files[index].sample_time.unwrap_or(step)
        )),
        None => Ok(step),
    }
}

/// The orders tried and the fit of each mode.
fn report(found: &Identified, outputs: &[String]) -> String {
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

fn design_file(
    name: &str,
    sample_time: f64,
    found: &Identified,
    first: &Read,
    asked: &Asked,
    several: bool,
) -> Result<String, String> {
    let mut text = format!(
        "# Identified from logs of healthy operation by ftc-fmu identify: order {}, chosen by the fit.\n\
         # Say in [controller] what the loop shall do; examples/paper.toml explains every key.\n\n\
         name = \"{name}\"\nsample_time = {sample_time:?} # seconds\n",
        found.order
    );
    for mode in &found.modes {
        text.push_str(&mode_table(mode));
    }
    let names = |names: &[String]| {
        let each: Vec<String> = names
            .iter()
            .map(|name| format!("{{ name = {name:?} }}"))
            .collect();
        each.join(", ")
    };
    let _ = write!(
        text,
        "\n[signals]\ninputs = [{}]\noutputs = [{}]\n",
        names(&first.inputs),
        names(&first.outputs)
    );
    if let Some(period) = asked.period {
        let _ = write!(
            text,
            "\n[disturbance]\nperiod = {period:?} # seconds\nharmonics = {}\n",
            asked.harmonics
        );
    }
    let folder = asked.out.parent().unwrap_or(Path::new(""));
    let paths: Vec<String> = asked
        .logs
        .iter()
        .map(|log| relative(log, folder).map(|path| format!("{path:?}")))
        .collect::<Result<_, _>>()?;
    let one_log = paths.len() == 1;
    if one_log || several {
        let files = match one_log {
            true => paths.join(""),
            false => format!("[{}]", paths.join(", ")),
        };
        let _ = write!(text, "\n[estimator]\ndatabase = {files}\n");
        if let Some(time) = &asked.time {
            let _ = writeln!(text, "time = {time:?}");
        }
    }
    Ok(text)
}

fn mode_table(mode: &IdentifiedMode) -> String {
    let list = |values: &[f64]| {
        let numbers: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
        format!("[{}]", numbers.join(", "))
    };
    let rows = |matrix: &nalgebra::DMatrix<f64>| {
        let rows: Vec<String> = matrix
            .row_iter()
            .map(|row| list(&row.iter().copied().collect::<Vec<_>>()))
            .collect();
        format!("[{}]", rows.join(", "))
    };
    format!(
        "\n[[mode]]\nA = {}\nB = {}\nC = {}\noperating_point = {{ x = {}, u = {}, y = {} }}\n",
        rows(&mode.a),
        rows(&mode.b),
        rows(&mode.c),
        list(mode.x0.as_slice()),
        list(mode.u0.as_slice()),
        list(mode.y0.as_slice())
    )
}

/// A log's path as the design file in `folder` names it.
fn relative(log: &Path, folder: &Path) -> Result<String, String> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let full = |path: &Path| {
        path.canonicalize().map_err(|error| {
            format!(
                "{}: cannot be found ({error}): check the path",
                path.display()
            )
        })
    };
    let (log, folder) = (full(log)?, full(folder)?);
    let path = log.strip_prefix(&folder).unwrap_or(&log);
    path.to_str()
        .map(str::to_string)
        .ok_or_else(|| format!("{}: the path is no UTF-8 text: rename it", log.display()))
}
