//! `modelDescription.xml`, made from a table.
//!
//! The writing is deterministic: the same table gives the same bytes, and the generation time
//! is a constant, so that the same design always gives the same FMU.

use crate::units::{BASE, display_factor, meaning};
use crate::{Initial, Kind, LOG_CATEGORIES, TableError, Variability, Variable, VariableTable};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use std::collections::BTreeMap;
use std::io;

/// The time stamp of every description: a constant, for reproducible bytes.
pub const GENERATION_TIME: &str = "2026-01-01T00:00:00Z";

/// Everything in a description besides the variables.
#[derive(Clone, Debug)]
#[expect(
    clippy::exhaustive_structs,
    reason = "whoever writes a description must say all of it"
)]
pub struct Document<'a> {
    /// Name of the model, for a person.
    pub model_name: &'a str,
    /// Name of the binary without its extension; a C identifier.
    pub model_identifier: &'a str,
    /// One line about the model.
    pub description: &'a str,
    /// See [`crate::guid`].
    pub guid: &'a str,
    /// Version of the model.
    pub version: &'a str,
    /// Licence of the model.
    pub license: &'a str,
    /// `Te` in seconds, the preferred communication step.
    pub step_size: f64,
    /// End of the default experiment in seconds, after 0.
    pub stop_time: f64,
    /// Whether the binary computes directional derivatives.
    pub directional_derivative: bool,
    /// The variables.
    pub table: &'a VariableTable,
}

