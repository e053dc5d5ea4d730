//! What the program is doing, shown while it runs: a spinner on a terminal, elsewhere a line from
//! time to time.

use campaign::Watch;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Shows on standard error what is being done; silent once dropped.
pub struct Progress {
    bar: ProgressBar,
    lines: Option<Lines>,
    quiet: bool,
    /// When the first iteration of the current problem began.
    begun: Mutex<Option<Instant>>,
}

impl Progress {
    /// Starts showing, unless `quiet`.
    pub fn new(quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target = if quiet || !terminal {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(120));
        Self {
            bar,
            lines: (!quiet && !terminal).then(Lines::start),
            quiet,
            begun: Mutex::new(None),
        }
    }

    /// Says what is going on now.
    pub fn tell(&self, what: impl Into<String>) {
        let what = what.into();
        if let Some(lines) = &self.lines {
            lines.set(&what);
        }
        self.bar.set_message(what);
    }

    /// Says something at once, to be read later too.
    pub fn announce(&self, what: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("note: {what}"));
        }
    }

    /// Says how far iterations have come, with the time that the rest will take at this pace.
    pub fn iterate(&self, what: impl fmt::Display, number: usize, usual: usize) {
        let mut begun = self
            .begun
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        if number == 0 {
            *begun = None;
        }
        let start = *begun.get_or_insert_with(Instant::now);
        let each = start.elapsed().as_secs_f64() / number.max(1) as f64;
        let left = each * usual.saturating_sub(number) as f64;
        match number {
            0 => self.tell(what.to_string()),
            _ => self.tell(format!("{what}, about {left:.0} s left")),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A thread that prints the latest message from time to time.
struct Lines {
    latest: Arc<Mutex<String>>,
    /// Dropped to stop the thread.
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Lines {
    fn start() -> Self {
        let (stop, stopped) = mpsc::channel::<()>();
        let latest = Arc::new(Mutex::new(String::new()));
        let shown = Arc::clone(&latest);
        let begun = Instant::now();
        let print = move || {
            while stopped.recv_timeout(LINE_EVERY) == Err(RecvTimeoutError::Timeout) {
                let latest = shown
                    .lock()
                    .unwrap_or_else(|poisoned| poisoned.into_inner());
                eprintln!("{:.0} s: {latest}", begun.elapsed().as_secs_f64());
            }
        };
        Self {
            latest,
            stop: Some(stop),
            thread: Some(std::thread::spawn(print)),
        }
    }

    fn set(&self, what: &str) {
        let mut latest = self
            .latest
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        what.clone_into(&mut latest);
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// How many runs of a campaign are done: a bar with the time that remains on a terminal, a line from
/// time to time elsewhere. Ends when dropped.
pub struct Runs(Arc<AtomicBool>);

impl Runs {
    /// Shows how far `watch` has come of so many runs, unless `quiet`.
    pub fn show<'scope>(
        scope: &'scope std::thread::Scope<'scope, '_>,
        watch: Arc<Watch>,
        count: u64,
        quiet: bool,
    ) -> Self {
        let over = Arc::new(AtomicBool::new(quiet));
        let ends = Arc::clone(&over);
        scope.spawn(move || match std::io::stderr().is_terminal() {
            true => bar(&watch, count, &ends),
            false => lines(&watch, count, &ends),
        });
        Self(over)
    }
}

impl Drop for Runs {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn bar(watch: &Watch, count: u64, over: &AtomicBool) {
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

fn lines(watch: &Watch, count: u64, over: &AtomicBool) {
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
