//! `ftc-fmu`: from a design file to a certified controller, its FMUs and its simulation.
//!
//! ```text
//! DESIGN.toml ── design-file ──> ftc_design ──┬─> report    (design, simulate)
//!                                              ├─> campaign  (random runs)
//!                                              └─> package   (export: two FMUs)
//!                  logs ── design-file ──> DESIGN.toml       (identify)
//!                         FMU ────────────────────> package  (verify: the proof, once more)
//!
//! examples ── reproduce ──> a page, JSON and CSV per experiment of the paper
//! ```
//!
//! The program reads arguments, calls these libraries, words what they return, and decides the exit
//! code.

mod campaigns;
mod failure;
mod identification;
mod interrupt;
mod progress;
mod rows;

use clap::{Parser, Subcommand, ValueEnum};
use design_file::{Loaded, examples};
use failure::Failure;
use ftc_design::as_printed::{theorem_1, theorem_2};
use ftc_design::assembly::Request;
use ftc_design::{Design, MOST_THREADS, Run, Solver, Step};
use output::Staging;
use package::signature::SigningKey;
use package::solved::{self, LoadError};
use progress::Progress;
use report::simulate::{Extent, SimulateError, simulate_into};
use report::{Made, Source, as_printed, estimate, summary, warnings};
use serde_json::json;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Design, certify, export and simulate sensor-fault-tolerant controllers for switched linear plants.
///
/// A design file (TOML) describes the plant, what the controller shall do and an experiment;
/// start from one of those in examples/.
#[derive(Parser)]
#[command(version, after_help = EXIT_CODES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Print nothing but errors.
    #[arg(long, global = true)]
    quiet: bool,
    /// Which solver finds the gains; what it finds is certified either way.
    #[arg(long, global = true, value_enum, default_value_t = SolverChoice::Structured)]
    solver: SolverChoice,
    /// Work on so many independent parts of a design at the same time, such as the modes under dwell and sets
    /// of lost sensors. The design does not depend on it; memory grows with it.
    #[arg(long, global = true, value_name = "N", default_value_t = 1, allow_negative_numbers = true,
          value_parser = failure::whole::<u16>(1, MOST_THREADS as u64))]
    threads: u16,
}

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  there is no such controller: the design is infeasible or could not be certified;
     of verify: the FMU does not hold what it promises
  2  the command line, a file or the output directory is at fault; nothing was written;
     or standard output cannot be written to";

