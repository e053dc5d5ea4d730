//! Where in a design file a sentence points: its key, and the line of that key.

use toml::de::{DeTable, DeValue};

/// The tables and values that a design file begins its keys with.
const FIRST: [&str; 10] = [
    "name",
    "sample_time",
    "mode",
    "plant",
    "signals",
    "disturbance",
    "controller",
    "observer",
    "estimator",
    "compensation",
];
const SCENARIO: &str = "scenario";

/// A sentence without the `line 3, column 7: ` that it may begin with.
pub fn without_position(sentence: &str) -> &str {
    position(sentence).map_or(sentence, |(_, rest)| rest)
}

/// The line that a sentence begins with.
pub fn line(sentence: &str) -> Option<usize> {
    position(sentence).map(|(line, _)| line)
}

fn position(sentence: &str) -> Option<(usize, &str)> {
    let (line, rest) = sentence.strip_prefix("line ")?.split_once(", column ")?;
    let (column, rest) = rest.split_once(": ")?;
    column.parse::<usize>().ok()?;
    Some((line.parse().ok()?, rest))
}

/// The key that a sentence begins with, such as `controller.decay` or `mode 2: A`.
pub fn key(sentence: &str) -> Option<String> {
    let sentence = without_position(sentence);
    let word = |text: &str| -> String {
        text.chars()
            .take_while(|&c| c.is_alphanumeric() || "_.[]".contains(c))
            .collect()
    };
    if let Some(rest) = sentence.strip_prefix("mode ") {
        let (number, rest) = rest.split_once(": ")?;
        number.parse::<usize>().ok()?;
        let inner = word(rest);
        let known = [
            "A",
            "B",
            "C",
            "D",
            "E",
            "F",
            "name",
            "operating_point",
            "file",
        ];
        let begins = known
            .iter()
            .any(|name| inner.split(['.', '[']).next() == Some(name));
        return Some(match begins {
            true => format!("mode {number}: {inner}"),
            false => format!("mode {number}"),
        });
    }
    let key = word(sentence);
    let first = key.split(['.', '[']).next()?;
    let known = FIRST.contains(&first) || first == SCENARIO;
    known.then(|| key.trim_end_matches('.').to_string())
}

/// The line (from 1) on which a key stands in the text of a design file.
pub fn line_of(text: &str, key: &str) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let steps = steps(key);
    let mut table = document.get_ref();
    let mut at = None;
    let mut steps = steps.iter().peekable();
    while let Some(step) = steps.next() {
        let (name, value) = table.iter().find(|(name, _)| name.get_ref() == step)?;
        at = Some(name.span().start);
        let mut value = value;
        while let DeValue::Array(entries) = value.get_ref() {
            let Some(index) = steps.next_if(|step| step.parse::<usize>().is_ok()) else {
                break;
            };
            value = entries.get(index.parse::<usize>().ok()?.checked_sub(1)?)?;
            at = Some(value.span().start);
        }
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => break,
        }
    }
    let offset = at?;
    Some(
        1 + text.as_bytes()[..offset.min(text.len())]
            .iter()
            .filter(|&&b| b == b'\n')
            .count(),
    )
}

/// `mode 2: A[1]` as `mode`, `2`, `A`, `1`.
fn steps(key: &str) -> Vec<String> {
    key.split([' ', '.', ':', '[', ']'])
        .filter(|step| !step.is_empty())
        .map(str::to_string)
        .collect()
}
