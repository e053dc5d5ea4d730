//! The table of `defaults.rs` says what an absent key means: a file that says the same asks for the same, and one
//! that says something else asks for something else.

use std::collections::BTreeMap;
use std::path::Path;

/// A key, its default as the table words it, the same as TOML, another value, and a key that must be given
/// for this one to mean something.
type Stated = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    &'static str,
);

const REFERENCE: &str = "estimator.method = \"reference\"";

const STATED: [Stated; 34] = [
    ("continuous", "false", "false", "true", ""),
    (
        "controller.output_weight",
        "1, 0.3 and 0.1",
        "[1.0]",
        "[2.0]",
        "",
    ),
    (
        "controller.integral_weight",
        "1, 0.3 and 0.1",
        "[0.3]",
        "[2.0]",
        "",
    ),
    (
        "controller.input_weight",
        "1, 0.3 and 0.1",
        "[0.1]",
        "[2.0]",
        "",
    ),
    ("controller.latency", "0", "0", "1", ""),
    (
        "controller.lyapunov",
        "`common`",
        "\"common\"",
        "\"dwell\"",
        "",
    ),
    (
        "controller.objective",
        "`attenuation`",
        "\"attenuation\"",
        "\"decay\"",
        "",
    ),
    ("controller.decay", "0.95", "0.95", "0.9", ""),
    ("controller.bumpless", "false", "false", "true", ""),
    ("controller.feedforward", "true", "true", "false", ""),
    (
        "controller.internal_model",
        "false",
        "false",
        "true",
        "disturbance.period = 40.0",
    ),
    ("observer.kind", "`auto`", "\"auto\"", "\"kalman\"", ""),
    (
        "observer.decay",
        "that of the controller",
        "0.9",
        "0.8",
        "controller.decay = 0.9",
    ),
    (
        "disturbance.harmonics",
        "1",
        "1",
        "2",
        "disturbance.period = 40.0",
    ),
    (
        "estimator.method",
        "`observer`",
        "\"observer\"",
        "\"none\"",
        "",
    ),
    (
        "estimator.database",
        "`commission`",
        "\"commission\"",
        "\"model\"",
        REFERENCE,
    ),
    ("estimator.sigmas", "6", "6.0", "5.0", REFERENCE),
    ("estimator.debounce", "1 sample", "1", "2", REFERENCE),
    ("estimator.stuck_after", "0 (never)", "0", "3", ""),
    ("estimator.adapt", "false", "false", "true", REFERENCE),
    ("estimator.model_error", "0.05", "0.05", "0.1", ""),
    ("estimator.fault_rate", "1e-5 a sample", "1e-5", "1e-4", ""),
    ("estimator.fault_length", "1000 samples", "1000", "500", ""),
    (
        "estimator.ambiguous",
        "`trust-sensors`",
        "\"trust-sensors\"",
        "\"trust-model\"",
        "",
    ),
    ("estimator.mode", "`told`", "\"told\"", "\"estimated\"", ""),
    (
        "estimator.mode_length",
        "500 samples",
        "500",
        "300",
        "estimator.mode = \"estimated\"",
    ),
    (
        "compensation.method",
        "`virtual-sensor`",
        "\"virtual-sensor\"",
        "\"none\"",
        "",
    ),
    ("scenario.steps", "1000", "1000", "900", ""),
    ("scenario.seed", "1", "1", "2", ""),
    ("scenario.noise", "none", "[0.0]", "[0.1]", ""),
    ("scenario.fault", "none", "[0.0]", "[0.1]", ""),
    (
        "scenario.schedule",
        "mode 1",
        "[{ from = 0.0, mode = 1 }]",
        "[{ from = 0.0, mode = 2 }]",
        "",
    ),
    ("mode.name", "`mode 1`", "\"mode 1\"", "\"first\"", ""),
    ("mode.E", "zero", "[[0.0]]", "[[1.0]]", "mode.F = [[0.0]]"),
];

/// What the table says of a key; its row may name several of one section.
fn said_of(key: &str) -> String {
    let source = include_str!("../src/defaults.rs");
    let rows = source
        .lines()
        .filter_map(|line| line.strip_prefix("//! | `"));
    let (section, name) = key.rsplit_once('.').unwrap_or(("", key));
    let cells = rows.filter_map(|row| row.split_once(" | "));
    let mut found = cells.filter(|(keys, _)| {
        let keys: Vec<&str> = keys.split(", ").map(|key| key.trim_matches('`')).collect();
        let of = keys[0].rsplit_once('.').map_or("", |(section, _)| section);
        let own = |key: &&str| key.rsplit_once('.').map_or(*key, |(_, name)| name) == name;
        of == section && keys.iter().any(own)
    });
    found
        .next()
        .unwrap_or_else(|| panic!("the table has no row with {key}"))
        .1
        .to_owned()
}

/// What a file with these keys (`section.key = value`) asks for.
fn asked(given: &[&str]) -> String {
    let mut sections: BTreeMap<&str, String> = BTreeMap::new();
    for line in given.iter().filter(|line| !line.is_empty()) {
        let (key, value) = line.split_once(" = ").unwrap();
        let (section, name) = key.rsplit_once('.').unwrap_or(("", key));
        *sections.entry(section).or_default() += &format!("{name} = {value}\n");
    }
    let of = |section: &str| sections.get(section).cloned().unwrap_or_default();
    let mut text = format!("name = \"x\"\nsample_time = 1.0\n{}", of(""));
    text += &format!(
        "[[mode]]\nA = [[-0.5]]\nB = [[0.2]]\nC = [[1.0]]\n{}",
        of("mode")
    );
    let second = of("mode")
        .replace("mode 1", "mode 2")
        .replace("first", "second");
    text += &format!("[[mode]]\nA = [[-0.4]]\nB = [[0.3]]\nC = [[1.0]]\n{second}");
    for (section, lines) in sections
        .iter()
        .filter(|(name, _)| !["", "mode"].contains(*name))
    {
        text += &format!("[{section}]\n{lines}");
    }
    let loaded =
        design_file::parse(&text, Path::new("")).unwrap_or_else(|error| panic!("{error}\n{text}"));
    format!("{:#?}", loaded.request)
}

#[test]
fn what_the_table_says_is_what_an_absent_key_means() {
    for (key, words, same, other, needed) in STATED {
        let said = said_of(key);
        assert!(said.contains(words), "{key}: {said}");
        let absent = asked(&[needed]);
        let line = |value: &str| format!("{key} = {value}");
        assert_eq!(asked(&[needed, &line(same)]), absent, "{key} = {same}");
        assert_ne!(asked(&[needed, &line(other)]), absent, "{key} = {other}");
    }
}
