//! The method as a whole on the paper's scenario A: with a faulty sensor the true output
//! is as good as with a controller that is told the fault.
//!
//! promise: known-fault

mod common;

use common::{Channel, REFERENCES, controller, reference, scenario};
use ftc_control::Controller;
use ftc_simulate::{PlantSimulator, Trajectory, Variant, run};

fn simulate(channel: Channel, name: &str, noise: f64, variant: Variant) -> Trajectory {
    let parameters = controller(channel, noise);
    let plant = PlantSimulator::new(common::plant(channel), scenario(reference(name), noise, 1));
    run(&plant, &Controller::new(parameters).unwrap(), variant)
}

fn true_error(trajectory: &Trajectory) -> f64 {
    trajectory
        .merits(&[0, 1])
        .iter()
        .map(|merit| merit.true_output.mse)
        .sum()
}

#[test]
fn as_good_as_being_told_the_fault() {
    for channel in [Channel::State, Channel::Output] {
        for name in REFERENCES {
            for noise in [0.0, 0.005] {
                let told = true_error(&simulate(channel, name, noise, Variant::ToldTheFault));
                let ftc = true_error(&simulate(channel, name, noise, Variant::Ftc));
                let without = true_error(&simulate(channel, name, noise, Variant::NoFtc));
                println!(
                    "{channel:?} {name} {noise}: {ftc:.3e} {:.4} {:.1}",
                    ftc / told,
                    without / ftc
                );
                assert!(
                    ftc <= 1.05 * told,
                    "{channel:?}, {name}, noise {noise}: {ftc} against {told}"
                );
                assert!(
                    without >= 10.0 * ftc,
                    "{channel:?}, {name}, noise {noise}: {without} against {ftc}"
                );
            }
        }
    }
}

#[test]
fn no_false_alarms_and_prompt_exact_estimates() {
    for channel in [Channel::State, Channel::Output] {
        for name in REFERENCES {
            for noise in [0.0, 0.005] {
                let trajectory = simulate(channel, name, noise, Variant::Ftc);
                for (record, before) in trajectory.records[2..].iter().zip(&trajectory.records) {
                    let settled = record.fault == before.fault;
                    if settled && record.fault[0] == 0.0 {
                        assert_eq!(
                            record.flagged,
                            [false, false],
                            "{channel:?} {name} {noise} at {}",
                            record.tick
                        );
                    }
                    if settled && noise == 0.0 {
                        for (estimate, fault) in record.f_hat.iter().zip(&record.fault) {
                            assert!(
                                (estimate - fault).abs() <= 0.01 * fault,
                                "{channel:?} {name} at {}: {estimate}",
                                record.tick
                            );
                        }
                    }
                }
            }
        }
    }
}
