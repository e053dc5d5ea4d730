//! What a command will take, said before it begins.

use crate::How;
use crate::failure::Failure;
use crate::progress::Progress;
use ftc_design::assembly::Request;
use ftc_design::work::Work;
use report::simulate::Extent;
use std::path::Path;

/// Seconds from which work is said to take long.
const LONG: f64 = 10.0;
/// Bytes of memory or of a file that are worth a word.
const LARGE: f64 = 5e8;

/// Seconds that a sample of a run takes: roughly, for a plant of few states on a processor of today.
const PER_SAMPLE: f64 = 3e-6;

/// Says what will take long or much, and refuses what no usual machine has.
pub fn announce(
    file: &Path,
    request: &Request,
    how: &How<'_>,
    progress: &Progress,
) -> Result<(), Failure> {
    let size = request.plant.dimensions();
    if how.solved.is_none() && request.control.check(size).is_ok() {
        let work = Work::new(size, request.plant.modes.len(), &request.control);
        // What is larger is refused by the design itself.
        if work.check(&request.control).is_ok() && work.seconds > LONG {
            let parts = request.plant.modes.len();
            progress.announce(&design(&work, how.threads.min(parts)));
        }
    }
    let Some(baselines) = how.played else {
        return Ok(());
    };
    let tracked = request.control.tracked.len();
    let extent = Extent::new(size, tracked, request.scenario.steps, baselines);
    extent
        .check()
        .map_err(|error| Failure::Input(format!("{}: {error}", file.display())))?;
    if let Some(words) = simulation(&extent) {
        progress.announce(&words);
    }
    Ok(())
}

fn design(work: &Work, together: usize) -> String {
    let memory = work.bytes * together as f64;
    let memory = match memory > LARGE {
        true => format!(" and {} of memory", bytes(memory)),
        false => String::new(),
    };
    format!("the design will take about {}{memory}", work.time())
}

/// Nothing of what is soon over.
fn simulation(extent: &Extent) -> Option<String> {
    let seconds = PER_SAMPLE * (extent.steps * extent.runs) as f64;
    let size = extent.bytes as f64;
    (seconds > LONG || size > LARGE).then(|| {
        format!(
            "the simulation will take about {} for {} runs of {} samples, and {} on the disk for {}",
            ftc_design::work::in_words(seconds),
            extent.runs,
            extent.steps,
            bytes(size),
            report::simulate::TABLE
        )
    })
}

fn bytes(count: f64) -> String {
    match count < 1e9 {
        true => format!("{:.0} MB", count / 1e6),
        false => format!("{:.1} GB", count / 1e9),
    }
}
