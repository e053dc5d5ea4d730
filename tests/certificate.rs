//! The certificate: proves what holds, refuses what does not, survives being written down.
//!
//! promise: certified-gains

mod plants;

use ftc_control::parameters::ObserverKind;
use ftc_design::certificate::{CertificateError, Enclosure};
use ftc_design::{
    ControlSpec, Lyapunov, ObserverChoice, ObserverSpec, StateFeedback, Synthesis, synthesise,
};
use ftc_plant::SwitchedPlant;
use ftc_plant::scaling::Scaling;
use nalgebra::DMatrix;
use plants::{Channel, RandomNumbers, paper, paper_spec};

fn designed(lyapunov: Lyapunov, latency: usize) -> (SwitchedPlant, Synthesis) {
    let plant = paper(Channel::State);
    let observer = ObserverSpec::new(ObserverChoice::Auto, 0.5, lyapunov);
    let control: ControlSpec = paper_spec(latency, 0.9, lyapunov);
    let synthesis = synthesise(&plant, &control, &observer, &Scaling::automatic(&plant)).unwrap();
    (plant, synthesis)
}

fn all() -> Vec<(SwitchedPlant, Synthesis)> {
    vec![
        designed(Lyapunov::Common, 0),
        designed(Lyapunov::Switched, 0),
        designed(Lyapunov::Dwell, 0),
        designed(Lyapunov::Dwell, 1),
    ]
}

#[test]
fn a_design_read_back_from_json_proves_itself() {
    for (plant, synthesis) in all() {
        let text = serde_json::to_string(&synthesis).unwrap();
        let read: Synthesis = serde_json::from_str(&text).unwrap();
        assert_eq!(read, synthesis);
        read.verify(&plant).unwrap();
    }
}

#[test]
fn a_changed_plant_is_refused() {
    for (mut plant, synthesis) in all() {
        plant.modes[1].a[(0, 0)] += 0.5;
        synthesis.state_feedback.verify(&plant).unwrap_err();
        plant.modes.pop();
        assert!(matches!(
            synthesis.verify(&plant),
            Err(CertificateError::Malformed(_))
        ));
    }
}

