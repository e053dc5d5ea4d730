//! What stands in `modelDescription.xml`, read back by a parser.

use model_description::xml::{Document, write};
use model_description::*;
use quick_xml::events::{BytesStart, Event};
use std::collections::{BTreeMap, HashSet};

type Element = (String, BTreeMap<String, String>);

fn interface() -> Interface {
    let signal = |name: &str, unit: &str| SignalInfo {
        name: name.into(),
        unit: unit.into(),
        nominal: Some(1e-3),
        min: Some(-1e300),
        max: Some(2.5),
        start: 0.0,
    };
    Interface {
        sample_time: 1e-4,
        stop_time: 12.5,
        inputs: vec![signal("a \"quoted\" <name> & more", "V")],
        outputs: vec![signal("speed", "rad/s"), signal("", "odd & unit")],
        states: vec![signal("", ""), signal("", "rad")],
        tracked: vec![1],
        disturbances: vec![signal("draught", "degC")],
        modes: 2,
        finds_the_mode: false,
        thresholds: vec![0.25, 0.5],
    }
}

fn document(table: &VariableTable) -> Document<'_> {
    Document {
        model_name: "paper <controller>",
        model_identifier: "paper_controller",
        description: "A & B",
        guid: "{00000000-0000-0000-0000-000000000000}",
        version: "1",
        license: "MIT OR Apache-2.0",
        step_size: 1e-4,
        stop_time: 12.5,
        directional_derivative: true,
        table,
    }
}

/// All elements in order of appearance.
fn elements(xml: &str) -> Vec<Element> {
    let mut reader = quick_xml::Reader::from_str(xml);
    let read = |element: &BytesStart| -> Element {
        let attributes = element.attributes().map(|attribute| {
            let attribute = attribute.unwrap();
            let value = quick_xml::escape::unescape(&attribute.value)
                .unwrap()
                .into_owned();
            (attribute.key.as_ref().to_string(), value)
        });
        (element.name().as_ref().to_string(), attributes.collect())
    };
    let mut found = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            Event::Start(element) | Event::Empty(element) => found.push(read(&element)),
            Event::Eof => return found,
            _ => {}
        }
    }
}

fn both() -> Vec<(VariableTable, Vec<Element>)> {
    [controller(&interface()), plant(&interface())]
        .into_iter()
        .map(|table| {
            let xml = write(&document(&table)).unwrap();
            (table, elements(&xml))
        })
        .collect()
}

fn named<'a>(
    found: &'a [Element],
    name: &'a str,
) -> impl Iterator<Item = &'a BTreeMap<String, String>> {
    found
        .iter()
        .filter(move |(element, _)| element == name)
        .map(|(_, attributes)| attributes)
}

#[test]
fn the_head_tells_what_importers_look_for() {
    for (_, found) in both() {
        let head = named(&found, "fmiModelDescription").next().unwrap();
        assert_eq!(head["fmiVersion"], "2.0");
        assert_eq!(head["variableNamingConvention"], "structured");
        assert_eq!(head["modelName"], "paper <controller>");
        assert!(head["generationDateAndTime"].ends_with('Z'));
        let flags = named(&found, "CoSimulation").next().unwrap();
        for (flag, value) in [
            ("modelIdentifier", "paper_controller"),
            ("needsExecutionTool", "false"),
            ("canBeInstantiatedOnlyOncePerProcess", "false"),
            ("canHandleVariableCommunicationStepSize", "true"),
            ("canInterpolateInputs", "false"),
            ("canGetAndSetFMUstate", "true"),
            ("canSerializeFMUstate", "true"),
            ("providesDirectionalDerivative", "true"),
        ] {
            assert_eq!(flags[flag], value, "{flag}");
        }
        let experiment = named(&found, "DefaultExperiment").next().unwrap();
        assert_eq!(experiment["stepSize"].parse(), Ok(1e-4));
        assert_eq!(experiment["stopTime"].parse(), Ok(12.5));
        let categories: Vec<_> = named(&found, "Category").map(|c| &c["name"]).collect();
        assert_eq!(categories, LOG_CATEGORIES.map(|(name, _)| name));
    }
}