#[derive(Subcommand)]
enum Command {
    /// Solve for the gains, certify them and print the report.
    ///
    /// The report tells per mode the attenuation gamma from the disturbance to the weighted
    /// outputs, tracking-error integrals and inputs, and the spectral radius of the closed loop;
    /// then the observer, how well the fault estimator's predictor fits, and what is certified.
    #[command(after_help = EXIT_CODES)]
    Design {
        /// Design file (TOML).
        design: PathBuf,
        /// Print one JSON object instead, also when there is no such controller.
        #[arg(long)]
        json: bool,
        /// Put the paper's Theorems 1 and 2 exactly as printed to the margin problem instead:
        /// their best margins, and why they have no strictly feasible point.
        #[arg(long)]
        as_printed: bool,
        /// Also keep the solved design in a file, for export and simulate with --solved.
        #[arg(long, value_name = "FILE", conflicts_with = "as_printed")]
        save: Option<PathBuf>,
    },
    /// Prove again, from the numbers in an FMU alone, what it promises. Nothing is solved.
    ///
    /// Checks that description, design and certificate belong together and that the gains which
    /// run are those that were proved, then proves every inequality with rounding accounted for:
    /// stability under arbitrary switching or beyond a dwell time, decay, and gamma per mode.
    /// Of the binaries it checks that there is one, and of each the platform and the functions it
    /// offers. A controller's binary for this machine is run, in a process of its own, for some hundred
    /// ticks of random signals, and must give to the bit what this program's controller gives; what its
    /// machine code does beyond them is not proved. With --no-run no code of the FMU is executed.
    #[command(after_help = EXIT_CODES)]
    Verify {
        /// FMU that ftc-fmu export wrote.
        fmu: PathBuf,
        /// Print one JSON object instead, also when the proof fails.
        #[arg(long)]
        json: bool,
        /// Require that the owner of this key has signed the FMU: a public key file of minisign.
        #[arg(long, value_name = "PUB")]
        key: Option<PathBuf>,
        /// Do not run the binary: no code of the FMU is executed.
        #[arg(long)]
        no_run: bool,
    },
    /// Runs the binary of a controller FMU beside this program's controller; prints what came of it.
    #[command(hide = true)]
    RunBinary {
        /// FMU that ftc-fmu export wrote.
        fmu: PathBuf,
    },
    /// Write NAME_controller.fmu and NAME_plant.fmu (FMI 2.0, co-simulation).
    ///
    /// The two close the loop: connect y, y_ref and mode from the plant to the controller, and u
    /// back; step the controller first. The same design always gives the same bytes.
    #[command(after_help = EXIT_CODES)]
    Export {
        /// Design file (TOML).
        design: PathBuf,
        /// Directory to write to; made if it does not exist.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Take the design that ftc-fmu design --save has solved, if it is that of this design file,
        /// and prove it again instead of solving it again.
        #[arg(long, value_name = "FILE")]
        solved: Option<PathBuf>,
        /// Also write NAME.ssp: both FMUs and their connections in one file (SSP 1.0).
        #[arg(long)]
        ssp: bool,
        /// Sign the FMUs with a secret key of minisign (minisign -G); its password is asked for on the
        /// terminal, or taken from the environment variable FTC_FMU_KEY_PASSWORD.
        #[arg(long, value_name = "KEY")]
        sign: Option<PathBuf>,
    },
    /// Run the design's scenario without any FMU: trajectories.csv, metrics.json, report.html and figures.
    ///
    /// Runs it three times: with fault tolerance (ftc), with the same gains without fault
    /// compensation (no_ftc), and with the same gains told the true fault (told_the_fault): an estimate
    /// that is perfect, yet takes up no disturbance and no noise.
    #[command(after_help = EXIT_CODES)]
    Simulate {
        /// Design file (TOML).
        design: PathBuf,
        /// Directory to write to; made if it does not exist.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Take the design that ftc-fmu design --save has solved, if it is that of this design file,
        /// and prove it again instead of solving it again.
        #[arg(long, value_name = "FILE")]
        solved: Option<PathBuf>,
        /// Run two more: the paper's additive fault-tolerant control with gains that only decay
        /// (additive) and model predictive control without fault estimation (mpc); and give the
        /// error of a response as late as the plant needs and no later (deadbeat_bound).
        #[arg(long)]
        baselines: bool,
    },
    /// Run thousands of seeded random scenarios and say how good fault tolerance is over all of them.
    ///
    /// Each run draws faults (kind, sensor, size, time), a schedule of modes, references, a
    /// disturbance, noise and an error of the model, and is done with fault tolerance, without, and
    /// told the fault. campaign.html shows distributions, campaign.json holds the counts; shards
    /// merge to the last digit. An interrupt (Ctrl-C) keeps the runs that are done.
    #[command(after_help = EXIT_CODES)]
    Campaign(campaigns::Arguments),
    /// Identify a plant from logs of healthy operation and write a design file for it.
    ///
    /// One linear model per mode, by subspace identification; the order is chosen by the fit of a free
    /// simulation, and the fit on data held out is printed. Where the log holds switches between
    /// modes, the models share one state.
    #[command(after_help = EXIT_CODES)]
    Identify(identification::Arguments),
    /// Write an example to start from: a design file, or a Python script from physics to FMUs.
    ///
    /// Without a name the examples are listed.
    #[command(after_help = EXIT_CODES)]
    Example {
        /// Which example.
        name: Option<String>,
        /// Directory to write to; made if it does not exist.
        #[arg(long, value_name = "DIR", default_value = ".")]
        out: PathBuf,
    },
    /// Run the paper's experiments and write one page each, with the same numbers as JSON and CSV.
    ///
    /// paper: its example in every variant, what it says beside what is found, and its figures.
    /// converter: the AC/DC converter under every kind of sensor fault, against model predictive
    /// control.
    #[command(after_help = EXIT_CODES)]
    Reproduce {
        /// Which experiment.
        experiment: Experiment,
        /// Directory to write to; made if it does not exist.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

/// Which solver finds the gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SolverChoice {
    /// The interior-point method that uses the structure of the inequalities.
    Structured,
    /// Clarabel alone: slower, for comparison.
    Clarabel,
}

impl From<SolverChoice> for Solver {
    fn from(choice: SolverChoice) -> Self {
        match choice {
            SolverChoice::Structured => Self::Structured,
            SolverChoice::Clarabel => Self::General,
        }
    }
}

/// Samples between two words about how far a simulation has come.
const BETWEEN_WORDS: u64 = 10_000;

/// Exit code: done.
const DONE: u8 = 0;
/// Exit code: no such controller, or a promise that does not hold.
const NO_SUCH: u8 = 1;
/// Exit code: the command line, a file or an output is at fault.
const INPUT: u8 = 2;

/// What can be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Experiment {
    /// Section VII-A: the switched example, in every variant.
    Paper,
    /// Section VII-B: the AC/DC converter, against model predictive control.
    Converter,
}

