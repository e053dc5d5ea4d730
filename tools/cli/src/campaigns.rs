//! `campaign`: thousands of seeded random runs, in threads, shards and sittings.

use crate::failure::Failure;
use crate::progress::Progress;
use crate::{Made, check_output};
use campaign::page::quantile;
use campaign::rows::RowWriter;
use campaign::{Options, Partial, Watch};
use clap::Args;
use ftc_design::Design;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use package::Replacement;
use package::output::Staging;
use std::fmt::Write as _;
use std::io::IsTerminal;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Name of the result that merges.
const RESULT: &str = "campaign.json";
/// The largest that is read, in bytes: it holds counts, however many runs there were.
const LARGEST_RESULT: u64 = 256 << 20;
/// Name of the page.
const PAGE: &str = "campaign.html";
/// Name of the file with a row per run.
const ROWS: &str = "runs.parquet";
/// Runs of a campaign, where no number is given.
const RUNS: u64 = 1000;
/// How often a sign of life is printed where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// The arguments of `campaign`.
#[derive(Args)]
pub struct Arguments {
    /// Design file (TOML).
    design: PathBuf,
    /// Directory to write to; made if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of runs of the whole campaign: 1000 if left out; with --merge and --resume as many as
    /// were asked for before.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    runs: Option<u64>,
    /// Seed: the same one gives the same runs.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads; as many as the machine has if left out. The results do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Do only shard I of N (from 1): put them together with --merge.
    #[arg(long, value_name = "I/N", value_parser = parse_shard)]
    shard: Option<(u64, u64)>,
    /// Put these campaign.json of other shards together instead of doing runs.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["shard", "rows", "replay", "resume"])]
    merge: Vec<PathBuf>,
    /// Go on with the runs that are missing from the campaign.json in DIR.
    #[arg(long, conflicts_with = "rows")]
    resume: bool,
    /// Also write runs.parquet: a row for each run.
    #[arg(long)]
    rows: bool,
    /// Write run number RUN sample by sample instead, as simulate does.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["shard", "rows", "resume"])]
    replay: Option<u64>,
    /// Largest relative error of the entries of A, B and E (sampled); 0.02 if left out, and none of a
    /// nonlinear plant.
    #[arg(long)]
    model_error: Option<f64>,
    /// Largest fault, in thresholds of its sensor.
    #[arg(long, default_value_t = Options::default().largest_fault)]
    largest_fault: f64,
    /// The most faults in one run.
    #[arg(long, default_value_t = Options::default().most_faults)]
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