#[test]
fn the_variables_are_those_of_the_table_in_its_order() {
    for (table, found) in both() {
        let written: Vec<_> = named(&found, "ScalarVariable").collect();
        assert_eq!(written.len(), table.len());
        for ((reference, variable), written) in table.iter().zip(written) {
            assert_eq!(written["valueReference"], reference.to_string());
            assert_eq!(written["name"], variable.name);
            assert_eq!(written["description"], variable.description);
            let initial = written.get("initial").map(String::as_str);
            let expected = match variable.causality {
                Causality::Input => None,
                Causality::Output => Some("calculated"),
                Causality::Parameter => Some("exact"),
            };
            assert_eq!(initial, expected, "{}", variable.name);
        }
    }
}

#[test]
fn numbers_read_back_to_the_same_doubles() {
    let table = controller(&interface());
    let found = elements(&write(&document(&table)).unwrap());
    let at = found
        .iter()
        .position(|(_, attributes)| attributes.get("name").is_some_and(|name| name == "u[1]"));
    let (element, real) = &found[at.unwrap() + 1];
    assert_eq!(element, "Real");
    assert_eq!(real["min"].parse(), Ok(-1e300));
    assert_eq!(real["max"].parse(), Ok(2.5));
    assert_eq!(real["nominal"].parse(), Ok(1e-3));
    assert!(!real.contains_key("start"), "a calculated output has none");
}

#[test]
fn every_unit_in_use_is_declared_once() {
    for (_, found) in both() {
        let declared: Vec<_> = named(&found, "Unit")
            .map(|unit| unit["name"].clone())
            .collect();
        let set: HashSet<_> = declared.iter().cloned().collect();
        assert_eq!(set.len(), declared.len());
        let used: HashSet<_> = named(&found, "Real")
            .filter_map(|real| real.get("unit").cloned())
            .collect();
        assert_eq!(used, set);
        assert!(set.contains("odd & unit"));
        let displays: HashSet<_> = named(&found, "DisplayUnit").map(|d| &d["name"]).collect();
        for display in named(&found, "Real").filter_map(|real| real.get("displayUnit")) {
            assert!(displays.contains(display));
        }
    }
}

#[test]
fn structure_lists_every_output_with_explicit_dependencies() {
    for (table, found) in both() {
        let outputs: Vec<u32> = table
            .outputs()
            .map(|(reference, _)| reference + 1)
            .collect();
        let unknowns: Vec<_> = named(&found, "Unknown").collect();
        let indices = |part: &[&BTreeMap<String, String>]| -> Vec<u32> {
            part.iter().map(|u| u["index"].parse().unwrap()).collect()
        };
        let (running, starting) = unknowns.split_at(outputs.len());
        assert_eq!(indices(running), outputs);
        assert_eq!(indices(starting), outputs);
        assert!(running.iter().all(|u| u["dependencies"].is_empty()));
        for (unknown, (_, variable)) in starting.iter().zip(table.outputs()) {
            let written: Vec<u32> = unknown["dependencies"]
                .split_whitespace()
                .map(|index| index.parse::<u32>().unwrap() - 1)
                .collect();
            assert_eq!(written, variable.initial_dependencies);
        }
    }
}

#[test]
fn the_same_table_gives_the_same_bytes() {
    let table = plant(&interface());
    let [once, again] = [(); 2].map(|()| write(&document(&table)).unwrap());
    assert_eq!(once, again);
}

#[test]
fn nonsense_is_refused_with_a_reason() {
    let table = plant(&interface());
    let with = |change: fn(&mut Document)| {
        let mut document = document(&table);
        change(&mut document);
        write(&document).unwrap_err().to_string()
    };
    assert!(with(|d| d.stop_time = 0.0).contains("stopTime 0"));
    assert!(with(|d| d.step_size = f64::NAN).contains("stepSize NaN"));
    assert!(with(|d| d.model_identifier = "a-b").contains("'a-b'"));
    assert!(with(|d| d.model_identifier = "").contains("''"));
    let spoiled = Interface {
        thresholds: vec![f64::INFINITY; 2],
        ..interface()
    };
    let table = controller(&spoiled);
    let error = write(&document(&table)).unwrap_err().to_string();
    assert!(error.contains("threshold[1]"), "{error}");
}
