//! Simulation: a plant under a scenario, the closed loop, its figures of merit.
//!
//! ```
//! use ftc_control::Controller;
//! use ftc_design::{Signal, Signals, assembly::{Request, assemble}};
//! use ftc_plant::scenario::{ModeInterval, Waveform};
//! use ftc_plant::{Mode, OperatingPoint, Scenario, SwitchedPlant};
//! use ftc_simulate::{PlantSimulator, Variant, run};
//! use nalgebra::dmatrix;
//!
//! let plant = SwitchedPlant { sample_time: 1.0, modes: vec![Mode {
//!     name: "heater".into(), a: dmatrix![0.9], b: dmatrix![0.2], c: dmatrix![1.0], e: dmatrix![0.0],
//!     f: dmatrix![0.0], operating_point: OperatingPoint::zero(1, 1, 1),
//! }] };
//! let signal = |name: &str| vec![Signal { name: name.into(), unit: None, nominal: 1.0, min: None, max: None }];
//! let signals = Signals { inputs: signal("u"), outputs: signal("y"), states: signal("x"), disturbances: vec![] };
//! let zero = vec![Waveform::Constant { value: 0.0 }];
//! let scenario = Scenario {
//!     steps: 200, seed: 1, noise: vec![0.001], schedule: vec![ModeInterval { from: 0.0, mode: 0 }],
//!     reference: vec![Waveform::Constant { value: 1.0 }], fault: zero.clone(), events: vec![], disturbance: zero,
//! };
//! let design = assemble(Request::new("heater", plant, signals, scenario))?;
//! let controller = Controller::new(design.parameters())?;
//! let simulator = PlantSimulator::new(design.plant.clone(), design.scenario.clone());
//! let merits = run(&simulator, &controller, Variant::Ftc).merits(&design.controller.feedback.tracked);
//! assert!(merits[0].truth.mse < 0.05, "{:?}", merits[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod baselines;
pub mod closed_loop;
pub mod integrate;
pub mod metrics;
pub mod plant;
pub mod warnings;

pub use closed_loop::{Trajectory, Variant, run, run_with};
pub use plant::{PlantSimulator, PlantState};
