//! Messages to the importer.

use crate::types::{LoggerCallback, Pointer, Status};
use model_description::LOG_CATEGORIES;
use std::ffi::{CStr, CString};
use std::sync::Arc;

/// Position of `logAll`, which stands for every category.
const ALL: usize = LOG_CATEGORIES.len() - 1;

/// The importer's logger, and the categories it asked for.
///
/// Warnings, refusals and errors are always handed over: `loggingOn` and the categories switch
/// events alone. Many importers leave logging off and would else show a status without its
/// sentence. The text handed over is finished: it holds no `%`, which the importer's `printf`
/// would interpret, and `#`, the standard's mark for value references, is doubled.
///
/// A copy is cheap and allocates nothing: the importer may call the FMU from its logger, so
/// messages are handed over when nothing of the instance is borrowed.
#[derive(Clone, Debug)]
pub struct Logger {
    callback: Option<LoggerCallback>,
    environment: Pointer,
    instance_name: Arc<CStr>,
    enabled: [bool; LOG_CATEGORIES.len()],
}

/// A log category that the FMU does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no log category {0}")]
pub struct UnknownCategory(pub String);

impl Logger {
    /// A logger for an instance of this name; `callback` may be absent.
    pub fn new(
        callback: Option<LoggerCallback>,
        environment: Pointer,
        instance_name: &CStr,
        on: bool,
    ) -> Self {
        Self {
            callback,
            environment,
            instance_name: instance_name.into(),
            enabled: [on; LOG_CATEGORIES.len()],
        }
    }

    /// Switches the named categories, or all if none is named.
    ///
    /// # Errors
    /// An unknown category; then nothing is switched.
    pub fn switch(&mut self, on: bool, categories: &[&CStr]) -> Result<(), UnknownCategory> {
        let known = |name: &&CStr| {
            LOG_CATEGORIES
                .iter()
                .position(|(category, _)| name.to_bytes() == category.as_bytes())
                .ok_or_else(|| UnknownCategory(name.to_string_lossy().into_owned()))
        };
        let chosen: Vec<usize> = categories.iter().map(known).collect::<Result<_, _>>()?;
        let all = chosen.is_empty() || chosen.contains(&ALL);
        for (at, enabled) in self.enabled.iter_mut().enumerate() {
            if all || chosen.contains(&at) {
                *enabled = on;
            }
        }
        Ok(())
    }

    /// Whether a message of this status would be heard.
    pub fn hears(&self, status: Status) -> bool {
        let switched = || self.enabled.get(category(status)).is_some_and(|on| *on);
        self.callback.is_some() && (status != Status::Ok || switched())
    }

    /// Hands over a message if it is to be heard.
    pub fn log(&self, status: Status, message: &str) {
        if !self.hears(status) {
            return;
        }
        let Some(callback) = self.callback else {
            return;
        };
        let (name, _) = LOG_CATEGORIES[category(status)];
        let (category, text) = (finished(name), finished(message));
        // SAFETY: the importer promises a logger with the standard's signature that lives as
        // long as the instance; all strings live until it returns.
        unsafe {
            callback(
                self.environment,
                self.instance_name.as_ptr(),
                status,
                category.as_ptr(),
                text.as_ptr(),
            );
        }
    }
}

/// Position of the category to which messages of a status belong.
fn category(status: Status) -> usize {
    match status {
        Status::Ok | Status::Pending => 0,
        Status::Warning => 1,
        Status::Discard => 2,
        Status::Error => 3,
        Status::Fatal => 4,
    }
}

/// A C string that `printf` prints as it is.
fn finished(message: &str) -> CString {
    let text: String = message
        .chars()
        .filter(|c| *c != '\0')
        .map(|c| if c == '%' { '\u{ff05}' } else { c })
        .collect();
    CString::new(text.replace('#', "##")).unwrap_or_default()
}
