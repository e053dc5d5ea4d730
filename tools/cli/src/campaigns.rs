//! `campaign`: thousands of seeded random runs, in threads, shards and sittings.

use crate::failure::{number, option, whole};
use crate::progress::{Progress, Runs};
use crate::rows::{self, Rows};
use crate::{check_output, failure::Failure};
use campaign::files::{self, PAGE, RESULT};
use campaign::{Options, OptionsError, Partial, RUNS, Watch};
use clap::Args;
use ftc_design::{Design, MOST_THREADS};
use report::Made;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The arguments of `campaign`.
#[derive(Args)]
pub struct Arguments {
    /// Design file (TOML).
    design: PathBuf,
    /// Directory to write to; made if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[arg(long, value_parser = whole::<u64>(1, 1_000_000_000), allow_negative_numbers = true, help = format!(
        "Number of runs of the whole campaign: {RUNS} if left out; with --merge and --resume as many as were asked for \
         before"
    ))]
    runs: Option<u64>,
    /// Seed: the same one gives the same runs.
    #[arg(long, default_value_t = Options::default().seed, value_parser = whole::<u64>(0, u64::MAX), allow_negative_numbers = true)]
    seed: u64,
    /// Threads; as many as the machine has if left out. The results do not depend on it.
    #[arg(long, value_parser = whole::<u16>(1, MOST_THREADS as u64), allow_negative_numbers = true)]
    jobs: Option<u16>,
    /// Do only shard I of N (from 1): put them together with --merge.
    #[arg(long, value_name = "I/N", value_parser = parse_shard)]
    shard: Option<(u64, u64)>,
    /// Put these campaign.json of other shards together instead of doing runs.
    #[arg(long, value_name = "FILE", num_args = 1..,
          conflicts_with_all = ["shard", "rows", "replay", "resume", "seed", "jobs", "model_error", "largest_fault", "most_faults"])]
    merge: Vec<PathBuf>,
    /// Go on with the runs that are missing from the campaign.json in DIR.
    #[arg(long, conflicts_with = "rows")]
    resume: bool,
    /// Also write runs.parquet: a row for each run.
    #[arg(long)]
    rows: bool,
    /// Write run number RUN sample by sample instead, as simulate does.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["shard", "rows", "resume"], allow_negative_numbers = true,
          value_parser = whole::<u64>(0, u64::MAX))]
    replay: Option<u64>,
    #[arg(long, value_parser = number, allow_negative_numbers = true, help = format!(
        "Largest relative error of the entries of A, B and E (sampled); {} if left out, and none of a nonlinear plant",
        Options::default().model_error
    ))]
    model_error: Option<f64>,
    /// Largest fault, in thresholds of its sensor.
    #[arg(long, default_value_t = Options::default().largest_fault, value_parser = number, allow_negative_numbers = true)]
    largest_fault: f64,
    /// The most faults in one run.
    #[arg(long, default_value_t = Options::default().most_faults, allow_negative_numbers = true,
          value_parser = whole::<u32>(0, u32::MAX.into()))]
    most_faults: u32,
}

fn parse_shard(text: &str) -> Result<(u64, u64), String> {
    let numbers = text
        .split_once('/')
        .and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
    numbers
        .filter(|(index, count)| (1..=*count).contains(index))
        .ok_or_else(|| "give I/N with I from 1 to N, such as 2/8".into())
}

impl Arguments {
    /// The design file.
    pub fn design(&self) -> &Path {
        &self.design
    }

    /// Says what is wrong before anything is solved, and reads the earlier results that are asked for, each
    /// with the number of its runs.
    pub fn begin(&self) -> Result<Vec<(Partial, u64)>, Failure> {
        check_output(&self.out)?;
        self.options().check().map_err(misfit)?;
        rows::check(self.rows, rows::BUILT)?;
        let read = |option, path: &Path, advice| {
            files::read(path).map_err(|error| refused(option, format!("{error}{advice}")))
        };
        if self.resume {
            let advice = ", or leave it out to begin anew";
            return Ok(vec![read("--resume", &self.out.join(RESULT), advice)?]);
        }
        let parts = self.merge.iter();
        parts.map(|path| read("--merge", path, "")).collect()
    }

    fn options(&self) -> Options {
        let mut options = Options::default().with_seed(self.seed);
        options.model_error = self.model_error.unwrap_or(options.model_error);
        options.largest_fault = self.largest_fault;
        options.most_faults = self.most_faults;
        options
    }

    /// The runs to be done, apart from those that are done already; `before` is how many an earlier call
    /// was asked for.
    fn range(&self, before: Option<u64>) -> Result<Range<u64>, Failure> {
        if self.runs.is_none() && self.shard.is_some() && before.is_some() {
            let what = "--resume with --shard: give --runs of the whole campaign, too";
            return Err(Failure::Input(what.into()));
        }
        let runs = self.runs.or(before).unwrap_or(RUNS);
        let (index, count) = self.shard.unwrap_or((1, 1));
        Ok(campaign::shard(runs, index, count))
    }
}