    /// Says what is wrong before anything is solved.
    pub fn check(&self) -> Result<(), Failure> {
        check_output(&self.out)?;
        let checked = self.options().check();
        checked.map_err(|error| {
            let option = error.option().replace('_', "-");
            Failure::Input(format!("--{option}: {error}"))
        })
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

/// Does the campaign and returns what to print.
pub fn run(
    made: Made,
    arguments: &Arguments,
    progress: Progress,
    quiet: bool,
) -> Result<String, Failure> {
    if arguments.model_error.is_some() {
        let checked = arguments.options().check_model_error(&made.design);
        checked.map_err(|what| Failure::Input(format!("--model-error: {what}")))?;
    }
    if let Some(run) = arguments.replay {
        return replay(made, arguments, run, &progress);
    }
    drop(progress);
    let design = &made.design;
    let (whole, asked) = match arguments.merge.is_empty() {
        true => work(design, arguments, quiet)?,
        false => merge(design, arguments)?,
    };
    let staging = Staging::new(&arguments.out).map_err(Failure::output_directory)?;
    let json = format!("{:#}\n", campaign::page::json(&whole, asked));
    staging
        .add(RESULT, json.as_bytes())
        .map_err(Failure::output_directory)?;
    let page = campaign::page::html(design, &whole, asked);
    staging
        .add(PAGE, page.as_bytes())
        .map_err(Failure::output_directory)?;
    staging.commit().map_err(Failure::output_directory)?;
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
    made.design.true_plant = drawn.truth;
    crate::simulate(made, &arguments.design, &arguments.out, false, progress)
}

/// Reads the results of shards and puts them together.
fn merge(design: &Design, arguments: &Arguments) -> Result<(Partial, u64), Failure> {
    let parts: Result<Vec<(Partial, u64)>, Failure> =
        arguments.merge.iter().map(|path| read(path)).collect();
    let (parts, asked): (Vec<Partial>, Vec<u64>) = parts?.into_iter().unzip();
    let together = asked
        .iter()
        .fold(0, |sum: u64, &runs| sum.saturating_add(runs));
    let whole =
        campaign::merge(parts).map_err(|error| Failure::Input(format!("--merge: {error}")))?;
    if whole.fingerprint != Partial::new(design, &whole.options).fingerprint {
        return Err(Failure::Input(format!(
            "--merge: the parts belong to another design than {}: name the design file they were made with",
            arguments.design.display()
        )));
    }
    Ok((whole, arguments.runs.unwrap_or(together)))
}

fn read(path: &Path) -> Result<(Partial, u64), Failure> {
    let text = ftc_tables::read_regular(path, LARGEST_RESULT)
        .map_err(|error| error.to_string())
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    text.and_then(|text| campaign::page::read(&text).map_err(|error| error.to_string()))
        .map_err(|what| Failure::Input(format!("{}: {what}", path.display())))
}

/// Does the runs that are missing.
fn work(design: &Design, arguments: &Arguments, quiet: bool) -> Result<(Partial, u64), Failure> {
    let options = arguments.options();
    let mut whole = Partial::new(design, &options);
    let mut asked = None;
    if arguments.resume {
        let (before, runs) = read(&arguments.out.join(RESULT))?;
        asked = Some(runs);
        whole = campaign::merge([whole, before])
            .map_err(|error| Failure::Input(format!("--resume: {error}")))?;
    }
    let watch = Arc::new(Watch::default());
    crate::interrupt::stop(&watch);
    let range = arguments.range(asked)?;
    let missing = whole.missing(range.clone());
    let count = missing.iter().map(|range| range.end - range.start).sum();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.jobs.map_or(0, usize::from))
        .build()
        .map_err(|error| Failure::Input(format!("--jobs: no threads ({error}): give fewer")))?;
    let mut rows = match arguments.rows {
        true => Some(Rows::new(&arguments.out)?),
        false => None,
    };
    std::thread::scope(|scope| {
        let _sign = Sign::new(scope, Arc::clone(&watch), count, quiet);
        for range in missing {
            let part = pool.install(|| {
                campaign::run_watched(design, &options, range, &watch, |outcomes| {
                    rows.as_mut().map_or(Ok(()), |rows| rows.write(outcomes))
                })
            })?;
            whole = campaign::merge([
                std::mem::replace(&mut whole, Partial::new(design, &options)),
                part,
            ])
            .map_err(|error| Failure::Input(error.to_string()))?;
        }
        Ok::<(), Failure>(())
    })?;
    if let Some(rows) = rows {
        rows.keep()?;
    }
    Ok((whole, range.end - range.start))
}

/// The Parquet file, under another name until it is complete.
struct Rows {
    writer: RowWriter<std::fs::File>,
    replacement: Replacement,
}

impl Rows {
    fn new(out: &Path) -> Result<Self, Failure> {
        let target = &out.join(ROWS);
        let made = std::fs::create_dir_all(out).and_then(|()| {
            let replacement = Replacement::of(target)?;
            Ok((replacement.file()?, replacement))
        });
        let (file, replacement) = made.map_err(|error| blame(target, &error))?;
        let writer = RowWriter::new(file).map_err(|error| unwritten(target, error))?;
        Ok(Self {
            writer,
            replacement,
        })
    }

    fn write(&mut self, outcomes: &[campaign::Outcome]) -> Result<(), Failure> {
        self.writer
            .write(outcomes)
            .map_err(|error| unwritten(self.replacement.target(), error))
    }

