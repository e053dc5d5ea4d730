//! Theorems T1 and T2: optima, verdicts, and what the gains really do.
//!
//! promise: certified-gains

mod plants;

use ftc_design::augmented::augment;
use ftc_design::state_feedback::{synthesise, synthesise_with};
use ftc_design::{
    ControlSpec, DesignError, Lyapunov, Objective, Run, Solver, StateFeedback, Step, Units,
};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Mode, SwitchedPlant, spectral_radius};
use nalgebra::{Complex, DMatrix};
use plants::{
    Channel, half_unstable, in_units, paper, paper_spec, random_plant, rectifier,
    sparsely_disturbed, spread_units, three_modes, two_channels, usual_spec,
};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Half a unit of the fourth decimal, to which the reference values are given, plus the relaxation that
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
            let DesignError::Infeasible(verdict) = error else {
                panic!("{error:?}");
            };
            assert!(verdict.margin <= 0.0);
            assert!(!verdict.blocks.is_empty());
        }
    }
}

/// `A + B K~` and `H + D K~` of a mode in physical units, with `E`.
fn closed_loop(
    plant: &SwitchedPlant,
    design: &StateFeedback,
    mode: usize,
) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
    let spec = &design.spec;
    let units = Units::unit(plant, spec.tracked.len());
    let model = augment(plant, spec, &units).swap_remove(mode);
    let gains = &design.modes[mode];
    let (m, n) = gains.state_feedback.shape();
    let previous = gains.previous_input.ncols();
    let mut gain = DMatrix::zeros(m, model.a.nrows());
    let integral_part = spec.integral_size();
    gain.columns_mut(0, n).copy_from(&gains.state_feedback);
    gain.columns_mut(n, previous)
        .copy_from(&gains.previous_input);
    gain.columns_mut(n + previous, integral_part)
        .copy_from(&gains.integral);
    (model.a + model.b * &gain, model.e, model.h + model.d * gain)
}

