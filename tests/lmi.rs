//! The modelling layer, on problems whose answers are known.

mod plants;

use ftc_design::lmi::{Affine, Inequality, Problem};
use ftc_design::{BlockKind, BlockName};
use nalgebra::DMatrix;
use plants::RandomNumbers;

fn name(mode: usize) -> BlockName {
    BlockName::new(BlockKind::Lyapunov, mode, mode)
}

/// `t I - A >= 0`: the least `t` is the largest eigenvalue.
#[test]
fn the_largest_eigenvalue_is_a_minimum() {
    let mut random = RandomNumbers(1);
    for n in 1..8 {
        let root = random.matrix(n, n);
        let a = &root + root.transpose();
        let mut problem = Problem::new();
        let t = problem.scalar();
        let gap = t.times_identity(n) - Affine::from(a.clone());
        problem.require(Inequality::new(name(0), vec![vec![Some(gap)]]));
        let found = problem.minimise(&t).unwrap();
        let exact = a.symmetric_eigenvalues().max();
        assert!((found.objective - exact).abs() < 1e-7);
        assert!((found.bound - exact).abs() < 1e-7);
    }
}

/// The least norm of `M - L X R - (P X')'` over `X` is zero and found where `X` is unique; every
/// operation of an expression takes part.
#[test]
fn products_and_transposes_mean_what_they_say() {
    let mut random = RandomNumbers(2);
    for _ in 0..10 {
        let (rows, columns) = (random.between(1, 4), random.between(1, 4));
        let wanted = random.matrix(rows, columns);
        let left = DMatrix::identity(rows, rows) * 3.0 + random.matrix(rows, rows);
        let right = DMatrix::identity(columns, columns) * 3.0 + random.matrix(columns, columns);
        let other = 0.1 * random.matrix(columns, columns);
        let target = &left * &wanted * &right + (&other * wanted.transpose()).transpose();

        let mut problem = Problem::new();
        let x = problem.full(rows, columns);
        let t = problem.scalar();
        let error = Affine::from(target)
            - (&left * &x) * &right
            - (&other * x.expression().transpose()).transpose();
        problem.require(Inequality::new(
            name(0),
            vec![
                vec![Some(t.times_identity(columns))],
                vec![Some(error), Some(t.times_identity(rows))],
            ],
        ));
        let found = problem.minimise(&t).unwrap();
        assert!(found.objective.abs() < 1e-7);
        assert!((x.value(&found.scalars) - wanted).amax() < 1e-6);
    }
}

/// `P > 0`, `P - A'PA > 0` has a margin if and only if the spectral radius of `A` is below one, and
/// the multipliers add up to one.
#[test]
fn the_margin_decides_stability() {
    let mut random = RandomNumbers(3);
    for case in 0..40 {
        let n = random.between(1, 5);
        let shape = random.matrix(n, n);
        let radius = ftc_plant::spectral_radius(&shape);
        let wanted = if case % 2 == 0 { 0.97 } else { 1.03 };
        let a = shape * (wanted / radius);
        let mut problem = Problem::new();
        let p = problem.symmetric(n);
        let decrease = p.expression() - (&a.transpose() * &p) * &a;
        problem.require(Inequality::new(name(0), vec![vec![Some(p.expression())]]));
        problem.require(Inequality::new(name(1), vec![vec![Some(decrease)]]));
        problem.require_trace(&[p.expression()], n as f64);
        let margin = problem.margin().unwrap();
        assert_eq!(
            margin.margin > 1e-8,
            wanted < 1.0,
            "case {case}: {}",
            margin.margin
        );
        let total: f64 = margin.weights.iter().map(|(_, weight)| weight).sum();
        assert!((total - 1.0).abs() < 1e-9);
        assert!(margin.weights.iter().all(|(_, weight)| *weight > -1e-9));
        assert!((p.value(&margin.scalars).trace() - n as f64).abs() < 1e-6);
    }
}

/// Two demands on one number that exclude each other: the margin is half the gap, and both carry it.
#[test]
fn a_contradiction_is_shared_by_those_who_cause_it() {
    let mut problem = Problem::new();
    let x = problem.scalar();
    let number = |value: f64| Affine::from(DMatrix::from_element(1, 1, value));
    let above = x.expression() - number(1.0);
    let below = number(-1.0) - x.expression();
    let idle = x.expression() + number(50.0);
    problem.require(Inequality::new(name(0), vec![vec![Some(above)]]));
    problem.require(Inequality::new(name(1), vec![vec![Some(below)]]));
    problem.require(Inequality::new(name(2), vec![vec![Some(idle)]]));
    let margin = problem.margin().unwrap();
    assert!((margin.margin + 1.0).abs() < 1e-7);
    let weights: Vec<f64> = margin.weights.iter().map(|(_, weight)| *weight).collect();
    assert!((weights[0] - 0.5).abs() < 1e-6 && (weights[1] - 0.5).abs() < 1e-6);
    assert!(weights[2].abs() < 1e-6);
}

/// The same problem gives the same bits.
#[test]
fn solving_is_deterministic() {
    let solve = || {
        let mut random = RandomNumbers(9);
        let a = 0.5 * random.matrix(4, 4);
        let mut problem = Problem::new();
        let p = problem.symmetric(4);
        let next = &a * &p;
        problem.require(Inequality::new(
            name(0),
            vec![
                vec![Some(p.expression())],
                vec![Some(next), Some(p.expression())],
            ],
        ));
        problem.require_trace(&[p.expression()], 4.0);
        problem.margin().unwrap().scalars
    };
    let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    assert_eq!(bits(solve()), bits(solve()));
}

/// The interior-point method that uses the structure and the general solver find the same margin of an
/// observer's inequalities, feasible or not.
#[test]
fn both_solvers_find_the_same_margin() {
    let mut random = RandomNumbers(17);
    let mut infeasible = 0;
    for case in 0..30 {
        let (n, p) = (random.between(1, 5), random.between(1, 3));
        let shape = random.matrix(n, n);
        let a = &shape * (1.4 / ftc_plant::spectral_radius(&shape));
        let c = match case % 3 {
            0 => DMatrix::zeros(p, n),
            _ => random.matrix(p, n),
        };
        let mut problem = Problem::new();
        let (lyapunov, injection) = (problem.symmetric(n), problem.full(n, p));
        let error = lyapunov.expression() * &a - injection.expression() * &c;
        let own = 0.81 * lyapunov.expression();
        let rows = vec![
            vec![Some(own)],
            vec![Some(error), Some(lyapunov.expression())],
        ];
        problem.require(Inequality::new(name(0), rows));
        problem.require_trace(&[lyapunov.expression()], n as f64);
        let (structured, general) = (
            problem.margin().unwrap().margin,
            problem.margin_by_general_solver().unwrap().margin,
        );
        assert!(
            (structured - general).abs() < 1e-6 + 1e-3 * general.abs(),
            "case {case}: {structured} {general}"
        );
        infeasible += usize::from(general < 1e-8);
    }
    assert!(infeasible >= 10, "{infeasible} infeasible cases");
}
