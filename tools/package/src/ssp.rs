//! `export --ssp`: controller, plant and their connections in one file (SSP 1.0).
//!
//! A connection is not listed anywhere: an output goes to every input of another component that
//! has the same role and the same place in its vector.

use model_description::xml::{GENERATION_TIME, base_unit};
use model_description::{Causality, Kind, Variable, VariableTable};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use std::collections::BTreeSet;
use std::io;

/// One FMU of the system.
pub struct Component<'a> {
    /// What the system calls it.
    pub name: &'a str,
    /// Its path in the package.
    pub source: String,
    /// Its variables.
    pub table: VariableTable,
}

/// The system as a whole.
pub struct System<'a> {
    /// Its name.
    pub name: &'a str,
    /// One line about it.
    pub description: &'a str,
    /// End of the default experiment in seconds, after 0.
    pub stop_time: f64,
    /// `Te` in seconds, the communication step that a master should take.
    pub step_size: f64,
    /// Its FMUs.
    pub components: Vec<Component<'a>>,
}

/// Where an SSP package keeps its description.
pub const DESCRIPTION: &str = "SystemStructure.ssd";

/// Where an SSP package keeps its FMUs.
pub const RESOURCES: &str = "resources";

type Xml = Writer<Vec<u8>>;

/// Writes `SystemStructure.ssd`.
///
/// # Errors
/// What the XML writer says.
pub fn describe(system: &System) -> io::Result<Vec<u8>> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    xml.create_element("ssd:SystemStructureDescription")
        .with_attributes([
            (
                "xmlns:ssd",
                "http://ssp-standard.org/SSP1/SystemStructureDescription",
            ),
            (
                "xmlns:ssc",
                "http://ssp-standard.org/SSP1/SystemStructureCommon",
            ),
            (
                "xmlns:osp",
                "http://opensimulationplatform.com/SSP/OSPAnnotations",
            ),
            (
                "xmlns:oms",
                "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
            ),
            ("version", "1.0"),
            ("name", system.name),
            (
                "generationTool",
                concat!("ftc-fmu ", env!("CARGO_PKG_VERSION")),
            ),
            ("generationDateAndTime", GENERATION_TIME),
        ])
        .write_inner_content(|xml| {
            write_system(xml, system)?;
            write_units(xml, system)?;
            write_experiment(xml, system)
        })?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

fn write_system(xml: &mut Xml, system: &System) -> io::Result<()> {
    let connections = &connections(&system.components);
    element(
        xml,
        "ssd:System",
        |xml| {
            element(
                xml,
                "ssd:Elements",
                |xml| {
                    let mut components = system.components.iter();
                    components
                        .try_for_each(|component| write_component(xml, component, connections))
                },
                [],
            )?;
            element(
                xml,
                "ssd:Connections",
                |xml| {
                    let mut connections = connections.iter();
                    connections.try_for_each(|ends| write_connection(xml, *ends))
                },
                [],
            )?;
            element(
                xml,
                "ssd:Annotations",
                |xml| write_for_openmodelica(xml, system),
                [],
            )
        },
        [("name", system.name), ("description", system.description)],
    )
}

/// Inputs that nothing is connected to are left to their start values: masters set connectors
/// that are not connected to 0, or wire them to something.
fn write_component(xml: &mut Xml, component: &Component, connections: &[Ends]) -> io::Result<()> {
    let offered = |variable: &Variable| {
        let end = (component.name, variable.name.as_str());
        variable.causality != Causality::Input || connections.iter().any(|[_, to]| *to == end)
    };
    let attributes = [
        ("name", component.name),
        ("type", "application/x-fmu-sharedlibrary"),
        ("source", &component.source),
    ];
    element(
        xml,
        "ssd:Component",
        |xml| {
            element(
                xml,
                "ssd:Connectors",
                |xml| {
                    let mut variables = component
                        .table
                        .iter()
                        .filter(|(_, variable)| offered(variable));
                    variables.try_for_each(|(_, variable)| write_connector(xml, variable))
                },
                [],
            )
        },
        attributes,
    )
}

fn write_connector(xml: &mut Xml, variable: &Variable) -> io::Result<()> {
    let kind = match variable.causality {
        Causality::Input => "input",
        Causality::Output => "output",
        Causality::Parameter => "parameter",
    };
    let value = match variable.kind {
        Kind::Real { .. } => "ssc:Real",
        Kind::Integer { .. } => "ssc:Integer",
        Kind::Boolean => "ssc:Boolean",
    };
    let unit = unit(variable).map(|unit| ("unit", unit));
    let attributes = [("name", variable.name.as_str()), ("kind", kind)];
    element(
        xml,
        "ssd:Connector",
        |xml| leaf(xml, value, unit),
        attributes,
    )
}