/// An option of the runs that does not fit.
fn misfit(error: OptionsError) -> Failure {
    Failure::Input(format!("{} {}", option(error.option()), error.reason()))
}

/// An option that does not fit.
fn refused(option: &str, what: impl std::fmt::Display) -> Failure {
    Failure::Input(format!("{option}: {what}"))
}

/// Does the campaign, going on from what [`Arguments::begin`] found, and returns what to print.
pub fn run(
    made: Made,
    arguments: &Arguments,
    earlier: Vec<(Partial, u64)>,
    progress: Progress,
    quiet: bool,
) -> Result<String, Failure> {
    if arguments.model_error.is_some() {
        let checked = arguments.options().check_model_error(&made.design);
        checked.map_err(misfit)?;
    }
    if let Some(run) = arguments.replay {
        return replay(made, arguments, run, &progress);
    }
    drop(progress);
    let design = &made.design;
    let (whole, asked) = match arguments.merge.is_empty() {
        true => work(design, arguments, earlier, quiet)?,
        false => merge(design, arguments, earlier)?,
    };
    files::write(&arguments.out, design, &whole, asked)?;
    let mut warnings = made.warnings;
    warnings.extend(campaign::page::unstable(&made.design, &whole).map(small));
    Ok(summary(&whole, asked, arguments) + &report::warnings::text(&warnings))
}

/// A run of the campaign, sample by sample.
fn replay(
    mut made: Made,
    arguments: &Arguments,
    run: u64,
    progress: &Progress,
) -> Result<String, Failure> {
    let drawn = campaign::draw(&made.design, &arguments.options(), run);
    made.design.scenario = drawn.scenario;
    made.design.true_plant = drawn.true_plant;
    crate::simulate(made, &arguments.design, &arguments.out, false, progress)
}

/// Puts the results of shards together.
fn merge(
    design: &Design,
    arguments: &Arguments,
    parts: Vec<(Partial, u64)>,
) -> Result<(Partial, u64), Failure> {
    let (parts, asked): (Vec<Partial>, Vec<u64>) = parts.into_iter().unzip();
    let together = asked.into_iter().fold(0, u64::saturating_add);
    let whole = campaign::merge(parts).map_err(|error| refused("--merge", error))?;
    if !whole.is_of(design) {
        let file = arguments.design.display();
        return Err(refused(
            "--merge",
            format!(
                "the parts belong to another design than {file}: name the design file they were made with"
            ),
        ));
    }
    Ok((whole, arguments.runs.unwrap_or(together)))
}

/// Does the runs that are missing.
fn work(
    design: &Design,
    arguments: &Arguments,
    earlier: Vec<(Partial, u64)>,
    quiet: bool,
) -> Result<(Partial, u64), Failure> {
    let options = arguments.options();
    let mut whole = Partial::new(design, &options);
    let mut asked = None;
    for (before, runs) in earlier {
        asked = Some(runs);
        whole = campaign::merge([whole, before]).map_err(|error| refused("--resume", error))?;
    }
    let watch = Arc::new(Watch::default());
    crate::interrupt::stop(&watch);
    let range = arguments.range(asked)?;
    let missing = whole.missing(range.clone());
    let count = missing.iter().map(|range| range.end - range.start).sum();
    let pool = crate::pool("--jobs", arguments.jobs.map_or(0, usize::from))?;
    let unwritten = |error: output::Error| Failure::Input(error.to_string());
    let mut rows = Rows::begin(arguments.rows, &arguments.out).map_err(unwritten)?;
    let whole = std::thread::scope(|scope| {
        let _shown = Runs::show(scope, Arc::clone(&watch), count, quiet);
        pool.install(|| {
            campaign::complete(
                whole,
                (design, &options),
                range.clone(),
                &watch,
                |outcomes| rows.write(outcomes),
            )
        })
    });
    let whole = whole.map_err(unwritten)?;
    rows.keep().map_err(unwritten)?;
    Ok((whole, range.end - range.start))
}

fn summary(whole: &Partial, asked: u64, arguments: &Arguments) -> String {
    let page = arguments.out.join(PAGE);
    let mut text = campaign::page::text(whole);
    let _ = writeln!(text, "wrote {} and {RESULT}", page.display());
    let runs = whole.runs();
    if runs < asked {
        let more = match arguments.merge.is_empty() {
            true => "go on with --resume",
            false => "merge the other shards, too",
        };
        let _ = writeln!(text, "warning: {runs} of {asked} runs were done: {more}");
    }
    text
}

/// A sentence after the word that comes before its first one.
fn small(sentence: String) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_lowercase().chain(letters).collect()
    })
}
