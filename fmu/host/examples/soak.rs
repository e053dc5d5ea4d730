//! `soak TICKS`: one loop of controller and plant for a very long time.
//!
//! Every signal must remain finite, the clock must not drift, and memory must not grow. Prints
//! what was measured; a broken promise is a panic.
//!
//! promise: long-run

use fmu_host::model::example;
use fmu_host::{Coupling, Library, Loop, Model};
use std::time::Instant;

/// Resident memory of this process in KiB; 0 where the system does not tell.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let words = line.into_iter().flat_map(str::split_whitespace);
    words
        .filter_map(|word| word.parse().ok())
        .next()
        .unwrap_or(0)
}

fn main() {
    let argument = std::env::args().nth(1).and_then(|text| text.parse().ok());
    let ticks: u64 = argument.unwrap_or(100_000_000);
    let design = example();
    let libraries = [Library::load("ftc_controller"), Library::load("ftc_plant")];
    let models = [Model::controller(&design), Model::plant(&design)];
    let functions = libraries.each_ref().map(|library| library.functions);
    let mut closed = Loop::new(functions, models.each_ref(), 0.0);
    let measured = closed.plant.span("y");
    // Memory is read once everything is warm.
    let (warm, began) = (ticks / 100 + 1, Instant::now());
    let (mut memory, mut largest) = (0, 0.0_f64);
    for k in 0..ticks {
        closed.step_to((k + 1) as f64, Coupling::GaussSeidel, true);
        let mut values = [0.0; 2];
        closed.plant.get_into(measured, &mut values);
        largest = values.iter().fold(largest, |most, value| {
            assert!(value.is_finite(), "tick {k}: {values:?}");
            most.max(value.abs())
        });
        if k == warm {
            memory = resident();
        }
    }
    let (seconds, now) = (began.elapsed().as_secs_f64(), resident());
    let mut time = 0.0;
    // SAFETY: the instance lives.
    unsafe { (closed.plant.functions().get_real_status)(closed.plant.c, 2, &mut time) };
    assert_eq!(time, ticks as f64, "the clock drifted");
    assert!(
        now <= memory + 256,
        "memory grew from {memory} to {now} KiB"
    );
    println!(
        "{ticks} ticks in {seconds:.0} s, {:.0} ns each",
        1e9 * seconds / ticks as f64
    );
    println!(
        "largest |y| {largest:.3}; the clock is at {time} s, {} off",
        time - ticks as f64
    );
    println!("resident memory {memory} KiB after {warm} ticks, {now} KiB at the end");
}