/// Runs the program with its arguments (the first is its name) and returns its exit code.
///
/// FMU binaries are sought in `binaries`, by default beside the running program.
/// `itself` is the command that starts this program once more, by default the running one.
pub fn main(
    arguments: Vec<OsString>,
    binaries: Option<PathBuf>,
    itself: Option<Vec<OsString>>,
) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            use clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand as Bare;
            if error.use_stderr() && error.kind() != Bare {
                eprintln!("{}", one_line(&error.render().to_string()));
                return INPUT;
            }
            // Help and version are no errors; to whom they go, clap knows.
            let printed = error.print();
            return match (error.exit_code(), printed) {
                (0, Err(error)) => unprinted(error),
                (code, _) => u8::try_from(code).unwrap_or(INPUT),
            };
        }
    };
    interrupt::listen();
    match run(&arguments, binaries, itself) {
        Ok(_) if arguments.quiet => DONE,
        Ok(text) => print(&text).map_or_else(unprinted, |()| DONE),
        Err(failure) => {
            let printed = failure.output().map_or(Ok(()), print);
            eprintln!("error: {failure}");
            printed.map_or_else(unprinted, |()| failure.exit_code())
        }
    }
}

/// Runs the command and returns what to print.
fn run(
    arguments: &Arguments,
    binaries: Option<PathBuf>,
    itself: Option<Vec<OsString>>,
) -> Result<String, Failure> {
    let progress = Progress::new(arguments.quiet);
    let asked = |solved, save| How {
        solver: arguments.solver.into(),
        threads: arguments.threads.into(),
        simulated: None,
        solved,
        save,
    };
    match &arguments.command {
        Command::Design {
            design,
            json,
            as_printed: true,
            ..
        } => {
            let request = read(design, &progress)?.request;
            progress.tell("looking for a margin");
            theorems_as_printed(design, &request, *json)
        }
        Command::Design {
            design, json, save, ..
        } => match (
            solve(design, &asked(None, save.as_deref()), &progress),
            json,
        ) {
            (Ok(made), false) => Ok(summary::text(&made.design, &made.warnings)),
            (Ok(made), true) => Ok(summary::json(&made.design, &made.warnings)),
            (Err(failure), false) => Err(failure),
            (Err(failure), true) => Err(failure.explained_in_json()),
        },
        Command::Verify {
            fmu,
            json,
            key,
            no_run,
        } => {
            let running = || std::env::current_exe().ok().map(|path| vec![path.into()]);
            let this = itself.or_else(running).filter(|_| !no_run);
            verify(fmu, *json, key.as_deref(), this)
        }
        Command::RunBinary { fmu } => {
            let ran = package::binary::compare(fmu)?;
            Ok(serde_json::to_string(&ran).unwrap_or_default() + "\n")
        }
        Command::Export {
            design,
            out,
            ssp,
            solved,
            sign,
        } => {
            check_output(out)?;
            if let Some(key) = sign {
                SigningKey::check(key)?;
            }
            let made = solve(design, &asked(solved.as_deref(), None), &progress)?;
            export(&made, out, *ssp, binaries, sign.as_deref())
        }
        Command::Simulate {
            design,
            out,
            baselines,
            solved,
        } => {
            check_output(out)?;
            let how = How {
                simulated: Some(*baselines),
                ..asked(solved.as_deref(), None)
            };
            let made = solve(design, &how, &progress)?;
            simulate(made, design, out, *baselines, &progress)
        }
        Command::Campaign(campaign) => {
            let earlier = campaign.begin()?;
            let made = solve(campaign.design(), &asked(None, None), &progress)?;
            campaigns::run(made, campaign, earlier, progress, arguments.quiet)
        }
        Command::Identify(asked) => {
            let (folder, name) = asked.target();
            check_output(&folder)?;
            progress.tell("identifying");
            let (text, found) = identification::identify(asked)?;
            output::write(&folder, &[(name.clone(), text.into_bytes())])?;
            Ok(format!("{found}wrote {}\n", folder.join(name).display()))
        }
        Command::Example { name: None, .. } => Ok(examples::list()),
        Command::Example {
            name: Some(name),
            out,
        } => {
            let files = examples::files(name).map_err(|error| Failure::Input(error.to_string()))?;
            output::write(out, &files)?;
            let paths = files
                .iter()
                .map(|(file, _)| format!("wrote {}\n", out.join(file).display()));
            Ok(paths.collect())
        }
        Command::Reproduce { experiment, out } => {
            check_output(out)?;
            reproduce(*experiment, out, &progress)
        }
    }
}

