//! A sign of life on the terminal.

use indicatif::{ProgressBar, ProgressDrawTarget};
use std::time::Duration;

/// A spinner on standard error, drawn only on a terminal; gone when dropped.
pub struct Progress(ProgressBar);

impl Progress {
    /// Starts the spinner, unless `quiet`.
    pub fn new(quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(120));
        Self(bar)
    }

    /// Says what is going on now.
    pub fn tell(&self, what: &'static str) {
        self.0.set_message(what);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
