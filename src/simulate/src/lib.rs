//! Simulation: a plant under a scenario, the closed loop, its figures of merit.
//!
//! ```
//! use ftc_control::Controller;
//! use ftc_design::{Signals, assembly::{Request, assemble}};
//! use ftc_plant::{Mode, Scenario, SwitchedPlant, scenario::Waveform};
//! use ftc_simulate::{PlantSimulator, Variant, run};
//! use nalgebra::dmatrix;
//!
//! let modes = vec![Mode::new(dmatrix![0.9], dmatrix![0.2], dmatrix![1.0])];
//! let plant = SwitchedPlant::new(1.0, modes);
//! let dims = plant.dimensions();
//! let mut scenario = Scenario::new(200, vec![Waveform::Constant { value: 1.0 }], dims);
//! scenario.noise = vec![0.001];
//! let design = assemble(Request::new("heater", plant, Signals::numbered(dims), scenario))?;
//! let controller = Controller::new(design.parameters())?;
//! let simulator = PlantSimulator::new(design.plant.clone(), design.scenario.clone());
//! let merits = run(&simulator, &controller, Variant::Ftc).merits(&design.controller.feedback.tracked);
//! assert!(merits[0].true_output.mse < 0.05, "{:?}", merits[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod closed_loop;
pub mod detection;
pub mod integrate;
pub mod metrics;
pub mod plant;
pub mod robustness;
pub mod warnings;

pub use closed_loop::{Trajectory, Variant, run, run_with};
pub use plant::{PlantSimulator, PlantState};