/// The paper's Theorems 1 and 2 as they stand.
fn theorems_as_printed(path: &Path, request: &Request, json: bool) -> Result<String, Failure> {
    let solve = || {
        Ok([
            ("Theorem 1", theorem_1(&request.plant)?),
            ("Theorem 2", theorem_2(&request.plant, &request.control)?),
        ])
    };
    let verdicts = solve().map_err(|error: ftc_design::DesignError| {
        Failure::new(path, request.control.clone(), error.into(), None)
    })?;
    let output = match json {
        true => as_printed::json(&verdicts),
        false => as_printed::text(&request.name, &verdicts),
    };
    match as_printed::infeasible(&verdicts) {
        None => Ok(output),
        Some(what) => Err(Failure::Refused {
            file: path.display().to_string(),
            what: format!("{what}: design without --as-printed"),
            output: Some(output),
        }),
    }
}

/// Proves again what an FMU promises.
fn verify(
    fmu: &Path,
    as_json: bool,
    key: Option<&Path>,
    this: Option<Vec<OsString>>,
) -> Result<String, Failure> {
    let checks = package::Checks {
        key: key
            .map(package::signature::VerifyingKey::read)
            .transpose()?,
        runner: this.map(|mut command| {
            command.push("run-binary".into());
            package::binary::Runner(command)
        }),
    };
    match package::verify_with(fmu, &checks) {
        Ok(verification) if as_json => Ok(summary::pretty(&verification.json())),
        Ok(verification) => Ok(verification.to_string()),
        Err(package::Error::Unproved { fmu, what }) => Err(Failure::Refused {
            output: as_json.then(|| summary::pretty(&json!({ "verified": false, "reason": what }))),
            file: fmu.display().to_string(),
            what,
        }),
        Err(error) => Err(error.into()),
    }
}

