//! Plants with integrating, slow and unstable modes are served without being asked how.

mod common;

use common::{Bench, FILE};

/// Two states, both measured, under a command and a disturbance; the first mode's matrix is given.
fn plant(a: &str) -> String {
    format!(
        "name = \"served\"\nsample_time = 0.1\n\n[[mode]]\nA = {a}\nB = [[0.05], [0.1]]\n\
         C = [[1.0, 0.0], [0.0, 1.0]]\nE = [[0.01], [0.0]]\n\n[controller]\ntracked = [1]\ndecay = 0.97\n\
         latency = 1\n\n[signals]\noutputs = [{{ name = \"position\", nominal = 1.0 }}, {{ name = \"speed\", nominal = 1.0 }}]\n\n\
         [scenario]\nsteps = 600\nnoise = 0.002\nreference = [{{ kind = \"steps\", points = [[0, 1.0]] }}]\n\
         fault = [{{ kind = \"steps\", points = [[30, 0.5], [45, 0.0]] }}, 0.0]\n"
    )
}

/// Mean square of the true error of the first output: with fault tolerance, without, and told the fault.
fn errors(a: &str) -> [f64; 3] {
    let bench = Bench::new(plant(a));
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let metrics = bench.metrics();
    ["ftc", "no_ftc", "told_the_fault"].map(|name| {
        let figure = &metrics[name]["mse"]["true"][0];
        figure
            .as_f64()
            .unwrap_or_else(|| panic!("{name}: {metrics}"))
    })
}

fn served(a: &str) {
    let [ftc, none, told] = errors(a);
    assert!(ftc <= 1.1 * told && ftc < 0.5 * none, "{ftc} {none} {told}");
}

#[test]
fn an_integrator() {
    served("[[1.0, 0.1], [0.0, 0.9]]");
}

#[test]
fn a_slow_mode() {
    served("[[0.9995, 0.1], [0.0, 0.9]]");
}

#[test]
fn an_unstable_mode() {
    served("[[1.02, 0.1], [0.0, 0.9]]");
}

/// Poles on which a QR iteration without an end once turned for ever.
#[test]
fn poles_that_are_equal_or_in_order() {
    let equal = |_| 0.8;
    let ordered = |row: usize| 0.7 + 0.013 * row as f64;
    let designs: [(usize, &dyn Fn(usize) -> f64); 3] = [(4, &equal), (6, &equal), (16, &ordered)];
    for (n, pole) in designs {
        let diagonal = |entry: &dyn Fn(usize) -> f64| {
            let row = |r| (0..n).map(move |c| if r == c { entry(r) } else { 0.0 });
            let rows: Vec<Vec<f64>> = (0..n).map(|r| row(r).collect()).collect();
            format!("{rows:?}")
        };
        let (a, one) = (diagonal(pole), diagonal(&|_| 1.0));
        let bench = Bench::new(format!(
            "name = \"poles\"\nsample_time = 1.0\n[[mode]]\nA = {a}\nB = {one}\nC = {one}\n\
             [controller]\nobjective = \"decay\"\n"
        ));
        let run = bench.run(&["design", FILE]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
    }
}
