//! Theorems T1 and T2: optima, verdicts, and what the gains really do.

mod plants;

use ftc::design::state_feedback::synthesise;
use ftc::design::{DesignError, Lyapunov};
use ftc::plant::scaling::Scaling;
use plants::{Channel, paper, paper_spec};

/// Half a unit of the fourth decimal, to which the reference values are given, plus the hair that
/// is given up for a margin.
fn assert_agrees(found: f64, reference: f64) {
    let tolerance = 0.5e-4 + 2e-5 * reference;
    assert!(
        (found - reference).abs() < tolerance,
        "gamma {found} against {reference}"
    );
}

#[test]
fn common_lyapunov_reaches_the_reference_values() {
    for (channel, decay, reference) in [
        (Channel::State, 0.7, 2.1146),
        (Channel::State, 0.9, 1.6482),
        (Channel::Output, 0.7, 1.7630),
    ] {
        let plant = paper(channel);
        let spec = paper_spec(0, decay, Lyapunov::Common);
        let design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
        for gamma in design.gamma.as_ref().unwrap() {
            assert_agrees(*gamma, reference);
        }
        assert!(design.spectral_radius.iter().all(|rho| *rho < decay));
        design.verify(&plant).unwrap();
    }
}

#[test]
fn dwell_reaches_the_reference_values_per_mode() {
    for (channel, latency, decay, references) in [
        (Channel::State, 0, 0.7, [2.1146, 2.1094]),
        (Channel::State, 0, 0.9, [1.6480, 1.6433]),
        (Channel::State, 1, 0.7, [4.2472, 3.0376]),
        (Channel::State, 1, 0.9, [2.6119, 1.9850]),
        (Channel::Output, 0, 0.7, [1.7622, 1.7630]),
        (Channel::Output, 1, 0.9, [1.8866, 1.8881]),
    ] {
        let plant = paper(channel);
        let spec = paper_spec(latency, decay, Lyapunov::Dwell);
        let design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
        println!(
            "{channel:?} {latency} {decay} {:?} {:?}",
            design.gamma, design.dwell
        );
        for (gamma, reference) in design.gamma.as_ref().unwrap().iter().zip(references) {
            assert_agrees(*gamma, reference);
        }
        assert!(design.spectral_radius.iter().all(|rho| *rho < decay));
        assert!(design.dwell.unwrap().samples.is_finite());
    }
}

#[test]
fn switched_equals_common_where_both_exist() {
    for (channel, decay, reference) in [
        (Channel::State, 0.7, 2.1146),
        (Channel::State, 0.9, 1.6482),
        (Channel::Output, 0.7, 1.7630),
    ] {
        let plant = paper(channel);
        let spec = paper_spec(0, decay, Lyapunov::Switched);
        let design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
        println!("{:?} {:?}", design.gamma, design.optimum);
        assert!(
            design
                .gamma
                .unwrap()
                .iter()
                .all(|gamma| (gamma - reference).abs() < 1e-3)
        );
    }
}

#[test]
fn latency_makes_arbitrary_switching_infeasible_and_the_verdict_says_so() {
    for (channel, decay) in [
        (Channel::State, 0.7),
        (Channel::State, 0.9),
        (Channel::Output, 0.9),
    ] {
        for lyapunov in [Lyapunov::Common, Lyapunov::Switched] {
            let plant = paper(channel);
            let spec = paper_spec(1, decay, lyapunov);
            let error = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap_err();
            println!("{error}");
            let DesignError::Infeasible(verdict) = error else {
                panic!("{error:?}");
            };
            assert!(verdict.margin <= 0.0);
            assert!(!verdict.blocks.is_empty());
        }
    }
}