/// Writes both FMUs and says for which platforms.
fn export(
    made: &Made,
    out: &Path,
    ssp: bool,
    binaries: Option<PathBuf>,
    sign: Option<&Path>,
) -> Result<String, Failure> {
    let options = package::Options {
        out: out.to_path_buf(),
        binaries: binaries.map_or_else(beside_program, Ok)?,
        ssp,
        platforms: None,
        sign: sign.map(Path::to_path_buf),
    };
    let exported = package::export(&made.design, &options)?;
    let mut text = exported.to_string();
    let misfit: Vec<String> = exported.misfit.iter().map(ToString::to_string).collect();
    text += &warnings::text(&misfit);
    Ok(text + &warnings::text(&made.warnings))
}

/// The directory of this program, where cargo leaves the FMU binaries as well.
fn beside_program() -> Result<PathBuf, Failure> {
    let program = std::env::current_exe().ok();
    program
        .and_then(|program| program.parent().map(Path::to_path_buf))
        .ok_or_else(|| {
            Failure::Input(
                "cannot find the directory of this program: start it by its full path".into(),
            )
        })
}

/// Simulates a design and writes what was found.
fn simulate(
    made: Made,
    file: &Path,
    out: &Path,
    baselines: bool,
    progress: &Progress,
) -> Result<String, Failure> {
    progress.tell("simulating");
    let steps = made.design.scenario.steps;
    let told = |done: u64| {
        if done.is_multiple_of(BETWEEN_WORDS) {
            progress.tell(match done == steps {
                true => "simulating plants that are not quite the model".into(),
                false => format!("simulating, {} % of {steps} samples", 100 * done / steps),
            });
        }
    };
    let found = simulate_into(out, &made.design, made.warnings, baselines, &told);
    let found = found.map_err(|error| match error {
        SimulateError::Output(error) => error.into(),
        error => Failure::Input(format!("{}: {error}", file.display())),
    })?;
    let mut text = found.summary;
    let _ = writeln!(
        text,
        "wrote {}, trajectories.csv, metrics.json and the figures",
        out.join("report.html").display()
    );
    Ok(text + &warnings::text(&found.warnings))
}

/// Runs an experiment of the paper and writes its page.
fn reproduce(experiment: Experiment, out: &Path, progress: &Progress) -> Result<String, Failure> {
    let experiment = match experiment {
        Experiment::Paper => reproduce::Experiment::Paper,
        Experiment::Converter => reproduce::Experiment::Converter,
    };
    let found = reproduce::run(experiment, &|what| progress.tell(what))
        .map_err(|error| Failure::Input(error.to_string()))?;
    output::write(out, &found.files)?;
    let name = found.name;
    Ok(format!(
        "{}\nwrote {}, {name}.json and {name}.csv\n",
        found.summary,
        out.join(format!("{name}.html")).display()
    ))
}

/// Refuses an output directory that cannot be written to, before anything long is begun.
fn check_output(out: &Path) -> Result<(), Failure> {
    Ok(Staging::new(out).map(drop)?)
}

/// Reads a design file.
fn read(path: &Path, progress: &Progress) -> Result<Loaded, Failure> {
    progress.tell("reading the design file");
    design_file::read(path).map_err(|error| Failure::Input(error.to_string()))
}

/// How a design comes about.
struct How<'a> {
    solver: Solver,
    /// How many independent parts are worked on at the same time.
    threads: usize,
    /// Whether its scenario is simulated, and then whether with the baselines.
    simulated: Option<bool>,
    /// A file that holds it already.
    solved: Option<&'a Path>,
    /// Where to keep it.
    save: Option<&'a Path>,
}

