//! A plant whose mode nobody tells: found from the readings, also while sensors are faulty, as soon as
//! it could be told one sample late. Against the loop that is told the fault, and the mode one sample
//! late.
//!
//! promise: estimated-mode

mod common;
mod random_plants;

use common::{Channel, REFERENCES, plant, reference, scenario, state_based};
use ftc_control::Controller;
use ftc_design::apart::LEAST_DEVIATIONS;
use ftc_design::warnings::{self, Warning};
use ftc_design::{Design, MODE_LENGTH};
use ftc_plant::deviation::Deviation;
use ftc_plant::scenario::{ModeInterval, Scenario, Waveform};
use ftc_plant::{SwitchedPlant, TruePlant};
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run};
use random_plants::RandomNumbers;

/// Sum of the mean squares of a run's true errors.
fn error(run: &Trajectory, tracked: &[usize]) -> f64 {
    run.merits(tracked).iter().map(|m| m.true_output.mse).sum()
}

/// The loop whose mode is found, and the same told the fault, and the mode one sample late.
fn both(plant: &SwitchedPlant, scenario: &Scenario, controller: &Controller) -> [Trajectory; 2] {
    let mut deviation = Deviation::default();
    deviation.mode_delay = 1;
    let late = TruePlant::AsDesigned.with_deviation(deviation);
    let simulator = |truth| PlantSimulator::with_true_plant(plant.clone(), truth, scenario.clone());
    let found = run(&simulator(TruePlant::AsDesigned), controller, Variant::Ftc);
    let told = run(&simulator(late), controller, Variant::ToldTheFault);
    [found, told]
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(share * (values.len() - 1) as f64).round() as usize]
}

#[test]
fn the_papers_modes_are_found_while_both_sensors_are_faulty() {
    for channel in [Channel::State, Channel::Output] {
        for noise in [0.0, 0.005] {
            let mut parameters = state_based(channel, noise);
            let settings = parameters.estimator.hypotheses.as_mut().unwrap();
            settings.mode_rate = Some(1.0 / MODE_LENGTH);
            let controller = Controller::new(parameters).unwrap();
            for name in REFERENCES {
                let scenario = scenario(reference(name), noise, 1);
                let [found, told] = both(&plant(channel), &scenario, &controller);
                let ratio = error(&found, &[0, 1]) / error(&told, &[0, 1]);
                let wrong = found.wrong_modes().unwrap();
                println!("{name} {channel:?} noise {noise}: {ratio:.4}, {wrong:?}");
                assert!(ratio <= 1.05, "{name} {channel:?} noise {noise}: {ratio}");
            }
        }
    }
}

/// Random designs whose modes last 40 to 120 samples.
fn designs(seed: u64, count: usize) -> Vec<Design> {
    let mut random = RandomNumbers::seeded(seed);
    let draw = |_| {
        let mut design = random_plants::with_several_sensors(&mut random);
        let te = design.plant.sample_time;
        design.scenario.steps = 4000;
        let (mut at, mut schedule) = (0.0, Vec::new());
        while at < design.scenario.steps as f64 {
            schedule.push(ModeInterval {
                from: at * te,
                mode: schedule.len() % 2,
            });
            at += random.between(40.0, 120.0).round();
        }
        design.scenario.schedule = schedule;
        let settings = design.controller.estimator.hypotheses.as_mut().unwrap();
        settings.mode_rate = Some(1.0 / MODE_LENGTH);
        design
    };
    (0..count).map(draw).collect()
}

/// By how much a loop may get worse when it is told the mode one sample late: beyond it, a mode that has
/// to be found cannot be found in time.
const STANDS: f64 = 1000.0;

#[test]
fn modes_of_random_plants_are_found() {
    for (seed, count, faulty, least) in [
        (41, 24, false, 20),
        (41, 24, true, 20),
        (4242, 40, false, 36),
    ] {
        let mut ratios = Vec::new();
        for mut design in designs(seed, count) {
            if faulty {
                let te = design.plant.sample_time;
                design.scenario.fault[0] = Waveform::Steps {
                    points: vec![
                        [1333.0 * te, 40.0 * random_plants::NOISE],
                        [2700.0 * te, 0.0],
                    ],
                };
            }
            let controller = Controller::new(design.parameters()).unwrap();
            let tracked = &design.controller.feedback.tracked;
            let in_time = run(
                &PlantSimulator::new(design.plant.clone(), design.scenario.clone()),
                &controller,
                Variant::ToldTheFault,
            );
            let [found, told] = both(&design.plant, &design.scenario, &controller);
            if error(&told, tracked) > STANDS * error(&in_time, tracked) {
                continue;
            }
            let modes = found.wrong_modes().unwrap();
            let switches = design.scenario.schedule.len() as u64;
            ratios.push(error(&found, tracked) / error(&told, tracked));
            println!("{:.4} {modes:?} of {switches}", ratios.last().unwrap());
            assert!(modes.samples <= 2 * switches, "{modes:?} of {switches}");
        }
        let kept = ratios.len();
        let [median, most, worst] = [0.5, 0.9, 1.0].map(|share| quantile(&mut ratios, share));
        println!("faulty {faulty}, {kept} of {count}: {median:.4} {most:.4} {worst:.4}");
        assert!(kept >= least && median <= 1.0 && worst <= 3.0);
        assert!(faulty || most <= 1.05);
    }
}

/// Two modes that make the same of every input are named; those of the paper are far apart.
#[test]
fn modes_that_no_reading_tells_apart_are_named() {
    let mut design = designs(43, 1).remove(0);
    let apart = |design: &Design| ftc_design::apart::pairs(design)[0].deviations;
    assert!(apart(&design) > 10.0 * LEAST_DEVIATIONS);
    design.plant.modes[1] = design.plant.modes[0].clone();
    assert_eq!(apart(&design), 0.0);
    let named = warnings::of_design(&design, None);
    assert!(
        named
            .iter()
            .any(|warning| matches!(warning, Warning::ModesAlike(_)))
    );
}
