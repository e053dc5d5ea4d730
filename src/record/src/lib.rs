//! The record of a finished design: plant, signals, controller and experiment, as plain data.
//!
//! An FMU reads it and runs on it. What proves its gains is not part of it (crate `ftc-design`), so that
//! who only runs a controller compiles and links neither synthesis nor certificates.
//!
//! ```
//! use ftc_control::parameters::{Compensation, Estimator, FeedbackGains, Observer, StateFeedback};
//! use ftc_control::{Controller, Matrix};
//! use ftc_plant::{Mode, Scenario, SwitchedPlant, scenario::Waveform};
//! use ftc_record::{ControllerDesign, DesignRecord, Signals};
//! use nalgebra::dmatrix;
//!
//! let plant = SwitchedPlant::new(1.0, vec![Mode::new(dmatrix![0.9], dmatrix![1.0], dmatrix![1.0])]);
//! let dims = plant.dimensions();
//! let one = |value: f64| Matrix::from_rows(&[[value]]);
//! let gains = FeedbackGains::new(one(-0.4), one(0.1), one(-0.4)); // K, G, K C^+
//! let controller = ControllerDesign::new(
//!     StateFeedback::new(vec![0], vec![gains]), // output 0 is tracked
//!     Observer::luenberger(vec![one(0.5)]),
//!     Estimator::none(1),
//!     Compensation::None,
//! );
//! let scenario = Scenario::new(100, vec![Waveform::Constant { value: 1.0 }], dims);
//! let record = DesignRecord::new("heater", plant, Signals::numbered(dims), controller, scenario);
//! record.check()?;
//! let controller = Controller::new(record.parameters())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod matrices;
mod record;

pub use matrices::{dense, mode_models, plain};
pub use record::{ControllerDesign, DesignRecord, FORMAT, RecordError, Signal, Signals};
