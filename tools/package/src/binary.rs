//! Whether the binary of an FMU does what the equations say: it is loaded as any importer loads it
//! and run beside this program's own controller, from the same design and signals.

use crate::Error;
use crate::platform::HOST;
use crate::verify::{Fmu, Refusal};
use fmu_abi::Values;
use fmu_abi::types::{
    Boolean, CO_SIMULATION, CallbackFunctions, Choice, Integer, Pointer, Real, Text, ValueReference,
};
use ftc_control::{Compensate, Controller};
use ftc_design::Design;
use libloading::{Library, Symbol};
use model_description::{CONTROLLER, Interface, Role, Span, VariableTable};
use serde::{Deserialize, Serialize};
use std::ffi::{CString, OsString};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::ptr::null_mut;
use std::time::{Duration, Instant};

/// Ticks for which both run.
const TICKS: u64 = 300;

/// Ticks for which a mode lasts.
const MODE_LASTS: u64 = 40;

/// A binary that has not come to its end after this time never will.
const LONGEST: Duration = Duration::from_secs(120);

/// What came of running a binary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Ran {
    /// Its outputs were those of this program's controller, bit by bit, for so many ticks.
    Agrees(u64),
    /// It was not run, and why.
    NotRun(String),
    /// Its outputs were others.
    Differs(String),
}

/// The command that calls [`compare`] in a process of its own, so that a binary that crashes or hangs
/// takes nothing with it. The FMU's path is appended, and what is printed is [`Ran`] as JSON.
#[derive(Clone, Debug)]
#[expect(clippy::exhaustive_structs, reason = "a command")]
pub struct Runner(pub Vec<OsString>);

impl Runner {
    /// # Errors
    /// The command cannot be started, or the binary brought it down.
    pub(crate) fn run(&self, fmu: &Path) -> Result<Ran, Refusal> {
        self.run_within(fmu, LONGEST)
    }

    /// The same, given so much time.
    fn run_within(&self, fmu: &Path, longest: Duration) -> Result<Ran, Refusal> {
        let [program, arguments @ ..] = self.0.as_slice() else {
            return Ok(Ran::NotRun("no program is named to run it".into()));
        };
        let child = Command::new(program)
            .args(arguments)
            .arg(fmu)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut child = match child {
            Ok(child) => child,
            Err(error) => {
                return Ok(Ran::NotRun(format!(
                    "no process could be started ({error})"
                )));
            }
        };
        let begin = Instant::now();
        while matches!(child.try_wait(), Ok(None)) {
            if begin.elapsed() > longest {
                let _ = child.kill();
                let _ = child.wait();
                return Err(Refusal::Unproved(format!(
                    "the binary for {HOST} has not come to its end after {} s: export it again",
                    longest.as_secs_f64()
                )));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let done = child.wait_with_output();
        let said = done.as_ref().ok().and_then(|done| {
            let last = done
                .stdout
                .split(|&byte| byte == b'\n')
                .rfind(|line| !line.is_empty())?;
            serde_json::from_slice(last).ok()
        });
        said.ok_or_else(|| {
            let how = match &done {
                Ok(done) => done.status.to_string(),
                Err(error) => error.to_string(),
            };
            Refusal::Unproved(format!(
                "the binary for {HOST} does not run to its end ({how}): export it again"
            ))
        })
    }
}

/// Runs the binary of a controller FMU for this machine beside the program's own controller.
///
/// The binary's code runs in this process: call it in one of its own.
///
/// # Errors
/// As [`verify`](crate::verify()).
pub fn compare(fmu: &Path) -> Result<Ran, Error> {
    let ran = Fmu::open(fmu).and_then(|opened| {
        let (kind, design) = opened.design()?;
        if kind.binary != CONTROLLER {
            return Ok(Ran::NotRun(
                "the plant's binary takes no part in what is proved".into(),
            ));
        }
        let path = opened.binary(&kind.identifier(&design));
        let Some(library) = path else {
            return Ok(Ran::NotRun(format!("there is none for {HOST} in it")));
        };
        run(library, opened.resource()?, &design)
            .map_err(|what| Refusal::Unreadable(format!("cannot be unpacked ({what}): make room")))
    });
    ran.map_err(|refusal| refusal.of(fmu))
}

/// Unpacks a binary with its resource, loads and runs it.
fn run(library: &[u8], resource: &[u8], design: &Design) -> std::io::Result<Ran> {
    let folder = tempfile::tempdir()?;
    let path = folder
        .path()
        .join(format!("controller{}", std::env::consts::DLL_SUFFIX));
    fs::write(&path, library)?;
    fs::write(folder.path().join(model_description::DESIGN_FILE), resource)?;
    // SAFETY: whoever asks for this trusts the file as an importer does; the documentation says so.
    let library = match unsafe { Library::new(&path) } {
        Ok(library) => library,
        Err(error) => return Ok(Ran::NotRun(format!("it cannot be loaded here ({error})"))),
    };
    let guid = model_description::guid(CONTROLLER, resource);
    Ok(
        match Slave::start(&library, &guid, &location(folder.path())) {
            Err(what) => Ran::Differs(what),
            Ok(slave) => match beside(&slave, design) {
                Ok(()) => Ran::Agrees(TICKS),
                Err(what) => Ran::Differs(what),
            },
        },
    )
}

/// A folder as a URI.
fn location(folder: &Path) -> String {
    let path = folder.display().to_string().replace('\\', "/");
    let rooted = if path.starts_with('/') { "" } else { "/" };
    format!("file://{rooted}{path}")
}

/// `fmi2OK`. What a binary returns is read as a plain number: any may come.
const OK: Integer = 0;

/// The functions that are called, by their types of the standard.
type Set<T> = unsafe extern "C" fn(Pointer, *const ValueReference, usize, *const T) -> Integer;
type Get<T> = unsafe extern "C" fn(Pointer, *const ValueReference, usize, *mut T) -> Integer;
type Instantiate = unsafe extern "C" fn(
    Text,
    Choice,
    Text,
    Text,
    *const CallbackFunctions,
    Boolean,
    Boolean,
) -> Pointer;
type Setup = unsafe extern "C" fn(Pointer, Boolean, Real, Real, Boolean, Real) -> Integer;
type Plain = unsafe extern "C" fn(Pointer) -> Integer;
type Free = unsafe extern "C" fn(Pointer);
type Step = unsafe extern "C" fn(Pointer, Real, Real, Boolean) -> Integer;

/// An instance of a loaded binary.
struct Slave<'a> {
    library: &'a Library,
    instance: Pointer,
}

impl<'a> Slave<'a> {
    fn start(library: &'a Library, guid: &str, location: &str) -> Result<Self, String> {
        let text = |text: &str| CString::new(text).map_err(|_| "a name holds a zero".to_owned());
        let (guid, location) = (text(guid)?, text(location)?);
        let callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: null_mut(),
        };
        // SAFETY: the type is the standard's; texts and callbacks outlive the call.
        let instance = unsafe {
            let instantiate = symbol::<Instantiate>(library, "fmi2Instantiate")?;
            instantiate(
                c"verified".as_ptr(),
                CO_SIMULATION,
                guid.as_ptr(),
                location.as_ptr(),
                &callbacks,
                0,
                0,
            )
        };
        match instance.is_null() {
            true => Err("makes no instance of its own design".into()),
            false => Ok(Self { library, instance }),
        }
    }

