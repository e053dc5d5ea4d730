//! The observer: existence, decoupling, decay under every switching, units.
//!
//! promise: certified-gains

mod plants;

use ftc_control::parameters::ObserverKind;
use ftc_design::observer::synthesise;
use ftc_design::{DesignError, Lyapunov, ObserverChoice, ObserverDesign, ObserverSpec, dense};
use ftc_plant::scaling::Scaling;
use ftc_plant::{SwitchedPlant, spectral_radius};
use nalgebra::DMatrix;
use plants::{Channel, mode, paper, random_plant, rows};

fn spec(kind: ObserverChoice, decay: f64, lyapunov: Lyapunov) -> ObserverSpec {
    ObserverSpec::new(kind, decay, lyapunov)
}

fn design(plant: &SwitchedPlant, spec: &ObserverSpec) -> Result<ObserverDesign, DesignError> {
    synthesise(plant, spec, &Scaling::automatic(plant))
}

/// `T_ij A_i - K_i C_i`, written out once more.
fn error_dynamics(
    plant: &SwitchedPlant,
    found: &ObserverDesign,
    i: usize,
    j: usize,
) -> DMatrix<f64> {
    let (own, next) = (&plant.modes[i], &plant.modes[j]);
    let t = DMatrix::identity(own.a.nrows(), own.a.nrows())
        - dense(&found.observer.decoupling[i][j]) * &next.c;
    t * &own.a - dense(&found.observer.gains[i]) * &own.c
}

#[test]
fn the_unknown_input_observer_of_the_paper_decouples_and_decays() {
    let plant = paper(Channel::State);
    for lyapunov in [Lyapunov::Common, Lyapunov::Switched, Lyapunov::Dwell] {
        let found = design(&plant, &spec(ObserverChoice::Auto, 0.5, lyapunov)).unwrap();
        assert_eq!(found.observer.kind, ObserverKind::Uio);
        assert_eq!(found.observer.note, None);
        found.verify(&plant).unwrap();
        for (i, row) in found.observer.decoupling.iter().enumerate() {
            for (j, h) in row.iter().enumerate() {
                let e = &plant.modes[i].e;
                assert!((e - dense(h) * &plant.modes[j].c * e).amax() < 1e-14);
            }
            assert!(spectral_radius(&error_dynamics(&plant, &found, i, i)) < 0.5);
        }
    }
}

#[test]
fn an_output_disturbance_makes_auto_choose_luenberger_and_say_why() {
    let plant = paper(Channel::Output);
    let found = design(&plant, &spec(ObserverChoice::Auto, 0.5, Lyapunov::Common)).unwrap();
    assert_eq!(found.observer.kind, ObserverKind::Luenberger);
    assert!(
        found
            .observer
            .note
            .as_ref()
            .unwrap()
            .contains("no disturbance acts on the state")
    );
    assert!(
        found
            .observer
            .decoupling
            .iter()
            .flatten()
            .all(|h| dense(h).amax() == 0.0)
    );

    let error = design(&plant, &spec(ObserverChoice::Uio, 0.5, Lyapunov::Common)).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("needs a disturbance on the state"),
        "{error}"
    );
}

/// The disturbance enters a state that no sensor sees.
fn hidden_disturbance() -> SwitchedPlant {
    let single = mode(
        rows([[0.5, 0.2], [0.0, 0.7]]),
        rows([[1.0], [0.5]]),
        rows([[1.0, 0.0]]),
        rows([[0.0], [1.0]]),
        rows([[0.0]]),
    );
    SwitchedPlant::new(0.1, vec![single])
}

#[test]
fn a_rank_condition_that_fails_is_named_and_auto_falls_back() {
    let plant = hidden_disturbance();
    let error = design(&plant, &spec(ObserverChoice::Uio, 0.9, Lyapunov::Common)).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("mode 1: rank(C E) = 0, but rank(E) = 1"),
        "{error}"
    );
    let found = design(&plant, &spec(ObserverChoice::Auto, 0.9, Lyapunov::Common)).unwrap();
    assert_eq!(found.observer.kind, ObserverKind::Luenberger);
    assert!(found.observer.note.unwrap().contains("rank(C E) = 0"));
}

#[test]
fn a_state_that_no_output_shows_is_named() {
    let unseen = |pole: f64| {
        SwitchedPlant::new(
            1.0,
            vec![mode(
                rows([[0.5, 0.0], [0.0, pole]]),
                rows([[1.0], [0.5]]),
                rows([[1.0, 0.0]]),
                rows([[1.0], [0.0]]),
                rows([[0.0]]),
            )],
        )
    };
    for kind in [ObserverChoice::Uio, ObserverChoice::Luenberger] {
        let request = spec(kind, 0.9, Lyapunov::Common);
        let error = design(&unseen(1.1), &request).unwrap_err().to_string();
        assert!(
            error.contains("mode 1") && error.contains("1.1000"),
            "{error}"
        );
        let slow = design(&unseen(0.95), &request).unwrap_err().to_string();
        assert!(slow.contains("above 0.9500"), "{slow}");
        design(&unseen(0.8), &request).unwrap();
    }
}

#[test]
fn random_plants_decay_under_random_switching() {
    let mut designed = 0;
    for seed in 0..30 {
        let plant = random_plant(seed, if seed % 2 == 0 { 0.1 } else { 0.01 });
        let request = spec(ObserverChoice::Auto, 0.98, Lyapunov::Switched);
        let found = match design(&plant, &request) {
            Ok(found) => found,
            Err(DesignError::Infeasible(verdict)) => {
                assert!(!verdict.blocks.is_empty());
                continue;
            }
            Err(error) => panic!("seed {seed}: {error}"),
        };
        designed += 1;
        found.verify(&plant).unwrap();
        let n = plant.dimensions().states;
        let mut error = DMatrix::from_element(n, 1, 1.0);
        let mut mode = 0;
        for k in 0..3000_usize {
            let next = (k * 7919 + seed as usize) / 3 % plant.modes.len();
            error = error_dynamics(&plant, &found, mode, next) * error;
            mode = next;
        }
        assert!(error.amax() < 1e-12, "seed {seed}: {}", error.amax());
    }
    assert!(designed >= 20, "{designed}");
}

#[test]
fn the_choice_of_units_does_not_change_the_observer() {
    let plant = paper(Channel::State);
    let request = spec(ObserverChoice::Uio, 0.5, Lyapunov::Common);
    let reference = design(&plant, &request).unwrap();
    // The same plant in units 1e6 and 1e-6 times as large.
    let nominal = Scaling {
        states: vec![1e6, 1e-6],
        inputs: vec![1e3, 1e-3],
        outputs: vec![1e6, 1e-6],
    };
    let foreign = nominal.apply(&plant);
    let found = design(&foreign, &request).unwrap();
    for (mine, theirs) in reference.spectral_radius.iter().zip(&found.spectral_radius) {
        assert!(*mine < 0.5 && *theirs < 0.5);
    }
    found.verify(&foreign).unwrap();
    let mut damaged = found.clone();
    let gain = &mut damaged.observer.gains[0];
    *gain = gain.clone().scaled(10.0);
    damaged.verify(&foreign).unwrap_err();
}