type Attributes = Vec<(&'static str, String)>;

/// Why a description cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XmlError {
    /// Times that make no sense, in seconds.
    #[error("stepSize {step_size} and stopTime {stop_time} must be positive numbers of seconds")]
    Times {
        /// The preferred communication step.
        step_size: f64,
        /// End of the default experiment.
        stop_time: f64,
    },
    /// The model identifier names functions and files, but is no C identifier.
    #[error("the model identifier '{0}' is no C identifier: use letters, digits and _")]
    Identifier(String),
    /// What is wrong with the table of variables.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The writer fails.
    #[error(transparent)]
    Write(#[from] io::Error),
    /// What was written is not UTF-8.
    #[error(transparent)]
    NotUtf8(#[from] std::string::FromUtf8Error),
}

/// Writes the description.
///
/// # Errors
/// A table or times that make no sense (see [`VariableTable::check`]); the error names every problem.
pub fn write(document: &Document) -> Result<String, XmlError> {
    check(document)?;
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    write_document(&mut writer, document)?;
    let mut bytes = writer.into_inner();
    bytes.push(b'\n');
    Ok(String::from_utf8(bytes)?)
}

fn check(document: &Document) -> Result<(), XmlError> {
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if !(positive(document.step_size) && positive(document.stop_time)) {
        return Err(XmlError::Times {
            step_size: document.step_size,
            stop_time: document.stop_time,
        });
    }
    let mut letters = document.model_identifier.chars();
    let first = letters
        .next()
        .is_some_and(|c| c == '_' || c.is_ascii_alphabetic());
    if !(first && letters.all(|c| c == '_' || c.is_ascii_alphanumeric())) {
        return Err(XmlError::Identifier(document.model_identifier.to_string()));
    }
    Ok(document.table.check()?)
}

fn write_document(writer: &mut Writer<Vec<u8>>, document: &Document) -> io::Result<()> {
    writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let attributes: Attributes = vec![
        ("fmiVersion", "2.0".into()),
        ("modelName", document.model_name.into()),
        ("guid", document.guid.into()),
        ("description", document.description.into()),
        ("version", document.version.into()),
        ("license", document.license.into()),
        (
            "generationTool",
            concat!("ftc-fmu ", env!("CARGO_PKG_VERSION")).into(),
        ),
        ("generationDateAndTime", GENERATION_TIME.into()),
        ("variableNamingConvention", "structured".into()),
        ("numberOfEventIndicators", "0".into()),
    ];
    parent(writer, "fmiModelDescription", attributes, |writer| {
        leaf(writer, "CoSimulation", capabilities(document))?;
        write_units(writer, document.table)?;
        parent(writer, "LogCategories", vec![], |writer| {
            LOG_CATEGORIES.iter().try_for_each(|(name, description)| {
                let attributes = vec![
                    ("name", (*name).into()),
                    ("description", (*description).into()),
                ];
                leaf(writer, "Category", attributes)
            })
        })?;
        let experiment = vec![
            ("startTime", number(0.0)),
            ("stopTime", number(document.stop_time)),
            ("stepSize", number(document.step_size)),
        ];
        leaf(writer, "DefaultExperiment", experiment)?;
        parent(writer, "ModelVariables", vec![], |writer| {
            let mut variables = document.table.iter();
            variables
                .try_for_each(|(reference, variable)| write_variable(writer, reference, variable))
        })?;
        write_structure(writer, document.table)
    })
}

fn capabilities(document: &Document) -> Attributes {
    let flag = |name, value: bool| (name, value.to_string());
    vec![
        ("modelIdentifier", document.model_identifier.into()),
        flag("needsExecutionTool", false),
        flag("canHandleVariableCommunicationStepSize", true),
        // Inputs are sampled at the ticks and held: there is nothing to interpolate.
        flag("canInterpolateInputs", false),
        ("maxOutputDerivativeOrder", "0".into()),
        flag("canRunAsynchronuously", false),
        flag("canBeInstantiatedOnlyOncePerProcess", false),
        flag("canNotUseMemoryManagementFunctions", true),
        flag("canGetAndSetFMUstate", true),
        flag("canSerializeFMUstate", true),
        flag(
            "providesDirectionalDerivative",
            document.directional_derivative,
        ),
    ]
}

/// Declares each unit in use once, in alphabetical order, with its display units.
fn write_units(writer: &mut Writer<Vec<u8>>, table: &VariableTable) -> io::Result<()> {
    let mut units: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (_, variable) in table.iter() {
        if let Kind::Real {
            unit: Some(unit),
            display_unit,
            ..
        } = &variable.kind
        {
            let displays = units.entry(unit).or_default();
            let new = display_unit.as_deref().filter(|d| !displays.contains(d));
            displays.extend(new);
        }
    }
    if units.is_empty() {
        return Ok(());
    }
    parent(writer, "UnitDefinitions", vec![], |writer| {
        units
            .iter()
            .try_for_each(|(unit, displays)| write_unit(writer, unit, displays))
    })
}

/// The attributes of a unit's `BaseUnit` in FMI and SSP: powers of SI base units, factor and
/// offset; none for a unit that is not known.
pub fn base_unit(unit: &str) -> Option<Vec<(&'static str, String)>> {
    let meaning = meaning(unit)?;
    let mut attributes: Attributes = BASE
        .iter()
        .zip(meaning.exponents)
        .filter(|(_, exponent)| *exponent != 0)
        .map(|(base, exponent)| (*base, exponent.to_string()))
        .collect();
    for (name, value, usual) in [
        ("factor", meaning.factor, 1.0),
        ("offset", meaning.offset, 0.0),
    ] {
        attributes.extend((value != usual).then(|| (name, number(value))));
    }
    Some(attributes)
}

/// Declares one unit with those of the wanted display units that are known for it.
fn write_unit(writer: &mut Writer<Vec<u8>>, unit: &str, displays: &[&str]) -> io::Result<()> {
    parent(writer, "Unit", vec![("name", unit.to_string())], |writer| {
        if let Some(attributes) = base_unit(unit) {
            leaf(writer, "BaseUnit", attributes)?;
        }
        displays.iter().try_for_each(|display| {
            let attributes = vec![
                ("name", display.to_string()),
                ("factor", number(display_factor(unit, display))),
            ];
            leaf(writer, "DisplayUnit", attributes)
        })
    })
}

fn write_variable(
    writer: &mut Writer<Vec<u8>>,
    reference: u32,
    variable: &Variable,
) -> io::Result<()> {
    let mut attributes: Attributes = vec![
        ("name", variable.name.clone()),
        ("valueReference", reference.to_string()),
        ("description", variable.description.clone()),
        ("causality", variable.causality.word().into()),
        ("variability", variability(variable.variability).into()),
    ];
    let initial = variable.initial();
    attributes.extend(initial.map(|initial| match initial {
        Initial::Exact => ("initial", "exact".to_string()),
        Initial::Calculated => ("initial", "calculated".to_string()),
    }));
    let with_start = initial != Some(Initial::Calculated);
    let (element, kind) = kind_element(variable, with_start);
    parent(writer, "ScalarVariable", attributes, |writer| {
        leaf(writer, element, kind)
    })
}

/// Element name and attributes of the type; the start value only where the standard allows it.
fn kind_element(variable: &Variable, with_start: bool) -> (&'static str, Attributes) {
    let mut attributes = Attributes::new();
    let mut add = |name, value: Option<String>| attributes.extend(value.map(|v| (name, v)));
    let start = with_start.then_some(variable.start);
    let element = match &variable.kind {
        Kind::Real {
            unit,
            display_unit,
            nominal,
            min,
            max,
            relative,
        } => {
            add("unit", unit.clone());
            add("displayUnit", display_unit.clone());
            // The standard ties this attribute to a unit.
            add(
                "relativeQuantity",
                (*relative && unit.is_some()).then(|| "true".into()),
            );
            add("min", min.map(number));
            add("max", max.map(number));
            add("nominal", nominal.map(number));
            add("start", start.map(number));
            "Real"
        }
        Kind::Integer { min, max } => {
            add("min", min.map(|value| value.to_string()));
            add("max", max.map(|value| value.to_string()));
            add("start", start.map(|value| (value as i32).to_string()));
            "Integer"
        }
        Kind::Boolean => {
            add("start", start.map(|value| (value != 0.0).to_string()));
            "Boolean"
        }
    };
    (element, attributes)
}

/// Outputs and initial unknowns, both in index order and with explicit dependencies.
fn write_structure(writer: &mut Writer<Vec<u8>>, table: &VariableTable) -> io::Result<()> {
    let outputs: Vec<_> = table.outputs().collect();
    if outputs.is_empty() {
        return leaf(writer, "ModelStructure", vec![]);
    }
    let list = |writer: &mut Writer<Vec<u8>>, name, of: fn(&Variable) -> &[u32]| {
        parent(writer, name, vec![], |writer| {
            outputs.iter().try_for_each(|(reference, variable)| {
                let indices: Vec<String> =
                    of(variable).iter().map(|r| (r + 1).to_string()).collect();
                let attributes = vec![
                    ("index", (reference + 1).to_string()),
                    ("dependencies", indices.join(" ")),
                ];
                leaf(writer, "Unknown", attributes)
            })
        })
    };
    parent(writer, "ModelStructure", vec![], |writer| {
        list(writer, "Outputs", |variable| &variable.dependencies)?;
        list(writer, "InitialUnknowns", |variable| {
            &variable.initial_dependencies
        })
    })
}

fn variability(variability: Variability) -> &'static str {
    match variability {
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
    }
}

/// The shortest decimal that reads back as the same double.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn parent(
    writer: &mut Writer<Vec<u8>>,
    name: &str,
    attributes: Attributes,
    children: impl FnOnce(&mut Writer<Vec<u8>>) -> io::Result<()>,
) -> io::Result<()> {
    let element = writer
        .create_element(name)
        .with_attributes(borrow(&attributes));
    element.write_inner_content(children).map(|_| ())
}

fn leaf(writer: &mut Writer<Vec<u8>>, name: &str, attributes: Attributes) -> io::Result<()> {
    let element = writer
        .create_element(name)
        .with_attributes(borrow(&attributes));
    element.write_empty().map(|_| ())
}

fn borrow(attributes: &Attributes) -> impl Iterator<Item = (&str, &str)> {
    attributes
        .iter()
        .map(|(name, value)| (*name, value.as_str()))
}
