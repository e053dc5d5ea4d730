//! Designs that say nothing of the estimator: no healthy sensor is given up, and faults are found. In each of
//! these situations an earlier default did many times worse than a loop that is told the fault.

mod common;

use common::{Bench, FILE};

/// Two modes, both states measured, under a sine whose period may be told wrong; what happens to it is
/// left to say: the told period, the schedule and what of the scenario follows.
fn design(period: f64, schedule: &str, happens: &str) -> String {
    format!(
        "name = \"trust\"\nsample_time = 0.5\n\n\
         [[mode]]\nA = [[0.7, 0.3], [-0.2, 0.5]]\nB = [[0.1, 0.8], [0.9, 0.0]]\nC = [[1.0, 0.0], [0.0, 1.0]]\n\
         E = [[0.5], [1.0]]\n\n\
         [[mode]]\nA = [[0.5, -0.3], [0.2, 0.4]]\nB = [[0.9, 0.1], [0.0, 0.8]]\nC = [[1.0, 0.0], [0.0, 1.0]]\n\
         E = [[1.0], [0.5]]\n\n\
         [disturbance]\nperiod = {period}\n\n[controller]\ntracked = [1, 2]\ndecay = 0.85\n\n\
         [scenario]\nsteps = 1400\nnoise = 0.004\nseed = 41\nschedule = [{schedule}]\n\
         reference = [{{ kind = \"steps\", points = [[0, 0.4], [140, -0.3], [420, 0.5]] }}, \
         {{ kind = \"steps\", points = [[0, -0.2], [250, 0.3]] }}]\n\
         disturbance = [{{ kind = \"sine\", amplitude = 0.03, period = 30.0 }}]\n{happens}\n"
    )
}

const SLOWLY: &str = "{ from = 0, mode = 1 }, { from = 350, mode = 2 }";

/// A switch every 20 to 60 samples.
fn fast() -> String {
    let mut from = 0;
    let intervals = (0..40).map(|k| {
        let interval = format!(
            "{{ from = {}, mode = {} }}",
            f64::from(from) * 0.5,
            1 + k % 2
        );
        from += 20 + (k * 17) % 41;
        interval
    });
    intervals.collect::<Vec<_>>().join(", ")
}

/// True mean square error: with fault tolerance, told the fault, without.
fn errors(design: &str) -> [f64; 3] {
    let bench = Bench::new(design);
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let metrics = bench.metrics();
    let error = |name: &str| -> f64 {
        let figures = metrics[name]["mse"]["true"].as_array().unwrap();
        figures.iter().map(|figure| figure.as_f64().unwrap()).sum()
    };
    ["ftc", "told_the_fault", "no_ftc"].map(error)
}

/// That with fault tolerance over that of a loop told the fault, and over that without.
fn ratios(design: &str) -> [f64; 2] {
    let [own, told, none] = errors(design);
    let ratios = [own / told, own / none];
    println!("over told {:.4}, over none {:.4}", ratios[0], ratios[1]);
    ratios
}

/// Within a tenth of it.
fn as_good_as_told(design: &str) {
    let [told, none] = ratios(design);
    assert!(told <= 1.1 && none <= 1.0, "{told} {none}");
}

const BIAS: &str =
    "events = [{ kind = \"bias\", sensor = 1, from = 200, until = 450, size = 0.3 }]";
const STUCK: &str = "events = [{ kind = \"stuck\", sensor = 2, from = 180, until = 400 }]";

#[test]
fn a_period_told_a_tenth_wrong() {
    as_good_as_told(&design(33.0, SLOWLY, BIAS));
}

#[test]
fn modes_that_hardly_last() {
    as_good_as_told(&design(30.0, &fast(), BIAS));
}

/// A loop told this fault knows what the sensor would have shown; without that, no more can be known than of a sensor that
/// shows nothing.
#[test]
fn a_sensor_that_sticks_costs_no_more_than_a_lost_one() {
    for seed in 41..49 {
        let stuck = design(30.0, SLOWLY, STUCK).replace("seed = 41", &format!("seed = {seed}"));
        let lost = stuck.replace("stuck", "dropout");
        let ([own, _, none], [least, _, _]) = (errors(&stuck), errors(&lost));
        println!("over lost {:.4}, over none {:.4}", own / least, own / none);
        assert!(
            own <= 1.05 * least && own <= none,
            "{seed}: {own} {least} {none}"
        );
    }
}

#[test]
fn modes_that_hardly_last_and_no_fault() {
    let [_, none] = ratios(&design(30.0, &fast(), ""));
    assert!(none <= 1.0 + 1e-9, "{none}");
}