/// Each damage breaks a promise (or the data that proves it), and must be noticed.
#[test]
fn damage_is_refused() {
    type Damage = (&'static str, fn(&mut StateFeedback));
    let damages: [Damage; 9] = [
        ("gamma lowered by a tenth of a percent", |d| {
            for gamma in d.gamma.iter_mut().flatten() {
                *gamma *= 0.999;
            }
        }),
        ("gamma not a number", |d| {
            d.gamma.iter_mut().flatten().for_each(|g| *g = f64::NAN);
        }),
        ("decay faster than the loop's", |d| {
            let fastest = d.spectral_radius.iter().copied().fold(1.0, f64::min);
            d.spec.decay = 0.999 * fastest;
        }),
        ("gain", |d| d.modes[0].state_feedback[(0, 0)] += 1.0),
        ("integral gain", |d| d.modes[1].integral *= -1.0),
        ("Lyapunov matrix indefinite", |d| {
            let core = &mut d.certificate.lyapunov[0].core;
            core[(0, 0)] = -core[(0, 0)];
        }),
        ("Lyapunov matrix not symmetric", |d| {
            d.certificate.lyapunov[0].core[(0, 1)] += 1e-13;
        }),
        ("basis singular", |d| {
            d.certificate.lyapunov[0].basis.fill(0.0)
        }),
        ("unit that is no power of two", |d| {
            d.certificate.units.states[0] *= 1.5;
        }),
    ];
    for (plant, synthesis) in all() {
        for (what, damage) in &damages {
            let mut damaged = synthesis.state_feedback.clone();
            damage(&mut damaged);
            assert!(damaged.verify(&plant).is_err(), "not noticed: {what}");
        }
    }
}

#[test]
fn a_dwell_time_that_is_too_short_is_refused() {
    let (plant, synthesis) = designed(Lyapunov::Dwell, 1);
    let proved = synthesis.state_feedback.dwell.unwrap();
    assert!(proved.mu > 1.01);
    let mut shorter = synthesis.clone();
    shorter.state_feedback.dwell.as_mut().unwrap().samples *= 0.99;
    assert!(matches!(
        shorter.verify(&plant),
        Err(CertificateError::Malformed(_))
    ));
    let mut smaller = synthesis.clone();
    smaller.state_feedback.dwell.as_mut().unwrap().mu *= 0.999;
    assert!(matches!(
        smaller.verify(&plant),
        Err(CertificateError::Unproved(_))
    ));
    let mut absent = synthesis;
    absent.state_feedback.dwell = None;
    absent.verify(&plant).unwrap_err();
}

#[test]
fn a_damaged_observer_is_refused() {
    for (plant, synthesis) in all() {
        let mut gain = synthesis.observer.clone();
        // A filter in correction form has no other gain.
        match gain.observer.kind {
            ObserverKind::Kalman => {
                let correction = &mut gain.observer.decoupling[0][0];
                *correction = correction.clone().scaled(5.0);
            }
            _ => gain.observer.gains[0] = gain.observer.gains[0].clone().scaled(5.0),
        }
        gain.verify(&plant).unwrap_err();
        let mut decay = synthesis.observer.clone();
        decay.spec.decay = 1e-12;
        decay.verify(&plant).unwrap_err();
        let mut matrix = synthesis.observer.clone();
        matrix.certificate.lyapunov[0].0[(0, 0)] *= -1.0;
        matrix.verify(&plant).unwrap_err();
        let mut shape = synthesis.observer;
        shape.observer.decoupling.pop();
        shape.verify(&plant).unwrap_err();
    }
}

/// `Q diag(values) Q'` with random orthogonal `Q`, exactly symmetric.
fn with_spectrum(random: &mut RandomNumbers, values: &[f64]) -> DMatrix<f64> {
    let q = random.matrix(values.len(), values.len()).qr().q();
    let diagonal = DMatrix::from_diagonal(&values.to_vec().into());
    let matrix = &q * diagonal * q.transpose();
    0.5 * (&matrix + matrix.transpose())
}

#[test]
fn the_proof_agrees_with_eigenvalues_and_never_errs_on_the_wrong_side() {
    let mut random = RandomNumbers(7);
    for case in 0..400 {
        let n = random.between(2, 12);
        let mut values: Vec<f64> = (0..n).map(|_| 1.0 + random.number()).collect();
        // The smallest eigenvalue, from clearly positive through zero to clearly negative.
        let exponent = -f64::from(case % 16);
        values[0] = 10_f64.powf(exponent) * if case % 2 == 0 { 1.0 } else { -1.0 };
        let matrix = with_spectrum(&mut random, &values);
        let smallest = matrix.clone().symmetric_eigenvalues().min();
        let proved = Enclosure::exact(matrix).is_positive_definite();
        // Eigenvalues are known to about n eps here, the proof needs some times that.
        if smallest > 1e-12 {
            assert!(proved, "case {case}: {smallest}");
        }
        if smallest < -1e-14 {
            assert!(!proved, "case {case}: {smallest}");
        }
    }
}

#[test]
fn singular_and_non_finite_matrices_are_not_proved() {
    let singular = DMatrix::from_element(3, 3, 1.0);
    assert!(!Enclosure::exact(singular).is_positive_definite());
    assert!(!Enclosure::exact(DMatrix::zeros(2, 2)).is_positive_definite());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut matrix = DMatrix::identity(3, 3);
        matrix[(1, 1)] = bad;
        assert!(!Enclosure::exact(matrix).is_positive_definite());
    }
    let mut lopsided = DMatrix::identity(2, 2);
    lopsided[(0, 1)] = 1e-3;
    assert!(!Enclosure::exact(lopsided).is_positive_definite());
}

/// 1 - 2^-53 is not positive definite against an off-diagonal of 1, though it rounds to singular at
/// worst in ordinary arithmetic: the determinant is -2^-52 or so.
#[test]
fn an_eigenvalue_one_rounding_below_zero_is_not_proved() {
    let below = 1.0 - f64::EPSILON / 2.0;
    let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, below]);
    assert!(!Enclosure::exact(matrix).is_positive_definite());
    let tiny = f64::MIN_POSITIVE * f64::EPSILON;
    let underflowing = DMatrix::from_row_slice(2, 2, &[tiny, 2.0 * tiny, 2.0 * tiny, tiny]);
    assert!(!Enclosure::exact(underflowing).is_positive_definite());
}

/// The enclosure of a product contains the exact product: integers too large for a double's 53 bits
/// are multiplied exactly in 128 bits for comparison.
#[test]
fn an_enclosed_product_contains_the_exact_one() {
    let mut random = RandomNumbers(11);
    for _ in 0..200 {
        let n = random.between(1, 8);
        let integers = |random: &mut RandomNumbers| -> Vec<i128> {
            (0..n).map(|_| (random.number() * 9e15) as i128).collect()
        };
        let (row, column) = (integers(&mut random), integers(&mut random));
        let exact: i128 = row.iter().zip(&column).map(|(x, y)| x * y).sum();
        let as_matrix = |values: &[i128], r, c| {
            Enclosure::exact(DMatrix::from_iterator(
                r,
                c,
                values.iter().map(|&v| v as f64),
            ))
        };
        let product = &as_matrix(&row, 1, n) * &as_matrix(&column, n, 1);
        let (middle, radius) = (product.midpoint()[(0, 0)], product.radius()[(0, 0)]);
        let error = (exact - middle as i128).unsigned_abs() as f64;
        assert!(error <= radius, "{error} beyond {radius}");
        assert!(radius < 1e-13 * 81e30);
    }
}
