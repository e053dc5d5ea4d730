//! Saved states of an FMU begin with a mark that stands for their layout: who changes the layout counts it up.
//! What is not there when a state begins, such as a list that fills later, is not seen here.

mod common;

use common::{Channel, controller, plant, scenario, state_based};
use fmu_abi::clock::Clock;
use fmu_abi::snapshot::MARK;
use ftc_control::Controller;
use ftc_plant::scenario::Waveform;
use ftc_simulate::PlantSimulator;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;

/// The mark, and the fingerprint of the layout that it stands for.
const KNOWN: ([u8; 8], u64) = (*b"FTCFMU\0\x06", 0xa50e_0620_dc2d_38f0);

/// Fields in the order in which they are written, and the kinds of what they hold.
struct Layout(String);

impl<'de> Deserialize<'de> for Layout {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Reader).map(Self)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = String;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a state in JSON")
    }

    fn visit_bool<E>(self, _: bool) -> Result<String, E> {
        Ok("boolean".into())
    }

    fn visit_u64<E>(self, _: u64) -> Result<String, E> {
        Ok("integer".into())
    }

    fn visit_i64<E>(self, _: i64) -> Result<String, E> {
        Ok("integer".into())
    }

    fn visit_f64<E>(self, _: f64) -> Result<String, E> {
        Ok("real".into())
    }

    fn visit_str<E>(self, _: &str) -> Result<String, E> {
        Ok("variant".into())
    }

    /// None, and what JSON cannot hold: infinities and what is no number.
    fn visit_unit<E>(self) -> Result<String, E> {
        Ok("none".into())
    }

    /// Kinds that occur, each once: how long lists are depends on the design.
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<String, A::Error> {
        let mut kinds = BTreeSet::new();
        while let Some(Layout(kind)) = list.next_element()? {
            kinds.insert(kind);
        }
        let kinds: Vec<String> = kinds.into_iter().collect();
        Ok(format!("[{}]", kinds.join(" | ")))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<String, A::Error> {
        let mut all = Vec::new();
        while let Some((name, Layout(kind))) = fields.next_entry::<String, Layout>()? {
            all.push(format!("{name}: {kind}"));
        }
        Ok(format!("{{{}}}", all.join(", ")))
    }
}

fn layout(state: &impl Serialize) -> String {
    let json = serde_json::to_string(state).unwrap();
    serde_json::from_str::<Layout>(&json).unwrap().0
}

/// FNV-1a.
fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn another_layout_has_another_mark() {
    let noise = 0.01;
    let controllers = [controller, state_based].map(|parameters| {
        let made = Controller::new(parameters(Channel::State, noise)).unwrap();
        layout(&made.initial_state(0))
    });
    let scenario = scenario(Waveform::Constant { value: 1.0 }, noise, 1);
    let simulator = PlantSimulator::new(plant(Channel::State), scenario);
    let parts = [
        controllers.join("\n"),
        layout(&simulator.initial_state()),
        layout(&Clock::new(1.0)),
    ];
    let all = parts.join("\n");
    assert_eq!(
        (MARK, fingerprint(&all)),
        KNOWN,
        "the layout of a saved state has changed: count up fmu_abi::snapshot::MARK, then write it and the \
         fingerprint here\n{all}"
    );
}

#[test]
fn a_layout_shows_fields_in_their_order_and_kinds() {
    let text = r#"{"x0": [1.0, -2e-3], "mode": null, "tick": 3, "on": true, "of": ["A"], "a": [[1], [], [2]]}"#;
    let Layout(found) = serde_json::from_str(text).unwrap();
    let expected =
        "{x0: [real], mode: none, tick: integer, on: boolean, of: [variant], a: [[] | [integer]]}";
    assert_eq!(found, expected);
}