    fn keep(self) -> Result<(), Failure> {
        let target = self.replacement.target().to_path_buf();
        self.writer
            .finish()
            .map_err(|error| unwritten(&target, error))?;
        self.replacement
            .keep()
            .map_err(|error| blame(&target, &error))
    }
}

fn blame(path: &Path, error: &std::io::Error) -> Failure {
    let what = package::output::unwritten(error, "directory");
    Failure::Input(format!("{}: {what}", path.display()))
}

/// What the file system said, where the Parquet writer passes it on.
fn unwritten(path: &Path, error: campaign::rows::Error) -> Failure {
    let error = match error {
        campaign::rows::Error::External(error) => match error.downcast::<std::io::Error>() {
            Ok(error) => *error,
            Err(error) => std::io::Error::other(error),
        },
        error => std::io::Error::other(error),
    };
    blame(path, &error)
}

/// A bar with the time that remains on a terminal, a line every ten seconds elsewhere; ends when dropped.
struct Sign(Arc<std::sync::atomic::AtomicBool>);

impl Sign {
    fn new<'scope>(
        scope: &'scope std::thread::Scope<'scope, '_>,
        watch: Arc<Watch>,
        count: u64,
        quiet: bool,
    ) -> Self {
        let over = Arc::new(std::sync::atomic::AtomicBool::new(quiet));
        let ends = Arc::clone(&over);
        scope.spawn(move || match std::io::stderr().is_terminal() {
            true => bar(&watch, count, &ends),
            false => lines(&watch, count, &ends),
        });
        Self(over)
    }
}

impl Drop for Sign {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn bar(watch: &Watch, count: u64, over: &std::sync::atomic::AtomicBool) {
    let bar = ProgressBar::with_draw_target(Some(count), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos} of {len} runs, {eta} left") {
        bar.set_style(style);
    }
    while !over.load(Ordering::Relaxed) {
        bar.set_position(watch.done.load(Ordering::Relaxed));
        std::thread::sleep(Duration::from_millis(100));
    }
    bar.finish_and_clear();
}

fn lines(watch: &Watch, count: u64, over: &std::sync::atomic::AtomicBool) {
    let (start, mut next) = (Instant::now(), LINE_EVERY);
    while !over.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(50));
        let (spent, done) = (start.elapsed(), watch.done.load(Ordering::Relaxed));
        if spent < next || done == 0 {
            continue;
        }
        next = spent + LINE_EVERY;
        let left = spent.as_secs_f64() * count.saturating_sub(done) as f64 / done as f64;
        eprintln!("{done} of {count} runs, {left:.0} s left");
    }
}

fn summary(whole: &Partial, asked: u64, arguments: &Arguments) -> String {
    let statistics = &whole.statistics;
    let mut text = format!(
        "{}: {} runs, of which {} without a fault\n\n{:<34}{:>12}{:>12}{:>12}{:>12}\n",
        whole.design,
        statistics.runs,
        statistics.healthy.runs,
        "true error",
        "half",
        "90 %",
        "99 %",
        "worst"
    );
    for (name, histogram) in [
        ("with fault tolerance", &statistics.error),
        ("without", &statistics.error_without),
        ("told the fault", &statistics.error_told),
        ("with, over told", &statistics.over_told),
        ("with, over without", &statistics.over_none),
        (
            "with, over without, no fault",
            &statistics.healthy.over_none,
        ),
    ] {
        let _ = write!(text, "{name:<34}");
        for share in [0.5, 0.9, 0.99, 1.0] {
            let _ = write!(text, " {:>11}", quantile(histogram, share));
        }
        text.push('\n');
    }
    let alarms: u64 = statistics.false_alarms.iter().sum();
    let samples: u64 = statistics.sound_samples.iter().sum();
    let _ = writeln!(
        text,
        "\nworse than without in {} of {} runs with faults; {alarms} false alarms in {samples} samples of sound sensors\n\
         wrote {} and {}",
        statistics.worse_than_none,
        statistics.faulty_runs,
        arguments.out.join(PAGE).display(),
        RESULT
    );
    if statistics.runs < asked {
        let _ = writeln!(
            text,
            "warning: {} of {asked} runs were done: {}",
            statistics.runs,
            match arguments.merge.is_empty() {
                true => "go on with --resume",
                false => "merge the other shards, too",
            }
        );
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
