//! A log corrects a wrong model, confirms a right one, and leaves what it does not show.

use super::windows::WINDOW;
use super::*;
use crate::commissioning::commission;
use nalgebra::DMatrix;

fn mode() -> Mode {
    Mode::new(
        DMatrix::from_row_slice(2, 2, &[0.8, 0.1, -0.2, 0.6]),
        DMatrix::from_row_slice(2, 1, &[0.5, 0.3]),
        DMatrix::from_row_slice(1, 2, &[1.0, 0.5]),
    )
    .named("one")
    .with_disturbance(
        DMatrix::from_row_slice(2, 1, &[0.2, 0.1]),
        DMatrix::zeros(1, 1),
    )
}

fn scaling() -> Scaling {
    Scaling {
        states: vec![1.0; 2],
        inputs: vec![1.0],
        outputs: vec![1.0],
    }
}

/// What a step response of the matrices differs by from the plant's, relative to the model's difference.
fn relative_error(fitted: &FittedMode, plant: &Mode, model: &Mode) -> f64 {
    let gain = |a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>| {
        let still = DMatrix::identity(2, 2) - a;
        (c * still.lu().solve(b).unwrap())[(0, 0)]
    };
    let [a, b, c] = [&fitted.a, &fitted.b, &fitted.c].map(ftc_record::dense);
    let truth = gain(&plant.a, &plant.b, &plant.c);
    (gain(&a, &b, &c) - truth).abs() / (gain(&model.a, &model.b, &model.c) - truth).abs()
}

fn fit_one(
    mode: &Mode,
    log: Database,
    disturbance: Option<RecordedDisturbance>,
    model_error: f64,
) -> Result<Fit, Unusable> {
    let modes = std::slice::from_ref(mode);
    let found = fit(modes, &[vec![log]], disturbance, model_error, &scaling());
    found
        .map(|mut all| all.remove(0))
        .map_err(|(_, unusable)| unusable)
}

fn wrong(plant: &Mode) -> Mode {
    let mut model = plant.clone();
    model.a[(0, 0)] *= 1.08;
    model.b[(1, 0)] *= 0.9;
    model
}

#[test]
fn a_log_corrects_the_model() {
    let (plant, model) = (mode(), wrong(&mode()));
    let log = commission(&plant, &[1.0], &[0.01], 1200, 4);
    let found = fit_one(&model, log, None, 0.1).unwrap();
    assert!(
        relative_error(&found.mode, &plant, &model) < 0.05,
        "{found:?}"
    );
    assert!(found.mode.fit[0] > found.mode.fit_of_model[0]);
    assert!((found.deviation[0] - 0.01).abs() < 0.002, "{found:?}");
    assert!(found.model_error < 0.05);
}

#[test]
fn a_disturbance_in_the_log_is_not_taken_for_the_plant() {
    let (plant, model) = (mode(), wrong(&mode()));
    let mut log = commission(&plant, &[1.0], &[0.01], 1200, 4);
    let mut x = DVector::zeros(2);
    for k in 0..1200 {
        log.outputs[(k, 0)] += (&plant.c * &x)[0];
        let wave = 2.0 * (core::f64::consts::TAU * k as f64 / 60.0).sin() + 1.0;
        x = &plant.a * x + &plant.e * DVector::from_element(1, wave);
    }
    let known = RecordedDisturbance {
        period: 60.0,
        count: 1,
    };
    let found = fit_one(&model, log, Some(known), 0.1).unwrap();
    assert!(
        relative_error(&found.mode, &plant, &model) < 0.1,
        "{found:?}"
    );
}

/// Two modes with three sensors; inputs, a disturbance of known period and noise move them, with a switch every
/// 150 samples.
fn switching() -> [Mode; 2] {
    let c = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 1.0, 0.5, 0.5]);
    let mode = |a: [f64; 4], b: [f64; 2], e: [f64; 2]| {
        let [b, e] = [b, e].map(|column| DMatrix::from_row_slice(2, 1, &column));
        let f = DMatrix::zeros(3, 1);
        Mode::new(DMatrix::from_row_slice(2, 2, &a), b, c.clone()).with_disturbance(e, f)
    };
    let mut other = mode([0.5, -0.2, 0.3, 0.7], [0.4, -0.2], [0.3, 0.1]);
    other.operating_point.x = vec![0.4, -0.2];
    other.operating_point.y = vec![0.4, -0.2, 0.1];
    [mode([0.8, 0.1, -0.2, 0.6], [0.5, 0.3], [0.2, 0.3]), other]
}

fn switched_log(modes: &[Mode], seed: u64) -> Vec<Vec<Database>> {
    let mut x = DVector::<f64>::zeros(2);
    let mut stretches = vec![Vec::new(); modes.len()];
    let mut u = 0.5;
    for stretch in 0..14 {
        let mode = &modes[stretch % 2];
        let point = |values: &[f64]| DVector::from_column_slice(values);
        let (x0, y0) = (
            point(&mode.operating_point.x),
            point(&mode.operating_point.y),
        );
        let at = |k: usize| 150 * stretch + k;
        let (mut inputs, mut outputs) = (DMatrix::zeros(150, 1), DMatrix::zeros(150, 3));
        for k in 0..150 {
            let mut draws = [0.0; 4];
            ftc_plant::noise::standard_normal(seed, at(k) as u64, &mut draws);
            if draws[3] > 1.0 {
                u = -u;
            }
            inputs[(k, 0)] = u;
            // The sensors' gains differ from 1 at the operating point, too.
            let y = &mode.c * &x - &y0 + 0.01 * DVector::from_column_slice(&draws[..3]);
            outputs.row_mut(k).tr_copy_from(&y);
            let w = (core::f64::consts::TAU * at(k) as f64 / 60.0 + seed as f64).sin();
            let input = DVector::from_element(1, u);
            let disturbance = DVector::from_element(1, w);
            x = &x0 + &mode.a * (&x - &x0) + &mode.b * input + &mode.e * disturbance;
        }
        stretches[stretch % 2].push(Database::new(at(0), inputs, outputs).unwrap());
    }
    stretches
}