fn unit(variable: &Variable) -> Option<&str> {
    match &variable.kind {
        Kind::Real { unit, .. } => unit.as_deref(),
        _ => None,
    }
}

/// Each unit of a connector; one that is not known has an empty base unit, as the standard wants
/// one.
fn write_units(xml: &mut Xml, system: &System) -> io::Result<()> {
    let tables = system.components.iter().map(|component| &component.table);
    let variables = tables.flat_map(|table| table.iter());
    let units: BTreeSet<&str> = variables
        .filter_map(|(_, variable)| unit(variable))
        .collect();
    if units.is_empty() {
        return Ok(());
    }
    element(
        xml,
        "ssd:Units",
        |xml| {
            units.iter().try_for_each(|unit| {
                let base = base_unit(unit).unwrap_or_default();
                let base = base.iter().map(|(name, value)| (*name, value.as_str()));
                element(
                    xml,
                    "ssc:Unit",
                    |xml| leaf(xml, "ssc:BaseUnit", base),
                    [("name", *unit)],
                )
            })
        },
        [],
    )
}

/// Both ends of a connection: component and variable, from an output to an input.
type Ends<'a> = [(&'a str, &'a str); 2];

fn connections<'a>(components: &'a [Component]) -> Vec<Ends<'a>> {
    let mut found = Vec::new();
    for from in components {
        for (reference, output) in from.table.outputs() {
            let place = reference - from.table.span(output.role).first;
            for to in components {
                let input = to.table.span(output.role);
                let input = (place < input.len).then(|| to.table.get(input.first + place));
                found.extend(
                    input
                        .flatten()
                        .filter(|input| input.causality == Causality::Input)
                        .map(|input| {
                            [
                                (from.name, output.name.as_str()),
                                (to.name, input.name.as_str()),
                            ]
                        }),
                );
            }
        }
    }
    found
}

fn write_connection(xml: &mut Xml, [from, to]: Ends) -> io::Result<()> {
    let ends = [
        ("startElement", from.0),
        ("startConnector", from.1),
        ("endElement", to.0),
        ("endConnector", to.1),
    ];
    leaf(xml, "ssd:Connection", ends)
}

/// The standard knows start and stop; the communication step is said in the annotations of two
/// masters (no attribute may stand at the `Algorithm` of the Open Simulation Platform). Others
/// ignore them.
fn write_experiment(xml: &mut Xml, system: &System) -> io::Result<()> {
    let stop_time = format!("{:?}", system.stop_time);
    let step_size = format!("{:?}", system.step_size);
    let times = [("startTime", "0.0"), ("stopTime", stop_time.as_str())];
    element(
        xml,
        "ssd:DefaultExperiment",
        |xml| {
            element(
                xml,
                "ssd:Annotations",
                |xml| {
                    let step = [("baseStepSize", step_size.as_str())];
                    element(
                        xml,
                        "ssc:Annotation",
                        |xml| {
                            element(
                                xml,
                                "osp:Algorithm",
                                |xml| leaf(xml, "osp:FixedStepAlgorithm", step),
                                [],
                            )
                        },
                        [("type", "com.opensimulationplatform")],
                    )?;
                    write_for_openmodelica(xml, system)
                },
                [],
            )
        },
        times,
    )
}

/// The master and its step, as OMSimulator reads them: it takes no package without.
fn write_for_openmodelica(xml: &mut Xml, system: &System) -> io::Result<()> {
    let step_size = format!("{:?}", system.step_size);
    let master = [
        ("description", "oms-ma"),
        ("stepSize", step_size.as_str()),
        ("absoluteTolerance", "1e-4"),
        ("relativeTolerance", "1e-4"),
    ];
    element(
        xml,
        "ssc:Annotation",
        |xml| {
            element(
                xml,
                "oms:Annotations",
                |xml| {
                    element(
                        xml,
                        "oms:SimulationInformation",
                        |xml| leaf(xml, "oms:FixedStepMaster", master),
                        [],
                    )
                },
                [],
            )
        },
        [("type", "org.openmodelica")],
    )
}

/// An element with children.
fn element<'a>(
    xml: &mut Xml,
    name: &str,
    children: impl FnOnce(&mut Xml) -> io::Result<()>,
    attributes: impl IntoIterator<Item = (&'a str, &'a str)>,
) -> io::Result<()> {
    let element = xml.create_element(name).with_attributes(attributes);
    element.write_inner_content(children).map(drop)
}