/// The largest singular value of `C (zI - A)^-1 B` over a fine grid of the unit circle.
fn peak_gain((a, b, c): (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>)) -> f64 {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let (a, b, c) = (complex(&a), complex(&b), complex(&c));
    let low = (0..200).map(|k| 1e-5 * 1.05_f64.powi(k));
    let high = (0..=400).map(|k| f64::from(k) * std::f64::consts::PI / 400.0);
    low.chain(high)
        .map(|angle| {
            let z = Complex::from_polar(1.0, angle);
            let shifted = DMatrix::from_diagonal_element(a.nrows(), a.nrows(), z) - &a;
            let response = &c * shifted.lu().solve(&b).expect("no pole on the unit circle");
            response.singular_values().max()
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_single_mode_reaches_its_gamma_and_never_exceeds_it() {
    for channel in [Channel::State, Channel::Output] {
        for latency in [0, 1] {
            let plant = paper(channel);
            // A slow decay, so that attenuation alone decides and the bound is tight.
            let spec = paper_spec(latency, 0.999, Lyapunov::Dwell);
            let design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
            for (mode, gamma) in design.gamma.as_ref().unwrap().iter().enumerate() {
                let peak = peak_gain(closed_loop(&plant, &design, mode));
                assert!(
                    peak <= *gamma,
                    "{channel:?} {latency}: {peak} above {gamma}"
                );
                assert!(
                    peak > 0.99 * gamma,
                    "{channel:?} {latency}: {peak} far below {gamma}"
                );
            }
        }
    }
}

#[test]
fn scaling_changes_neither_gamma_nor_the_verdict() {
    let plant = paper(Channel::State);
    let spec = paper_spec(0, 0.7, Lyapunov::Common);
    let nominal = Scaling {
        states: vec![400.0, 0.003],
        inputs: vec![0.01, 7.0],
        outputs: vec![90.0, 1e-4],
    };
    let unscaled = synthesise(&plant, &spec, &Scaling::unit(2, 2, 2)).unwrap();
    let scaled = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
    // The same plant in other units: its weights and its gamma follow.
    let foreign = nominal.apply(&plant);
    let mut foreign_spec = spec;
    foreign_spec.output_weight = vec![90.0, 1e-4];
    foreign_spec.integral_weight = vec![0.3 * 90.0, 0.3 * 1e-4];
    foreign_spec.input_weight = vec![0.1 * 0.01, 0.1 * 7.0];
    let foreign_units = synthesise(&foreign, &foreign_spec, &Scaling::automatic(&foreign)).unwrap();
    for design in [unscaled, scaled, foreign_units] {
        assert_agrees(design.gamma.unwrap()[0], 2.1146);
    }
}

#[test]
fn the_rectifier_in_si_units_meets_its_decay() {
    let plant = rectifier();
    for (lyapunov, decay) in [(Lyapunov::Dwell, 0.95), (Lyapunov::Common, 0.98)] {
        let mut spec = ControlSpec::unweighted(plant.dimensions());
        spec.lyapunov = lyapunov;
        spec.decay = decay;
        spec.output_weight = vec![1.0 / 600.0, 1.0 / 30.0];
        spec.integral_weight = vec![10.0 / 600.0, 10.0 / 30.0];
        spec.input_weight = vec![0.1; 2];
        let design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
        design.verify(&plant).unwrap();
        for mode in 0..2 {
            assert!(spectral_radius(&closed_loop(&plant, &design, mode).0) < decay);
        }
    }
}

#[test]
fn random_plants_are_designed_certified_and_do_what_was_promised() {
    for (sample_time, decay) in [(0.1, 0.97), (0.01, 0.995)] {
        let mut designed = 0;
        for seed in 0..9 {
            let plant = random_plant(seed, sample_time);
            let lyapunov =
                [Lyapunov::Common, Lyapunov::Switched, Lyapunov::Dwell][seed as usize % 3];
            let dims = plant.dimensions();
            let r = dims.outputs.min(dims.inputs);
            let mut spec = ControlSpec::unweighted(dims);
            spec.decay = decay;
            spec.lyapunov = lyapunov;
            spec.latency = seed as usize / 3 % 2;
            spec.integral_weight = vec![0.3; r];
            spec.input_weight = vec![0.1; dims.inputs];
            let design = match synthesise(&plant, &spec, &Scaling::automatic(&plant)) {
                Ok(design) => design,
                Err(DesignError::Infeasible(verdict)) => {
                    assert!(!verdict.blocks.is_empty());
                    continue;
                }
                Err(error) => panic!("Te {sample_time} seed {seed}: {error}"),
            };
            designed += 1;
            let gamma = design.gamma.as_ref().unwrap();
            let optimum = design.optimum.as_ref().unwrap();
            for mode in 0..plant.modes.len() {
                let closed = closed_loop(&plant, &design, mode);
                assert!(spectral_radius(&closed.0) < decay, "seed {seed}");
                assert!(peak_gain(closed) <= gamma[mode], "seed {seed}");
                assert!(
                    gamma[mode] < 1.0001 * optimum[mode],
                    "seed {seed}: {} {}",
                    gamma[mode],
                    optimum[mode]
                );
            }
        }
        assert!(designed >= 6, "{designed} designs at {sample_time} s");
    }
}

#[test]
fn decay_alone_is_theorem_one() {
    let plant = paper(Channel::State);
    for lyapunov in [Lyapunov::Common, Lyapunov::Switched, Lyapunov::Dwell] {
        let mut spec = paper_spec(0, 0.6, lyapunov);
        spec.objective = Objective::Decay;
        let design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
        assert_eq!(design.gamma, None);
        for mode in 0..2 {
            assert!(spectral_radius(&closed_loop(&plant, &design, mode).0) < 0.6);
        }
    }
}

/// Advice that is given with a verdict, followed, leads to a certified design.
fn assert_advice_works(plant: &SwitchedPlant, spec: &ControlSpec) -> usize {
    let scaling = Scaling::automatic(plant);
    let advice = match synthesise(plant, spec, &scaling) {
        Ok(_) => return 0,
        Err(DesignError::Infeasible(verdict)) => verdict.advice,
        Err(error) => panic!("{error}"),
    };
    for advice in &advice {
        let followed = advice.apply(spec);
        assert_ne!(followed, *spec);
        if let Err(error) = synthesise(plant, &followed, &scaling) {
            panic!("{advice}: {error}");
        }
    }
    advice.len()
}

#[test]
fn advice_is_good_advice() {
    let late = paper_spec(1, 0.7, Lyapunov::Common);
    assert!(assert_advice_works(&paper(Channel::State), &late) > 0);
    // Found by review: what was advised could not be certified.
    assert!(
        assert_advice_works(
            &three_modes(),
            &usual(&three_modes(), Lyapunov::Common, 0.5)
        ) > 0
    );
    let unstable = half_unstable();
    let mut one_output = usual(&unstable, Lyapunov::Common, 0.9);
    one_output.tracked = vec![1];
    one_output.output_weight = vec![1.0];
    one_output.integral_weight = vec![0.3];
    assert!(assert_advice_works(&unstable, &one_output) > 0);
    let advised: usize = (0..12)
        .map(|seed| {
            let plant = random_plant(seed, 0.1);
            let latency = seed as usize % 2;
            let mut spec = usual(&plant, Lyapunov::Common, 0.6);
            spec.latency = latency;
            assert_advice_works(&plant, &spec)
        })
        .sum();
    assert!(advised >= 6, "{advised} pieces of advice");
}

/// The weights a design file without any has.
fn usual(plant: &SwitchedPlant, lyapunov: Lyapunov, decay: f64) -> ControlSpec {
    let dims = plant.dimensions();
    let r = dims.outputs.min(dims.inputs);
    let mut spec = ControlSpec::unweighted(dims);
    spec.lyapunov = lyapunov;
    spec.decay = decay;
    spec.output_weight = vec![1.0; r];
    spec.integral_weight = vec![0.3; r];
    spec.input_weight = vec![0.1; dims.inputs];
    spec
}

/// Decay rates and the optimal common gamma of [`three_modes`].
const OPTIMA: [(f64, f64); 8] = [
    (0.66, 23.91389),
    (0.67, 15.95388),
    (0.68, 12.92635),
    (0.69, 11.14588),
    (0.70, 9.890372),
    (0.71, 8.939360),
    (0.75, 6.747282),
    (0.90, 4.306261),
];

/// Found by review: at a decay of 0.69 gamma was twice its optimum, at 0.7 nothing was certified. The
/// references are those of `tests/cvxpy/synthesis.py`.
#[test]
fn no_decay_makes_the_solver_miss_the_optimum() {
    let plant = three_modes();
    let scaling = Scaling::automatic(&plant);
    for (decay, reference) in OPTIMA {
        let spec = usual(&plant, Lyapunov::Common, decay);
        let design = synthesise(&plant, &spec, &scaling).unwrap();
        let gamma = design.gamma.as_ref().unwrap()[0];
        assert!(
            (gamma / reference - 1.0).abs() < 2e-4,
            "{decay}: {gamma} against {reference}"
        );
        assert_eq!(design.is_optimal(0), Some(true));
    }
}

/// Found by review: where the disturbance does not reach the performance signal, the least gamma is zero,
/// which no gains attain with a finite Lyapunov matrix.
#[test]
fn what_the_disturbance_does_not_reach_is_designed_all_the_same() {
    for lyapunov in [Lyapunov::Common, Lyapunov::Switched, Lyapunov::Dwell] {
        for decay in [0.9, 0.95, 0.98] {
            let plant = two_channels(&[0.1]);
            let mut spec = usual(&plant, lyapunov, decay);
            spec.tracked = vec![1];
            spec.output_weight = vec![1.0];
            spec.integral_weight = vec![0.3];
            assert_rejects(&plant, &spec, &[true]);
        }
    }
    for decay in [0.3, 0.7, 0.95] {
        let plant = two_channels(&[0.0, 1.0]);
        let spec = usual(&plant, Lyapunov::Dwell, decay);
        assert_rejects(&plant, &spec, &[true, false]);
    }
    for decay in [0.9, 0.92, 0.95, 0.97, 0.98, 0.99] {
        let plant = half_unstable();
        let mut spec = usual(&plant, Lyapunov::Dwell, decay);
        spec.tracked = vec![1];
        spec.output_weight = vec![1.0];
        spec.integral_weight = vec![0.3];
        assert_rejects(&plant, &spec, &[false, true]);
    }
}

/// The design exists, every gamma is called optimal, and those of the given modes count as rejection.
fn assert_rejects(plant: &SwitchedPlant, spec: &ControlSpec, modes: &[bool]) {
    let design = synthesise(plant, spec, &Scaling::automatic(plant)).unwrap();
    for (mode, rejected) in modes.iter().enumerate() {
        let gamma = design.gamma.as_ref().unwrap()[mode];
        assert_eq!(gamma < 1e-3, *rejected, "decay {}: {gamma}", spec.decay);
        assert_eq!(design.is_optimal(mode), Some(true));
    }
}

/// A gamma that is not the optimum is not called so.
#[test]
fn a_gamma_above_the_optimum_is_not_called_optimal() {
    let plant = paper(Channel::State);
    let spec = paper_spec(0, 0.9, Lyapunov::Common);
    let mut design = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap();
    assert_eq!(design.is_optimal(1), Some(true));
    design.gamma.as_mut().unwrap()[1] *= 1.002;
    assert_eq!(design.is_optimal(1), Some(false));
    design.gamma = None;
    assert_eq!(design.is_optimal(1), None);
}

/// Plants of every size, disturbed here and there: what can be stabilised is certified with the optimal
/// gamma, and a slower decay never costs attenuation.
#[test]
fn no_random_plant_is_left_without_its_optimum() {
    let (mut designed, kinds) = (0, [Lyapunov::Common, Lyapunov::Dwell]);
    for seed in 0..14 {
        let plant = sparsely_disturbed(seed);
        let mut last = f64::INFINITY;
        for decay in [0.8, 0.95] {
            let spec = usual(&plant, kinds[seed as usize % 2], decay);
            let design = match synthesise(&plant, &spec, &Scaling::automatic(&plant)) {
                Ok(design) => design,
                Err(DesignError::Infeasible(_)) => continue,
                Err(error) => panic!("seed {seed}, decay {decay}: {error}"),
            };
            let Some(gamma) = &design.gamma else { continue };
            designed += 1;
            for mode in 0..plant.modes.len() {
                assert_eq!(
                    design.is_optimal(mode),
                    Some(true),
                    "seed {seed}, decay {decay}"
                );
            }
            let largest = gamma.iter().fold(0.0_f64, |worst, gamma| worst.max(*gamma));
            assert!(
                largest < 1.0005 * last,
                "seed {seed}, decay {decay}: {largest} above {last}"
            );
            last = largest;
        }
    }
    assert!(designed >= 14, "{designed} designs");
}

/// One mode of ten states and more, where the dual solution says little: the optimum is known all the same, and
/// no other solver is asked, which would take minutes.
#[test]
fn the_optimum_of_a_single_large_mode_is_known_at_once() {
    for seed in 0..3 {
        let random = |k: usize, r: usize, c: usize| {
            let angle = |row: usize, column: usize| {
                1.0 + (17 * seed + 5 * k) as f64
                    + 3.7 * (row * row) as f64
                    + 2.9 * (row * column) as f64
                    + 1.3 * column as f64
            };
            DMatrix::from_fn(r, c, |row, column| angle(row, column).sin())
        };
        let n = 10 + seed;
        let raw = random(1, n, n);
        let mode = Mode::new(
            &raw * (0.9 / raw.clone().singular_values().max()),
            random(2, n, n / 2),
            random(3, n / 2, n),
        )
        .with_disturbance(random(4, n, 1), DMatrix::zeros(n / 2, 1));
        let plant = SwitchedPlant::new(1.0, vec![mode]);
        let spec = usual(&plant, Lyapunov::Common, 0.97);
        let asked = AtomicUsize::new(0);
        let watch = |step: Step| {
            asked.fetch_add(usize::from(step == Step::GeneralSolver), Ordering::Relaxed);
        };
        let mut run = Run::default();
        run.watch = &watch;
        let scaling = Scaling::automatic(&plant);
        let design = synthesise_with(&plant, &spec, &scaling, &run).unwrap();
        assert_eq!(design.is_optimal(0), Some(true), "{n} states");
        assert_eq!(asked.load(Ordering::Relaxed), 0, "{n} states");
    }
}

#[test]
fn more_tracked_outputs_than_inputs_are_refused_at_once() {
    let mut plant = paper(Channel::State);
    for mode in &mut plant.modes {
        mode.b = mode.b.columns(0, 1).into_owned();
        mode.operating_point.u.truncate(1);
    }
    let mut spec = paper_spec(0, 0.9, Lyapunov::Common);
    spec.input_weight = vec![0.1];
    let error = synthesise(&plant, &spec, &Scaling::automatic(&plant)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "2 tracked outputs need as many inputs, but the plant has 1: track fewer outputs"
    );
}

/// Units spread over twelve decades change neither the verdict nor gamma: the whole is in the bench.
///
/// promise: any-units
#[test]
fn units_change_neither_verdict_nor_gamma() {
    let mut designed = 0;
    for seed in 0..12 {
        let plant = random_plant(seed, 1.0);
        let dims = plant.dimensions();
        let spec = usual_spec(seed, dims);
        let units = spread_units(seed, dims);
        let (twin, twin_spec) = in_units(&plant, &spec, &units);
        let own = synthesise(&plant, &spec, &Scaling::automatic(&plant));
        let other = synthesise(&twin, &twin_spec, &Scaling::automatic(&twin));
        match (own, other) {
            (Ok(own), Ok(other)) => {
                designed += 1;
                let pairs = own.gamma.unwrap().into_iter().zip(other.gamma.unwrap());
                for (own, other) in pairs {
                    assert!(
                        (own / other - 1.0).abs() < 1e-4,
                        "seed {seed}: {own} {other}"
                    );
                }
            }
            (Err(DesignError::Infeasible(_)), Err(DesignError::Infeasible(_))) => {}
            (own, other) => panic!("seed {seed}: {:?} {:?}", own.err(), other.err()),
        }
    }
    assert!(designed >= 6, "{designed} designs");
}

/// Both solvers come to the same gamma.
#[test]
fn both_solvers_agree() {
    let mut general = Run::default();
    general.solver = Solver::General;
    let mut compared = 0;
    for seed in 0..9 {
        let plant = random_plant(seed, 1.0);
        let spec = usual_spec(seed, plant.dimensions());
        let scaling = Scaling::automatic(&plant);
        let (Ok(own), Ok(other)) = (
            synthesise(&plant, &spec, &scaling),
            synthesise_with(&plant, &spec, &scaling, &general),
        ) else {
            continue;
        };
        compared += 1;
        for (own, other) in own.gamma.unwrap().into_iter().zip(other.gamma.unwrap()) {
            assert!(
                (own / other - 1.0).abs() < 1e-4,
                "seed {seed}: {own} {other}"
            );
        }
    }
    assert!(compared >= 5, "{compared} plants compared");
}
