//! How quickly faults are found, how often healthy sensors are flagged, and whether the right one is:
//! 200 random faults on 20 random plants, seeded, printed as tables.
#![allow(missing_docs)]

#[path = "../random_plants/mod.rs"]
mod random_plants;

use ftc_control::Controller;
use ftc_design::Design;
use ftc_plant::scenario::{FaultEvent, FaultKind};
use ftc_simulate::{PlantSimulator, Variant, run};
use random_plants::{RandomNumbers, design, schedule};

const PLANTS: usize = 20;
const FAULTS_PER_PLANT: usize = 10;

#[derive(Default)]
struct Tally {
    healthy_samples: u64,
    false_alarms: u64,
    /// Per kind: name, faults, found, sum and worst of delays, others flagged.
    kinds: Vec<(String, u64, u64, u64, u64, u64)>,
    /// `isolation[faulty][flagged]`: samples.
    isolation: [[u64; 3]; 3],
    faulty_samples: [u64; 3],
}

fn healthy(design: &Design, tally: &mut Tally) {
    let te = design.plant.sample_time;
    let mut scenario = design.scenario.clone();
    scenario.schedule = schedule(te, scenario.steps, 5_000);
    let plant = PlantSimulator::new(design.plant.clone(), scenario);
    let trajectory = run(
        &plant,
        &Controller::new(design.parameters()).unwrap(),
        Variant::Ftc,
    );
    tally.healthy_samples += trajectory.records.len() as u64;
    tally.false_alarms += trajectory
        .records
        .iter()
        .filter(|r| r.flagged.contains(&true))
        .count() as u64;
}

fn kind(
    random: &mut RandomNumbers,
    index: usize,
    te: f64,
    threshold: f64,
) -> (&'static str, FaultKind) {
    let size = threshold * random.between(3.0, 20.0);
    match index % 5 {
        0 => ("bias", FaultKind::Bias { size }),
        1 => (
            "drift",
            FaultKind::Drift {
                slope: size / (50.0 * te),
            },
        ),
        2 => (
            "intermittent",
            FaultKind::Intermittent {
                size,
                period: 40.0 * te,
            },
        ),
        3 => ("stuck", FaultKind::Stuck),
        _ => ("dropout", FaultKind::Dropout),
    }
}

fn faulty(design: &Design, random: &mut RandomNumbers, index: usize, tally: &mut Tally) {
    let te = design.plant.sample_time;
    let sensors = design.controller.estimator.thresholds.len();
    let sensor = random.count(0, sensors - 1);
    let hold = design.controller.estimator.response_length as u64;
    let from = 2 * hold + 1000 + random.count(0, 400) as u64;
    let until = from + 600;
    let mut scenario = design.scenario.clone();
    scenario.steps = until + 200;
    let (name, kind) = kind(
        random,
        index,
        te,
        design.controller.estimator.thresholds[sensor],
    );
    scenario.events = vec![FaultEvent {
        sensor,
        from: from as f64 * te,
        until: until as f64 * te,
        kind,
    }];
    let plant = PlantSimulator::new(design.plant.clone(), scenario);
    let trajectory = run(
        &plant,
        &Controller::new(design.parameters()).unwrap(),
        Variant::Ftc,
    );
    let window = &trajectory.records[from as usize..until as usize];
    let delay = window.iter().position(|r| r.flagged[sensor]);
    let flagged_others = window
        .iter()
        .filter(|r| r.flagged.iter().enumerate().any(|(s, &f)| f && s != sensor))
        .count() as u64;
    for record in window {
        tally.faulty_samples[sensor] += 1;
        for (s, &flag) in record.flagged.iter().enumerate() {
            tally.isolation[sensor][s] += u64::from(flag);
        }
    }
    let entry = match tally.kinds.iter_mut().find(|k| k.0 == name) {
        Some(entry) => entry,
        None => {
            tally.kinds.push((name.into(), 0, 0, 0, 0, 0));
            tally.kinds.last_mut().expect("just pushed")
        }
    };
    entry.1 += 1;
    entry.5 += flagged_others;
    if let Some(delay) = delay {
        entry.2 += 1;
        entry.3 += delay as u64;
        entry.4 = entry.4.max(delay as u64);
    }
}

fn main() {
    let mut random = RandomNumbers::seeded(2026);
    let mut tally = Tally::default();
    for plant in 0..PLANTS {
        let design = design(&mut random);
        healthy(&design, &mut tally);
        for fault in 0..FAULTS_PER_PLANT {
            faulty(&design, &mut random, plant + fault, &mut tally);
        }
    }
    println!(
        "## Detection: {PLANTS} random plants, {} random faults, 6 sigma\n",
        PLANTS * FAULTS_PER_PLANT
    );
    println!(
        "False alarms: {} in {} healthy samples.\n",
        tally.false_alarms, tally.healthy_samples
    );
    println!(
        "| fault | drawn | found | mean delay (samples) | worst delay | samples in which another sensor was flagged |"
    );
    println!("|---|---|---|---|---|---|");
    for (name, drawn, found, sum, worst, flagged_others) in &tally.kinds {
        println!(
            "| {name} | {drawn} | {found} | {:.1} | {worst} | {flagged_others} |",
            *sum as f64 / (*found).max(1) as f64
        );
    }
    println!(
        "\nIsolation: share of the faulty samples in which each sensor was declared faulty.\n"
    );
    println!("| faulty sensor | 1 | 2 | 3 |\n|---|---|---|---|");
    for (sensor, row) in tally.isolation.iter().enumerate() {
        let share = |s: usize| 100.0 * row[s] as f64 / tally.faulty_samples[sensor].max(1) as f64;
        println!(
            "| {} | {:.1} % | {:.1} % | {:.1} % |",
            sensor + 1,
            share(0),
            share(1),
            share(2)
        );
    }
}