/// An element without.
fn leaf<'a>(
    xml: &mut Xml,
    name: &str,
    attributes: impl IntoIterator<Item = (&'a str, &'a str)>,
) -> io::Result<()> {
    xml.create_element(name)
        .with_attributes(attributes)
        .write_empty()
        .map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_description::{Interface, SignalInfo};

    fn system() -> System<'static> {
        let signals = |count| vec![SignalInfo::default(); count];
        let measured = |unit: &str| SignalInfo {
            unit: unit.into(),
            ..SignalInfo::default()
        };
        let interface = Interface {
            sample_time: 0.1,
            stop_time: 10.0,
            inputs: signals(2),
            outputs: ["V", "degC", "furlong"].map(measured).into(),
            states: signals(4),
            tracked: vec![0, 2],
            disturbances: vec![SignalInfo::default()],
            modes: 2,
            finds_the_mode: false,
            thresholds: vec![1.0; 3],
        };
        let component = |name: &'static str, table| Component {
            name,
            source: format!("{RESOURCES}/{name}.fmu"),
            table,
        };
        System {
            name: "example",
            description: "An \"example\" & its loop",
            stop_time: 10.0,
            step_size: 0.1,
            components: vec![
                component("controller", model_description::controller(&interface)),
                component("plant", model_description::plant(&interface)),
            ],
        }
    }

    #[test]
    fn every_signal_of_the_loop_is_connected_once() {
        let system = system();
        let mut named: Vec<String> = connections(&system.components)
            .iter()
            .map(|[from, to]| format!("{}.{} {}.{}", from.0, from.1, to.0, to.1))
            .collect();
        named.sort();
        let expected = [
            "controller.u[1] plant.u[1]",
            "controller.u[2] plant.u[2]",
            "plant.mode controller.mode",
            "plant.mode_real controller.mode_real",
            "plant.y[1] controller.y[1]",
            "plant.y[2] controller.y[2]",
            "plant.y[3] controller.y[3]",
            "plant.y_ref[1] controller.y_ref[1]",
            "plant.y_ref[2] controller.y_ref[2]",
        ];
        assert_eq!(named, expected);
    }

    #[test]
    fn the_description_is_well_formed_and_names_what_it_connects() {
        let bytes = describe(&system()).unwrap();
        assert_eq!(bytes, describe(&system()).unwrap());
        let text = String::from_utf8(bytes).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        let elements = |name| {
            document
                .descendants()
                .filter(move |node| node.tag_name().name() == name)
        };
        let connectors: Vec<(&str, &str)> = elements("Connector")
            .map(|node| {
                let component = node.parent_element().unwrap().parent_element().unwrap();
                (
                    component.attribute("name").unwrap(),
                    node.attribute("name").unwrap(),
                )
            })
            .collect();
        for connection in elements("Connection") {
            for end in ["start", "end"] {
                let part = |what| {
                    connection
                        .attribute(format!("{end}{what}").as_str())
                        .unwrap()
                };
                assert!(connectors.contains(&(part("Element"), part("Connector"))));
            }
        }
        for unused in ["f_ext[1]", "w_ext[1]", "mode_ext", "mode_ext_real"] {
            assert!(!connectors.contains(&("plant", unused)), "{unused}");
        }
        assert!(connectors.contains(&("controller", "fault_real[3]")));
        let with_unit = elements("Real").filter(|node| node.attribute("unit") == Some("degC"));
        // y, f_hat, residual and threshold of the controller; y, y_true and f of the plant.
        assert_eq!(with_unit.count(), 7);
        let units: Vec<_> = elements("Unit")
            .map(|node| {
                let base = node.first_element_child().unwrap();
                (
                    node.attribute("name").unwrap(),
                    base.attribute("offset"),
                    base.attribute("K"),
                )
            })
            .collect();
        let expected = [
            ("V", None, None),
            ("degC", Some("273.15"), Some("1")),
            ("furlong", None, None),
        ];
        assert_eq!(units, expected);
        // In the system, where OMSimulator looks, and beside the other's.
        let masters: Vec<_> = elements("FixedStepMaster").collect();
        assert_eq!(masters.len(), 2);
        assert!(
            masters
                .iter()
                .all(|master| master.attribute("stepSize") == Some("0.1"))
        );
        let sources: Vec<_> = elements("Component")
            .filter_map(|node| node.attribute("source"))
            .collect();
        assert_eq!(sources, ["resources/controller.fmu", "resources/plant.fmu"]);
        assert_eq!(
            elements("System").next().unwrap().attribute("description"),
            Some("An \"example\" & its loop")
        );
    }
}
