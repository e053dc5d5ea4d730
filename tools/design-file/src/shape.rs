//! Which keys are one table and which are lists of tables.
//!
//! TOML writes the two nearly alike, `[mode]` and `[[mode]]`, and serde would read a list as a table
//! whose keys are told by their order.

use crate::{Error, sentence};
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Keys that are one table.
pub(crate) const TABLES: [&str; 9] = [
    "plant",
    "signals",
    "disturbance",
    "controller",
    "observer",
    "estimator",
    "compensation",
    "scenario",
    "scenario.plant",
];

/// Keys that are a list of tables, each with what one may look like.
const LISTS: [(&str, &str); 11] = [
    ("mode", "{ A = [[...]], B = [[...]], C = [[...]] }"),
    ("signals.inputs", NAMED),
    ("signals.outputs", NAMED),
    ("signals.states", NAMED),
    ("signals.disturbances", NAMED),
    ("scenario.schedule", "{ from = 0.0, mode = 1 }"),
    (
        "scenario.events",
        "{ kind = \"bias\", sensor = 1, from = 100.0, size = 0.5 }",
    ),
    ("scenario.plant.mode", "{ A = [[...]] }"),
    ("scenario.plant.told", "{ from = 100.0, mode = 2 }"),
    (
        "scenario.plant.loads",
        "{ input = 1, from = 100.0, size = 0.5 }",
    ),
    (
        "scenario.plant.actuator",
        "{ kind = \"bias\", input = 1, from = 100.0, size = 0.5 }",
    ),
];

const NAMED: &str = "{ name = \"...\", unit = \"...\" }";

/// Keys that are a list of signals, each a number or a table.
const SIGNALS: [&str; 3] = [
    "scenario.reference",
    "scenario.fault",
    "scenario.disturbance",
];

/// Lists whose entries have a table `operating_point`.
const MODES: [&str; 2] = ["mode", "scenario.plant.mode"];

/// Whether every key holds a table, or a list of tables, as it should.
///
/// # Errors
/// The first that does not, with how it is written.
pub(crate) fn check(text: &str, document: &DeTable) -> Result<(), Error> {
    let wrong = tables(document)
        .or_else(|| lists(document))
        .or_else(|| signals(document))
        .or_else(|| operating_points(document));
    let Some(Wrong { key, span, what }) = wrong else {
        return Ok(());
    };
    let (line, column) = sentence::place(text, span.start);
    let sentence = format!("line {line}, column {column}: {key} is {what}");
    Err(Error {
        line: Some(line),
        key: Some(key),
        ..Error::of_file(sentence)
    })
}

/// What to do about a key that stands twice.
pub(crate) fn once(key: &str) -> String {
    let last = |path: &str| path.rsplit('.').next() == Some(key);
    match LISTS.iter().find(|(path, _)| last(path)) {
        Some((path, _)) => {
            format!("give it once, or write [[{path}]], in double brackets, above the keys of each")
        }
        None => "give it once".into(),
    }
}

/// A key with a value of another shape.
struct Wrong {
    key: String,
    span: Range<usize>,
    /// What it is, and how it is written.
    what: String,
}

fn tables(document: &DeTable) -> Option<Wrong> {
    TABLES.iter().find_map(|path| {
        let (span, value) = find(document, path)?;
        let found = other_than_table(value)?;
        let what = format!("{found}, but must be one table: write [{path}] and its keys below it");
        Some(wrong(*path, span, what))
    })
}

fn lists(document: &DeTable) -> Option<Wrong> {
    LISTS.iter().find_map(|(path, example)| {
        let (span, value) = find(document, path)?;
        let DeValue::Array(entries) = value else {
            let found = other_than_table(value).unwrap_or("one table");
            let what = format!(
                "{found}, but must be a list of tables: write [[{path}]], in double brackets, above the keys of each"
            );
            return Some(wrong(*path, span, what));
        };
        entries.iter().enumerate().find_map(|(at, entry)| {
            let found = other_than_table(entry.get_ref())?;
            let what = format!("{found}, but must be a table, such as {example}: write it so");
            Some(wrong(format!("{path}[{}]", at + 1), entry.span(), what))
        })
    })
}