    /// Calls a function and holds its status against `fmi2OK`.
    fn call<T: Copy>(
        &self,
        name: &str,
        call: impl FnOnce(T, Pointer) -> Integer,
    ) -> Result<(), String> {
        // SAFETY: callers name a function of the standard with its own type.
        let function = unsafe { *symbol::<T>(self.library, name)? };
        match call(function, self.instance) {
            OK => Ok(()),
            status => Err(format!("answers {name} with status {status}")),
        }
    }

    fn set_reals(&self, span: Span, values: &[f64]) -> Result<(), String> {
        let references: Vec<u32> = (span.first..).take(values.len()).collect();
        self.call("fmi2SetReal", |set: Set<Real>, instance| {
            // SAFETY: both lists have this length.
            unsafe {
                set(
                    instance,
                    references.as_ptr(),
                    references.len(),
                    values.as_ptr(),
                )
            }
        })
    }

    fn set_integer(&self, span: Span, value: Integer) -> Result<(), String> {
        self.call("fmi2SetInteger", |set: Set<Integer>, instance| {
            // SAFETY: one reference, one value.
            unsafe { set(instance, &span.first, 1, &value) }
        })
    }

    fn reals(&self, span: Span) -> Result<Vec<f64>, String> {
        let references: Vec<u32> = (span.first..).take(span.len as usize).collect();
        let mut values = vec![0.0; references.len()];
        self.call("fmi2GetReal", |get: Get<Real>, instance| {
            // SAFETY: both lists have this length.
            unsafe {
                get(
                    instance,
                    references.as_ptr(),
                    references.len(),
                    values.as_mut_ptr(),
                )
            }
        })?;
        Ok(values)
    }

    fn plain(&self, name: &str) -> Result<(), String> {
        // SAFETY: the instance lives.
        self.call(name, |function: Plain, instance| unsafe {
            function(instance)
        })
    }

    fn setup(&self) -> Result<(), String> {
        self.call("fmi2SetupExperiment", |setup: Setup, instance| {
            // SAFETY: the instance lives.
            unsafe { setup(instance, 0, 0.0, 0.0, 0, 0.0) }
        })
    }

    fn step(&self, from: f64, length: f64) -> Result<(), String> {
        self.call("fmi2DoStep", |step: Step, instance| {
            // SAFETY: the instance lives.
            unsafe { step(instance, from, length, 1) }
        })
    }
}

impl Drop for Slave<'_> {
    fn drop(&mut self) {
        // SAFETY: the instance lives, and never again.
        if let Ok(free) = unsafe { symbol::<Free>(self.library, "fmi2FreeInstance") } {
            unsafe { free(self.instance) };
        }
    }
}

