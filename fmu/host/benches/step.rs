//! Set, doStep and get on the real binaries, through their C functions: the paper's example.
//!
//! Prints the median over many batches, and the same three calls on an instance whose step ends
//! before the next tick: what the interface alone costs.

use fmu_host::model::example;
use fmu_host::types::Status;
use fmu_host::{Instance, Library, Model};
use std::hint::black_box;
use std::time::Instant;

const BATCHES: usize = 200;
const STEPS: usize = 2_000;

/// Nanoseconds of one set, doStep and get with steps of `length` samples.
fn measure(it: &Instance, input: &str, output: &str, length: f64) -> f64 {
    let (input, output) = (it.span(input), it.span(output));
    assert_eq!(it.reset(), Status::Ok);
    it.initialize(0.0, |_| ());
    let (mut out, mut time) = ([0.0; 2], 0.0);
    let mut batches: Vec<f64> = (0..BATCHES)
        .map(|_| {
            let began = Instant::now();
            for k in 0..STEPS {
                let value = 1e-3 * (k % 7) as f64;
                assert_eq!(it.set(input, black_box(&[value, -value])), Status::Ok);
                assert_eq!(it.step(time, length), Status::Ok);
                assert_eq!(it.get_into(output, &mut out), Status::Ok);
                black_box(&out);
                time += length;
            }
            began.elapsed().as_nanos() as f64 / STEPS as f64
        })
        .collect();
    batches.sort_by(f64::total_cmp);
    batches[BATCHES / 2]
}

fn main() {
    let design = example();
    let cases = [
        (
            "controller",
            "ftc_controller",
            Model::controller(&design),
            "y",
            "u",
        ),
        ("plant", "ftc_plant", Model::plant(&design), "u", "y"),
    ];
    println!(
        "{:12}{:>22}{:>22}",
        "set+step+get", "a tick, ns", "interface alone, ns"
    );
    for (name, binary, model, input, output) in cases {
        let library = Library::load(binary);
        let it = Instance::new(library.functions, &model).expect("an instance");
        if name.contains("controller") {
            // Without a mode it would rest.
            assert_eq!(it.set_integer(it.span("mode"), 1), Status::Ok);
        }
        it.silence();
        let tick = measure(&it, input, output, 1.0);
        let idle = measure(&it, input, output, 1e-9);
        println!("{name:12}{tick:>22.0}{idle:>22.0}");
    }
}
