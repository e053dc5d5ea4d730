//! Long work beside Python: the interpreter runs on, Ctrl-C is heard, progress is told.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// How often Ctrl-C is looked for.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// How often progress is told.
const BETWEEN_REPORTS: Duration = Duration::from_secs(1);
/// Stack of the worker: that of a main thread.
const STACK: usize = 8 << 20;

/// Does `work` on a thread of its own. Where Python is interrupted, or `listener` raises, this
/// returns at once and the work's result is thrown away when it comes.
///
/// # Errors
/// What interrupted the wait.
pub fn wait<T: Send + 'static>(
    py: Python<'_>,
    what: &dyn Fn() -> String,
    listener: Option<&Py<PyAny>>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (send, mut receive) = channel();
    let begun = Instant::now();
    let mut told = begun;
    tell(py, listener, &what(), begun)?;
    thread::Builder::new()
        .stack_size(STACK)
        .spawn(move || send.send(work()).ok())
        .map_err(|error| PyRuntimeError::new_err(format!("no thread can be started: {error}")))?;
    loop {
        let came;
        (receive, came) = py.detach(move || {
            let came = receive.recv_timeout(POLL_INTERVAL);
            (receive, came)
        });
        match came {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(format!(
                    "{} ended with a panic, which is a bug: report it",
                    what()
                )));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        py.check_signals()?;
        if told.elapsed() >= BETWEEN_REPORTS {
            told = Instant::now();
            tell(py, listener, &what(), begun)?;
        }
    }
}

fn tell(py: Python<'_>, listener: Option<&Py<PyAny>>, what: &str, begun: Instant) -> PyResult<()> {
    match listener {
        Some(listener) => listener
            .call1(py, (what, begun.elapsed().as_secs_f64()))
            .map(drop),
        None => Ok(()),
    }
}
