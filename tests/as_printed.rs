//! The printed theorems are infeasible on every plant; this documents why others are built.

mod plants;

use ftc_design::as_printed::{theorem_1, theorem_2};
use ftc_design::{ControlSpec, Lyapunov};
use ftc_plant::SwitchedPlant;
use nalgebra::DMatrix;
use plants::{Channel, RandomNumbers, mode, paper, paper_spec};

#[test]
fn theorem_1_has_no_margin_on_the_papers_own_plant() {
    let verdict = theorem_1(&paper(Channel::State)).unwrap();
    assert!(!verdict.feasible);
    // Semidefinite it can be (Q and nothing else), so the best margin is zero but for rounding.
    assert!(verdict.margin.abs() < 1e-8, "{}", verdict.margin);
    assert!(!verdict.blocks.is_empty());
    assert!(verdict.reason.contains("[Q Q; Q Q]"));
}

#[test]
fn theorem_2_has_a_negative_margin_on_the_papers_own_plant() {
    let spec = paper_spec(0, 0.9, Lyapunov::Common);
    let verdict = theorem_2(&paper(Channel::State), &spec).unwrap();
    assert!(!verdict.feasible);
    assert!(verdict.margin < -0.1, "{}", verdict.margin);
    assert!(!verdict.blocks.is_empty());
}

/// However harmless the plant: stable, one mode, every state measured and actuated.
#[test]
fn no_plant_satisfies_them() {
    let mut random = RandomNumbers(3);
    for _ in 0..10 {
        let n = random.between(1, 3);
        let a = 0.1 * random.matrix(n, n);
        let identity = DMatrix::identity(n, n);
        let plant = SwitchedPlant::new(
            1.0,
            vec![mode(
                a,
                identity.clone(),
                identity,
                DMatrix::from_element(n, 1, 0.01),
                DMatrix::zeros(n, 1),
            )],
        );
        assert!(!theorem_1(&plant).unwrap().feasible);
        let spec = ControlSpec::unweighted(plant.dimensions());
        assert!(!theorem_2(&plant, &spec).unwrap().feasible);
    }
}

#[test]
fn they_need_as_many_outputs_as_states() {
    let mut plant = paper(Channel::State);
    for mode in &mut plant.modes {
        mode.c = mode.c.rows(0, 1).into_owned();
        mode.f = mode.f.rows(0, 1).into_owned();
        mode.operating_point.y.truncate(1);
    }
    let error = theorem_1(&plant).unwrap_err().to_string();
    assert_eq!(
        error,
        "equation (10) as printed needs as many outputs as states, but the plant has 1 and 2: use the corrected theorems"
    );
}