fn signals(document: &DeTable) -> Option<Wrong> {
    SIGNALS.iter().find_map(|path| {
        let (span, value) = find(document, path)?;
        let found = match value {
            DeValue::Array(_) => return None,
            DeValue::Table(_) => "one table",
            _ => other_than_table(value)?,
        };
        let name = path.rsplit('.').next().unwrap_or(path);
        let what = format!(
            "{found}, but must be a list with one signal for each channel: write {name} = [...], each a number or a table with a kind"
        );
        Some(wrong(*path, span, what))
    })
}

fn operating_points(document: &DeTable) -> Option<Wrong> {
    MODES.iter().find_map(|path| {
        let Some((_, DeValue::Array(modes))) = find(document, path) else {
            return None;
        };
        modes.iter().enumerate().find_map(|(at, mode)| {
            let (span, value) = find(mode.get_ref().as_table()?, "operating_point")?;
            let found = other_than_table(value)?;
            let key = match path.strip_suffix("mode") {
                Some("") | None => format!("mode {}: operating_point", at + 1),
                Some(table) => format!("{table}mode[{}].operating_point", at + 1),
            };
            let what = format!(
                "{found}, but must be a table: write operating_point = {{ x = [...], u = [...], y = [...] }}"
            );
            Some(wrong(key, span, what))
        })
    })
}

fn wrong(key: impl Into<String>, span: Range<usize>, what: String) -> Wrong {
    Wrong {
        key: key.into(),
        span,
        what,
    }
}

/// The value at a path, and where it stands.
fn find<'a>(document: &'a DeTable<'a>, path: &str) -> Option<(Range<usize>, &'a DeValue<'a>)> {
    let (table, name) = match path.rsplit_once('.') {
        Some((outer, name)) => (find(document, outer)?.1.as_table()?, name),
        None => (document, path),
    };
    let (key, value) = table.iter().find(|(key, _)| key.get_ref() == name)?;
    Some((key.span(), value.get_ref()))
}

/// What a value is, in words; none for a table.
fn other_than_table(value: &DeValue) -> Option<&'static str> {
    match value {
        DeValue::Table(_) => None,
        DeValue::Array(_) => Some("a list"),
        DeValue::String(_) => Some("a text"),
        DeValue::Integer(_) | DeValue::Float(_) => Some("a number"),
        DeValue::Boolean(_) => Some("true or false"),
        DeValue::Datetime(_) => Some("a date"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentence(text: &str) -> Option<String> {
        let document = DeTable::parse(text).unwrap();
        check(text, document.get_ref())
            .err()
            .map(|error| error.sentence)
    }

    #[test]
    fn one_table_is_not_read_from_a_list() {
        for path in TABLES {
            let said = sentence(&format!("\n[[{path}]]\nx = 1\n")).unwrap();
            let wanted = format!(
                "line 2, column 3: {path} is a list, but must be one table: write [{path}] and its keys below it"
            );
            let column = 3 + path.rfind('.').map_or(0, |dot| dot + 1);
            assert_eq!(
                said,
                wanted.replace("column 3", &format!("column {column}"))
            );
            assert_eq!(sentence(&format!("[{path}]\n")), None);
        }
    }

    #[test]
    fn a_list_of_tables_is_not_read_from_one_table_or_a_list_of_values() {
        for (path, example) in LISTS {
            let said = sentence(&format!("[{path}]\nx = 1\n")).unwrap();
            assert!(said.contains(&format!("{path} is one table")), "{said}");
            assert!(said.contains(&format!("write [[{path}]]")), "{said}");
            let said = sentence(&format!("{path} = [{{}}, [1]]")).unwrap();
            assert!(said.contains(&format!("{path}[2] is a list")), "{said}");
            assert!(said.contains(example), "{said}");
            assert_eq!(sentence(&format!("[[{path}]]\n[[{path}]]\n")), None);
        }
    }

    #[test]
    fn signals_and_operating_points_have_their_shapes() {
        for path in SIGNALS {
            let said = sentence(&format!("[{path}]\nkind = \"sine\"")).unwrap();
            assert!(said.contains("one signal for each channel"), "{said}");
            assert_eq!(sentence(&format!("{path} = [0.0]")), None);
        }
        let said = sentence("[[mode]]\n[[mode]]\noperating_point = [1, 2]").unwrap();
        assert!(
            said.starts_with("line 3, column 1: mode 2: operating_point is a list"),
            "{said}"
        );
    }
}