/// Reads a design file and makes the design, or takes it from where it was kept.
fn solve(path: &Path, how: &How, progress: &Progress) -> Result<Made, Failure> {
    let unsaved = |file: &Path, error: solved::SaveError| {
        Failure::Input(format!("--save {}: {error}", file.display()))
    };
    if let Some(file) = how.save {
        solved::check_place(file).map_err(|error| unsaved(file, error))?;
    }
    let (request, source) = Source::split(read(path, progress)?);
    announce(path, &request, how, progress)?;
    let asked = request.control.clone();
    let key = solved::key(&request, how.solver);
    let design = match how.solved {
        Some(file) => {
            progress.tell("proving again what was solved");
            kept(file, &key)?
        }
        None => {
            let work = || synthesised(request, how.solver, progress);
            let made = match how.threads {
                1 => work(),
                threads => pool("--threads", threads)?.install(work),
            };
            made.map_err(|error| {
                eprint!("{}", warnings::text(&source.notes));
                Failure::new(path, asked, error, source.logs())
            })?
        }
    };
    if let Some(file) = how.save {
        solved::save(file, key, &design).map_err(|error| unsaved(file, error))?;
    }
    Ok(source.made(design))
}

/// Says what will take long or much, and refuses what no usual machine has.
fn announce(
    file: &Path,
    request: &Request,
    how: &How<'_>,
    progress: &Progress,
) -> Result<(), Failure> {
    let design = match how.solved {
        None => estimate::design(request, how.threads),
        Some(_) => None,
    };
    let mut simulation = None;
    if let Some(baselines) = how.simulated {
        let (size, tracked) = (request.plant.dimensions(), request.control.tracked.len());
        let extent = Extent::new(size, tracked, request.scenario.steps, baselines);
        extent
            .check()
            .map_err(|error| Failure::Input(format!("{}: {error}", file.display())))?;
        simulation = estimate::simulation(&extent);
    }
    for words in design.iter().chain(&simulation) {
        progress.announce(words);
    }
    Ok(())
}

/// The design that an earlier call kept.
fn kept(file: &Path, key: &str) -> Result<Design, Failure> {
    solved::load(file, key).map_err(|error| {
        let again = match error {
            LoadError::Unusable(_) => ": make it again with ftc-fmu design --save",
            _ => "",
        };
        Failure::Input(format!("--solved {}: {error}{again}", file.display()))
    })
}

/// So many threads, which an option asked for; 0: as many as the machine has.
fn pool(option: &str, threads: usize) -> Result<rayon::ThreadPool, Failure> {
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    built.map_err(|error| Failure::Input(format!("{option}: no threads ({error}): give fewer")))
}

/// Solves for a design and says how far it has come.
fn synthesised(
    request: Request,
    solver: Solver,
    progress: &Progress,
) -> Result<Design, ftc_design::Failure> {
    progress.tell("solving for gains and certifying them");
    let watch = |step: Step| match step {
        Step::Iteration { number, usual, .. } => progress.iterate(step, number, usual),
        other => progress.tell(other.to_string()),
    };
    let mut run = Run::default();
    run.solver = solver;
    run.watch = &watch;
    ftc_design::assembly::assemble_with(request, &run)
}

/// Prints to standard output; a reader that has gone away is no error of ours.
fn print(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let result = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match result {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

/// What clap says of a command line that does not fit, in one line and without the usage.
fn one_line(said: &str) -> String {
    let ends = |line: &str| line.starts_with("Usage:") || line.starts_with("For more information");
    let mut sentence = String::new();
    for line in said.lines().map(str::trim).take_while(|line| !ends(line)) {
        let joined = match line {
            "" => continue,
            _ if sentence.is_empty() => "",
            tip if tip.starts_with("tip:") => "; ",
            _ if sentence.ends_with(':') || line.starts_with('[') => " ",
            _ => ", ",
        };
        sentence = sentence + joined + line;
    }
    sentence + "; see --help"
}

/// What the reader of standard output asked for is lost.
fn unprinted(error: std::io::Error) -> u8 {
    eprintln!("error: standard output cannot be written to ({error}): send it elsewhere");
    INPUT
}
