//! The promise survives a wrong model: gains from matrices that are off by 10 %, the estimator from
//! a healthy log of the true plant, and still as good as being told the fault.
//!
//! promise: model-error

mod common;

use common::{Channel, REFERENCES, plant, reference, scenario};
use ftc_control::Controller;
use ftc_control::parameters::EstimatorMethod;
use ftc_design::assembly::{DatabaseSource, KnownDisturbance, Request, assemble};
use ftc_design::{ControlSpec, Design, ObserverChoice, ObserverSpec, Signals, commissioning};
use ftc_plant::SwitchedPlant;
use ftc_plant::TruePlant;
use ftc_plant::noise::standard_normal;
use ftc_simulate::{PlantSimulator, Variant, run};

const DRAWS: u64 = 20;
const RESPONSE: usize = 25;

/// Every entry of `A`, `B`, `E` and `F` off by up to 10 %, each by itself.
fn disturbed(plant: &SwitchedPlant, draw: u64) -> SwitchedPlant {
    let mut wrong = plant.clone();
    for (index, mode) in wrong.modes.iter_mut().enumerate() {
        let mut numbers = vec![0.0; 32];
        standard_normal(1000 + draw, index as u64, &mut numbers);
        let mut factors = numbers.into_iter().map(|v| 1.0 + 0.1 * v.clamp(-1.0, 1.0));
        for matrix in [&mut mode.a, &mut mode.b, &mut mode.e, &mut mode.f] {
            for entry in matrix.iter_mut() {
                *entry *= factors.next().unwrap();
            }
        }
    }
    wrong
}

/// A design for `model`, with a database logged on `truth`.
fn design(
    method: EstimatorMethod,
    model: &SwitchedPlant,
    truth: &SwitchedPlant,
    noise: f64,
) -> Design {
    let dims = model.dimensions();
    let samples = RESPONSE + commissioning::commissioning_samples(dims.inputs, RESPONSE);
    let log = |(mode, seed): (&ftc_plant::Mode, u64)| {
        commissioning::commission(mode, &[1.0, 1.0], &[noise; 2], samples, seed)
    };
    let mut control = ControlSpec::unweighted(dims);
    control.decay = 0.7;
    control.integral_weight = vec![0.3; 2];
    control.input_weight = vec![0.1; 2];
    let observer = ObserverSpec::new(ObserverChoice::Auto, 0.7, ftc_design::Lyapunov::Common);
    let mut request = Request::new(
        "wrong",
        model.clone(),
        Signals::numbered(dims),
        scenario(reference("constant"), noise, 1),
    );
    request.control = control;
    request.observer = observer;
    request.estimator.method = method;
    request.estimator.response_length = Some(RESPONSE);
    request.estimator.database = DatabaseSource::Recorded(
        truth
            .modes
            .iter()
            .zip(1..)
            .map(|drawn| vec![log(drawn)])
            .collect(),
    );
    request.estimator.disturbance = Some(KnownDisturbance::new(core::f64::consts::TAU / 0.02));
    assemble(request).unwrap()
}

/// The true squared error over that of the loop told the fault, worst of all draws first.
fn ratios(method: EstimatorMethod) -> Vec<f64> {
    let mut found = Vec::new();
    for channel in [Channel::State, Channel::Output] {
        let truth = plant(channel);
        for draw in 0..DRAWS {
            let model = disturbed(&truth, draw);
            for noise in [0.0, 0.005] {
                let design = design(method, &model, &truth, noise);
                let controller = Controller::new(design.parameters()).unwrap();
                for name in REFERENCES {
                    let truth = TruePlant::Linear {
                        plant: truth.clone(),
                    };
                    let simulator = PlantSimulator::with_true_plant(
                        model.clone(),
                        truth,
                        scenario(reference(name), noise, 1),
                    );
                    let error = |variant| -> f64 {
                        run(&simulator, &controller, variant)
                            .merits(&[0, 1])
                            .iter()
                            .map(|m| m.true_output.mse)
                            .sum()
                    };
                    found.push(error(Variant::Ftc) / error(Variant::ToldTheFault));
                }
            }
        }
    }
    found.sort_by(|a, b| b.total_cmp(a));
    println!("{method:?}: worst {:.4?}", &found[..found.len() / 20]);
    found
}

#[test]
fn as_good_as_being_told_the_fault_with_matrices_wrong_by_a_tenth() {
    let found = ratios(EstimatorMethod::Reference);
    assert!(found[0] <= 1.05, "{}", found[0]);
}

/// The state-based estimator, whose model is fitted to the log.
///
/// promise: fitted-model
#[test]
fn the_same_with_the_model_fitted_to_the_log() {
    let found = ratios(EstimatorMethod::Observer);
    assert!(found[found.len() / 20] <= 1.1, "{found:?}");
}