/// Deviation of the residual of a log under such matrices, over its noise.
fn judged(modes: &[Mode], log: &[Vec<Database>], known: Option<RecordedDisturbance>) -> f64 {
    let segments = segments(log, known);
    let windows: Vec<Segment> = segments
        .iter()
        .flat_map(|segment| cut(segment, 75))
        .collect();
    let grey = GreyBox {
        modes,
        parameters: Vec::new(),
        design: DVector::zeros(0),
        prior: DVector::zeros(0),
        deviation: vec![DVector::from_element(3, 0.01); 2],
        usual: Vec::new(),
    };
    let deviations = grey.residual_deviation(&windows, &DVector::zeros(0));
    let squares: f64 = deviations.iter().map(DVector::norm_squared).sum();
    (squares / 6.0).sqrt() / 0.01
}

fn as_fitted(mode: &Mode, fit: &Fit) -> Mode {
    let mut mode = mode.clone();
    let dense = ftc_record::dense;
    (mode.a, mode.b, mode.c) = (dense(&fit.mode.a), dense(&fit.mode.b), dense(&fit.mode.c));
    (mode.e, mode.f) = (dense(&fit.mode.e), dense(&fit.mode.f));
    mode
}

/// Gains of sensors and what the disturbance moves are found, in coordinates that the modes share: judged on a
/// log that was not fitted, with switches within its windows.
///
/// promise: fitted-model
#[test]
fn wrong_output_and_disturbance_matrices_are_corrected() {
    let plant = switching();
    let mut model = plant.clone();
    for mode in &mut model {
        mode.c[(0, 0)] *= 0.92;
        mode.c[(2, 1)] *= 1.1;
        mode.e[(0, 0)] *= 1.1;
        mode.e[(1, 0)] *= 0.9;
        mode.a[(0, 0)] *= 1.05;
    }
    let known = Some(RecordedDisturbance {
        period: 60.0,
        count: 1,
    });
    let scaling = Scaling {
        outputs: vec![1.0; 3],
        ..scaling()
    };
    let found = fit(&model, &switched_log(&plant, 1), known, 0.1, &scaling).unwrap();
    assert_eq!(found[0].mode.c, found[1].mode.c);
    let fitted: Vec<Mode> = model
        .iter()
        .zip(&found)
        .map(|(mode, fit)| as_fitted(mode, fit))
        .collect();
    let fresh = switched_log(&plant, 2);
    let [of_model, of_fit, of_plant] =
        [&model[..], &fitted, &plant].map(|modes| judged(modes, &fresh, known));
    println!("residual over noise: model {of_model}, fitted {of_fit}, plant {of_plant}");
    assert!(of_model > 1.5 && of_fit < 1.05 && (of_plant - 1.0).abs() < 0.05);
    let mut only = fitted.clone();
    for (mode, model) in only.iter_mut().zip(&model) {
        mode.c.clone_from(&model.c);
    }
    assert!(judged(&only, &fresh, known) > 1.2);
    for fit in &found {
        assert!(
            fit.noise
                .iter()
                .all(|noise| (noise / 0.01 - 1.0).abs() < 0.15),
            "{:?}",
            fit.noise
        );
    }
}

/// A log that says the same as the model leaves it, and narrows its error.
#[test]
fn a_log_confirms_the_model() {
    let plant = switching();
    let scaling = Scaling {
        outputs: vec![1.0; 3],
        ..scaling()
    };
    let known = Some(RecordedDisturbance {
        period: 60.0,
        count: 1,
    });
    let log = switched_log(&plant, 3);
    for fit in fit(&plant, &log, known, 0.05, &scaling).unwrap() {
        assert!(fit.model_error < 0.025, "{fit:?}");
    }
}

#[test]
fn a_log_that_moves_nothing_leaves_the_model() {
    let model = mode();
    let log = commission(&model, &[0.0], &[0.01], 400, 4);
    let found = fit_one(&model, log, None, 0.05).unwrap();
    let a = ftc_record::dense(&found.mode.a);
    assert!((&a - &model.a).amax() < 0.02, "{a}");
    assert!(found.model_error > 0.02, "{found:?}");
}

#[test]
fn a_log_that_is_too_short_is_refused() {
    let log = commission(&mode(), &[1.0], &[0.01], 3 * WINDOW, 4);
    let found = fit_one(&mode(), log, None, 0.05);
    assert_eq!(found.unwrap_err(), Unusable::Short);
}

#[test]
fn commands_that_act_a_sample_later_are_found_out() {
    let log = commission(&mode(), &[1.0], &[0.01], 1200, 4);
    let early = Database::new(
        0,
        log.inputs.rows(1, 1199).into_owned(),
        log.outputs.rows(0, 1199).into_owned(),
    );
    let found = fit_one(&mode(), early.unwrap(), None, 0.05);
    assert_eq!(found.unwrap_err(), Unusable::Late);
}
