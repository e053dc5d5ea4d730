//! `export --ssp`: controller, plant and their connections in one file (SSP 1.0).
//!
//! A connection is not listed anywhere: an output goes to every input of another component that
//! has the same role and the same place in its vector.

use model_description::xml::GENERATION_TIME;
use model_description::{Causality, Kind, VariableTable};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
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
            write_experiment(xml, system)
        })?;
    let mut bytes = xml.into_inner();
    bytes.push(b'\n');
    Ok(bytes)
}

fn write_system(xml: &mut Xml, system: &System) -> io::Result<()> {
    xml.create_element("ssd:System")
        .with_attributes([("name", system.name), ("description", system.description)])
        .write_inner_content(|xml| {
            xml.create_element("ssd:Elements")
                .write_inner_content(|xml| {
                    let mut components = system.components.iter();
                    components.try_for_each(|component| write_component(xml, component))
                })?;
            xml.create_element("ssd:Connections")
                .write_inner_content(|xml| {
                    let mut connections = connections(&system.components).into_iter();
                    connections.try_for_each(|ends| write_connection(xml, ends))
                })
                .map(drop)
        })
        .map(drop)
}

fn write_component(xml: &mut Xml, component: &Component) -> io::Result<()> {
    xml.create_element("ssd:Component")
        .with_attributes([
            ("name", component.name),
            ("type", "application/x-fmu-sharedlibrary"),
            ("source", &component.source),
        ])
        .write_inner_content(|xml| {
            xml.create_element("ssd:Connectors")
                .write_inner_content(|xml| {
                    component.table.iter().try_for_each(|(_, variable)| {
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
                        xml.create_element("ssd:Connector")
                            .with_attributes([("name", variable.name.as_str()), ("kind", kind)])
                            .write_inner_content(|xml| {
                                xml.create_element(value).write_empty().map(drop)
                            })
                            .map(drop)
                    })
                })
                .map(drop)
        })
        .map(drop)
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
    xml.create_element("ssd:Connection")
        .with_attributes([
            ("startElement", from.0),
            ("startConnector", from.1),
            ("endElement", to.0),
            ("endConnector", to.1),
        ])
        .write_empty()
        .map(drop)
}

/// The standard knows start and stop; the communication step is said in the annotation that the
/// Open Simulation Platform reads (no attribute may stand at its `Algorithm`). Others ignore it.
fn write_experiment(xml: &mut Xml, system: &System) -> io::Result<()> {
    let stop_time = format!("{:?}", system.stop_time);
    let step_size = format!("{:?}", system.step_size);
    xml.create_element("ssd:DefaultExperiment")
        .with_attributes([("startTime", "0.0"), ("stopTime", stop_time.as_str())])
        .write_inner_content(|xml| {
            xml.create_element("ssd:Annotations")
                .write_inner_content(|xml| {
                    xml.create_element("ssc:Annotation")
                        .with_attribute(("type", "com.opensimulationplatform"))
                        .write_inner_content(|xml| {
                            xml.create_element("osp:Algorithm")
                                .write_inner_content(|xml| {
                                    xml.create_element("osp:FixedStepAlgorithm")
                                        .with_attribute(("baseStepSize", step_size.as_str()))
                                        .write_empty()
                                        .map(drop)
                                })
                                .map(drop)
                        })
                        .map(drop)
                })
                .map(drop)
        })
        .map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_description::{Interface, SignalInfo};

    fn system() -> System<'static> {
        let signals = |count| vec![SignalInfo::default(); count];
        let interface = Interface {
            sample_time: 0.1,
            stop_time: 10.0,
            inputs: signals(2),
            outputs: signals(3),
            states: signals(4),
            tracked: vec![0, 2],
            disturbances: 1,
            modes: 2,
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