/// # Safety
/// `T` must be the type of the function of this name.
unsafe fn symbol<'a, T>(library: &'a Library, name: &str) -> Result<Symbol<'a, T>, String> {
    // SAFETY: by contract.
    let found = unsafe { library.get(name.as_bytes()) };
    found.map_err(|_| format!("offers no function {name}"))
}

/// Signals that stay the same from run to run: xorshift.
struct Signals(u64);

impl Signals {
    /// A number between -1 and 1.
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Runs an instance beside the controller it must be; the first difference is the error.
fn beside(slave: &Slave, design: &Design) -> Result<(), String> {
    let table: VariableTable = model_description::controller(&Interface::of(design));
    let start = Values::start(&table);
    let controller = Controller::new(design.parameters()).map_err(|error| error.to_string())?;
    let [measurement, reference, mode_span] =
        [Role::Measurement, Role::Reference, Role::Mode].map(|role| table.span(role));
    let outputs = [
        ("u", Role::Command),
        ("x_hat", Role::StateEstimate),
        ("f_hat", Role::FaultEstimate),
        ("residual", Role::Residual),
    ]
    .map(|(name, role)| (name, table.span(role)));
    let thresholds = start.get(table.span(Role::Threshold));
    let compensate = match start.flag(table.span(Role::FtcEnabled)) {
        true => Compensate::Estimate,
        false => Compensate::Nothing,
    };
    let tracked = &design.parameters().feedback.tracked;
    let mut random = Signals(0x9E37_79B9_7F4A_7C15);
    let mut state = controller.initial_state(0);
    let sample_time = design.plant.sample_time;
    slave.setup()?;
    slave.plain("fmi2EnterInitializationMode")?;
    let modes = design.plant.modes.len() as u64;
    for tick in 0..TICKS {
        let mode = (tick / MODE_LASTS % modes) as usize;
        let point = &design.plant.modes[mode].operating_point.y;
        // Small at first, so that nothing is flagged; then as far as faults go.
        let share = if tick < TICKS / 2 { 0.01 } else { 1.0 };
        let mut around =
            |k: usize| point[k] + share * design.signals.outputs[k].nominal * random.next();
        let y: Vec<f64> = (0..point.len()).map(&mut around).collect();
        let wanted: Vec<f64> = tracked.iter().map(|&k| around(k)).collect();
        slave.set_reals(measurement, &y)?;
        slave.set_reals(reference, &wanted)?;
        if !controller.finds_the_mode() {
            slave.set_integer(mode_span, mode as Integer + 1)?;
        }
        if tick == 0 {
            slave.plain("fmi2ExitInitializationMode")?;
        }
        let from = tick as f64 * sample_time;
        slave.step(from, (tick + 1) as f64 * sample_time - from)?;
        let sample = controller
            .sample(tick, mode, &y, &wanted)
            .and_then(|sample| sample.with_thresholds(thresholds))
            .and_then(|sample| sample.compensating(compensate))
            .map_err(|error| error.to_string())?;
        controller.tick(&mut state, &sample);
        let expected = [
            &state.command,
            &state.observer.estimate,
            &state.estimator.fault,
            &state.estimator.residual,
        ];
        for ((name, span), expected) in outputs.iter().zip(expected) {
            let found = slave.reals(*span)?;
            let pairs = found.iter().zip(expected.iter()).enumerate();
            for (at, (found, expected)) in pairs {
                if found.to_bits() != expected.to_bits() {
                    return Err(format!(
                        "gives {name}[{}] = {found} at tick {tick} of random signals where this program's controller gives {expected}",
                        at + 1
                    ));
                }
            }
        }
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn run(script: &str) -> (Result<Ran, Refusal>, Duration) {
        let command = ["sh", "-c", script].map(OsString::from);
        let begin = Instant::now();
        let longest = Duration::from_millis(500);
        let ran = Runner(command.to_vec()).run_within(Path::new("x.fmu"), longest);
        (ran, begin.elapsed())
    }

    fn refusal(ran: Result<Ran, Refusal>) -> String {
        match ran {
            Err(Refusal::Unproved(what)) => what,
            _ => panic!("accepted, or refused for another reason"),
        }
    }

    #[test]
    fn a_binary_that_hangs_is_stopped() {
        let (ran, took) = run("exec sleep 600");
        assert!(took < Duration::from_secs(60), "{took:?}");
        let said = refusal(ran);
        assert!(
            said.contains("has not come to its end after 0.5 s"),
            "{said}"
        );
    }

    #[test]
    fn a_binary_that_crashes_is_told_from_one_that_answers() {
        let said = refusal(run("kill -SEGV $$").0);
        assert!(
            said.contains("does not run to its end (signal: 11"),
            "{said}"
        );
        let (ran, _) = run(r#"echo '{"agrees": 300}'"#);
        assert!(ran.is_ok_and(|ran| ran == Ran::Agrees(300)));
    }
}
