//! What the proposed controller is compared with.
//!
//! ```
//! use ftc_baselines::comparison::Baselines;
//! use ftc_design::{Signals, assembly::{Request, assemble}};
//! use ftc_plant::{Mode, Scenario, SwitchedPlant, scenario::Waveform};
//! use ftc_simulate::PlantSimulator;
//! use nalgebra::dmatrix;
//!
//! let plant = SwitchedPlant::new(1.0, vec![Mode::new(dmatrix![0.9], dmatrix![0.2], dmatrix![1.0])]);
//! let dims = plant.dimensions();
//! let mut scenario = Scenario::new(200, vec![Waveform::Constant { value: 1.0 }], dims);
//! scenario.noise = vec![0.001];
//! let design = assemble(Request::new("heater", plant, Signals::numbered(dims), scenario))?;
//! let simulator = PlantSimulator::new(design.plant.clone(), design.scenario.clone());
//! let mut baselines = Baselines::new(&design, &simulator)?;
//! for (variant, mut closed) in baselines.loops(&simulator) {
//!     for _ in 0..150 {
//!         closed.tick();
//!         closed.advance();
//!     }
//!     closed.tick();
//!     assert!((closed.record().y_true[0] - 1.0).abs() < 0.02, "{variant:?}");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod additive;
pub mod comparison;
mod deadbeat;
pub mod predictive;

pub use additive::additive;
pub use deadbeat::{DeadbeatSum, deadbeat_bound, response_delay};
