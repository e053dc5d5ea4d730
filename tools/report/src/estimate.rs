//! What long or large work will take, said before it begins.

use crate::simulate::{Extent, TABLE};
use ftc_design::assembly::Request;
use ftc_design::work::{Work, in_words};

/// Seconds from which work is said to take long.
const LONG: f64 = 10.0;
/// Bytes of memory or of a file that are worth a word.
const LARGE: f64 = 5e8;

/// Seconds that a sample of a run takes: roughly, for a plant of few states on a processor of today.
const PER_SAMPLE: f64 = 3e-6;

/// Of a design that is solved by so many threads; nothing of what is soon done, nor of what the design
/// itself refuses.
pub fn design(request: &Request, threads: usize) -> Option<String> {
    let (size, modes) = (request.plant.dimensions(), request.plant.modes.len());
    request.control.check(size).ok()?;
    let work = Work::new(size, modes, &request.control);
    work.check(&request.control).ok()?;
    let memory = work.bytes * threads.min(modes) as f64;
    let memory = match memory > LARGE && !work.by_riccati {
        true => format!(" and {} of memory", bytes(memory)),
        false => String::new(),
    };
    (work.seconds > LONG).then(|| format!("the design will take about {}{memory}", work.time()))
}

/// Of a simulation; nothing of what is soon over.
pub fn simulation(extent: &Extent) -> Option<String> {
    let seconds = PER_SAMPLE * (extent.steps * extent.runs) as f64;
    let size = extent.bytes as f64;
    (seconds > LONG || size > LARGE).then(|| {
        format!(
            "the simulation will take about {} for {} runs of {} samples, and {} on the disk for {TABLE}",
            in_words(seconds),
            extent.runs,
            extent.steps,
            bytes(size),
        )
    })
}

fn bytes(count: f64) -> String {
    match count < 1e9 {
        true => format!("{:.0} MB", count / 1e6),
        false => format!("{:.1} GB", count / 1e9),
    }
}
