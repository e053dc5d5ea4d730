//! The one table of an FMU's variables, and what is made from it.
//!
//! A value reference is written down once: it is the position of the variable in its
//! [`VariableTable`]. The exporter turns the table into `modelDescription.xml` (feature `xml`),
//! the binary inside the FMU answers the importer's get and set calls from the same table, and
//! the slave finds its signals by [`Role`], never by name. So the XML and the binary cannot
//! disagree.
//!
//! ```text
//! design ── Interface ──> controller() / plant() ── VariableTable ──┬─> modelDescription.xml
//!                                                                   └─> the C interface (fmu-abi)
//! ```
//!
//! The crate knows no C, and of a design only its sizes and names.
//!
//! ```
//! use model_description::{Interface, SignalInfo, controller};
//!
//! let signal = |name: &str| SignalInfo { name: name.into(), ..SignalInfo::default() };
//! let table = controller(&Interface {
//!     sample_time: 2.0,
//!     stop_time: 800.0,
//!     inputs: vec![signal("pump")],
//!     outputs: vec![signal("level")],
//!     states: vec![signal("level")],
//!     tracked: vec![0],
//!     disturbances: Vec::new(),
//!     modes: 1,
//!     finds_the_mode: false,
//!     thresholds: vec![0.06],
//! });
//! table.check()?;
//! let command = table.vector("u"); // value references of u[1..m]
//! assert_eq!((command.first, command.len), (4, 1));
//! # Ok::<(), model_description::TableError>(())
//! ```

mod check;
mod design;
mod guid;
mod interface;
mod table;
mod units;
mod variable;
#[cfg(feature = "xml")]
pub mod xml;

pub use check::{Rule, TableError, Violation};
#[cfg(feature = "write")]
pub use design::write_design;
pub use design::{DESIGN_FILE, DesignFileError, read_controller, read_design};
pub use guid::{CONTROLLER, PLANT, guid};
pub use interface::{Interface, SignalInfo, controller, plant};
pub use table::{Span, VariableTable};
pub use variable::{Causality, Initial, Kind, Role, Variability, Variable};

/// Log categories an importer may switch on and off: name and description.
///
/// The names are the standard's own, so that importers know them without reading the XML.
pub const LOG_CATEGORIES: [(&str, &str); 6] = [
    ("logEvents", "Life-cycle events of the instance"),
    ("logStatusWarning", "Calls that returned fmi2Warning"),
    ("logStatusDiscard", "Calls that returned fmi2Discard"),
    ("logStatusError", "Calls that returned fmi2Error"),
    ("logStatusFatal", "Calls that returned fmi2Fatal"),
    ("logAll", "Every category"),
];
