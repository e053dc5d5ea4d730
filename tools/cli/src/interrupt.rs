//! SIGINT and SIGTERM: a campaign keeps what is done, anything else leaves the files as they were.

use campaign::Watch;
use std::sync::atomic::Ordering;
use std::sync::{Arc, OnceLock};

/// Exit code of a program that ended at an interrupt.
const INTERRUPTED: i32 = 130;

/// The campaign that is to stop at the first interrupt; the second ends it.
static CAMPAIGN: OnceLock<Arc<Watch>> = OnceLock::new();

/// Listens from now on. Where no handler can be set, an interrupt ends the program as it always does.
pub fn listen() {
    let _ = ctrlc::set_handler(|| {
        let stopped = CAMPAIGN
            .get()
            .map(|watch| watch.stop.swap(true, Ordering::Relaxed));
        if stopped != Some(false) {
            output::abandon();
            std::process::exit(INTERRUPTED);
        }
    });
}

/// Stops this campaign at the first interrupt.
pub fn stop(watch: &Arc<Watch>) {
    let _ = CAMPAIGN.set(Arc::clone(watch));
}
