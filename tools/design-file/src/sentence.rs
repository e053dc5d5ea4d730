//! One sentence for whatever a parser complains about.

use crate::complaint::{Complaint, Key};
use crate::{Error, shape, suggest};
use ftc_tables::QUOTATION;
use serde_path_to_error::Path;

/// Line and column of a byte of the text, from 1.
pub fn place(text: &str, offset: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let start = before
        .iter()
        .rposition(|&b| b == b'\n')
        .map_or(0, |at| at + 1);
    let column = String::from_utf8_lossy(&before[start..]).chars().count() + 1;
    (line, column)
}

fn position(text: &str, offset: usize) -> String {
    let (line, column) = place(text, offset);
    format!("line {line}, column {column}")
}

/// A syntax error as one sentence.
pub(crate) fn syntax(text: &str, error: &toml::de::Error) -> Error {
    let span = error.span().unwrap_or(0..0);
    let at = span.start;
    let place_words = position(text, at);
    let key = text.get(span).unwrap_or_default();
    let sentence = match (without_value(text, at), error.message()) {
        (Some(key), message) if !message.starts_with("unclosed") => format!(
            "{place_words}: {} has no value: write `{} = ` and the value, or leave the key out",
            shorten(key),
            shorten(key)
        ),
        (_, "duplicate key") if !key.is_empty() => {
            format!(
                "{place_words}: {} stands here again: {}",
                shorten(key),
                shape::once(key)
            )
        }
        (_, message) => format!(
            "{place_words}: this is not TOML ({}): correct the syntax there",
            one_line(message)
        ),
    };
    Error {
        line: Some(place(text, at).0),
        ..Error::of_file(sentence)
    }
}

/// The key of `key =` before byte `at`, where nothing follows on its line.
fn without_value(text: &str, at: usize) -> Option<&str> {
    let (before, after) = text.split_at_checked(at)?;
    let after = after.lines().next().unwrap_or_default().trim_start();
    let before = before.rsplit('\n').next().unwrap_or_default();
    let inner = before
        .contains('{')
        .then(|| before.rsplit(['{', ',']).next());
    let before = inner.flatten().unwrap_or(before).trim();
    let key = before.strip_suffix('=')?.trim_end();
    let nothing = after.is_empty() || after.starts_with(['#', ',', '}']);
    let named = |c: char| c.is_alphanumeric() || "_-.".contains(c);
    let is_key = key.starts_with(char::is_alphabetic) && key.chars().all(named);
    (nothing && is_key).then_some(key)
}

/// A value that does not fit the schema as one sentence: place, key, what is wrong, what to do.
pub(crate) fn mismatch(text: &str, path: &Path, error: &toml::de::Error) -> Error {
    let start = error
        .span()
        .map(|span| span.start)
        .filter(|&start| start > 0);
    let place_of = |start| format!("{}: ", position(text, start));
    let place_words = start.map(place_of).unwrap_or_default();
    let message = one_line(error.message());
    let quoted = quotations(&message);
    let table = Key::from(path);
    let inside = |name: &str| match table.name() == Some(name) {
        true => table.clone(),
        false => table.clone().then(Key::of_name(name)),
    };
    let (key, what) = match (
        &quoted[..],
        message.split_once('`').map(|(head, _)| head.trim()),
    ) {
        ([field], Some("missing field")) => (inside(field), "is missing: add it".into()),
        ([field, known @ ..], Some("unknown field")) => (
            inside(&shorten(field)),
            format!("is not a known key: {}", suggest::nearest(field, known)),
        ),
        ([value, known @ ..], Some("unknown variant")) => {
            let known = suggest::nearest(value, known);
            let what = format!("= \"{}\" is not a known value: {known}", shorten(value));
            (table, what)
        }
        _ => {
            let what = plain_types(&message);
            let colon = if table.is_empty() { "" } else { ": " };
            (table, format!("{colon}{what}: correct the value"))
        }
    };
    let complaint = Complaint::of(key, what);
    Error {
        line: start.map(|start| place(text, start).0),
        key: complaint.key().map(Key::to_string),
        ..Error::of_file(format!("{place_words}{complaint}"))
    }
}

/// The words a message puts between back-quotes.
fn quotations(message: &str) -> Vec<&str> {
    message.split('`').skip(1).step_by(2).collect()
}

/// Types as an engineer calls them.
fn plain_types(message: &str) -> String {
    [
        ("expected f64", "expected a number"),
        ("expected i64", "expected a whole number"),
        ("expected usize", "expected a whole number"),
        ("expected a sequence", "expected a list"),
        ("invalid type: map", "a table stands here"),
        ("invalid type: sequence", "a list stands here"),
        ("invalid type: ", "this is a "),
        (" as i128", ""),
        ("expected variant identifier", "expected a text"),
        ("wanted string or table", "expected a text"),
        ("this is a integer", "this is the integer"),
        ("this is a floating point", "this is the number"),
    ]
    .iter()
    .fold(without_type_names(message), |text, (from, to)| {
        text.replace(from, to)
    })
}

/// `expected struct Scenario` and the like name types of this program, which nobody else knows.
fn without_type_names(message: &str) -> String {
    match message.split_once("expected struct ") {
        Some((before, _)) => format!("{before}expected a table"),
        None => message.to_string(),
    }
}

/// The message on one line, of limited length.
fn one_line(message: &str) -> String {
    let words: Vec<&str> = message.split_whitespace().collect();
    let line = words.join(" ");
    match line.char_indices().nth(400) {
        Some((cut, _)) => format!("{}...", &line[..cut]),
        None => line,
    }
}

/// A quotation from the user's file: printable and short.
pub fn shorten(text: &str) -> String {
    let clean: String = text.chars().filter(|c| !c.is_control()).collect();
    match clean.char_indices().nth(QUOTATION) {
        Some((cut, _)) => format!("{}...", &clean[..cut]),
        None => clean,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_from_one() {
        assert_eq!(position("ab\ncd", 0), "line 1, column 1");
        assert_eq!(position("ab\ncd", 4), "line 2, column 2");
        assert_eq!(position("é=1", 3), "line 1, column 3");
        assert_eq!(position("", 10), "line 1, column 1");
    }

    #[test]
    fn a_key_without_a_value_is_named() {
        for (text, at, key) in [
            ("a = 1\ngamma =\n", 13, Some("gamma")),
            ("decay =   # none", 10, Some("decay")),
            ("decay", 5, None),
            ("x = { a = 1, noise =}", 20, Some("noise")),
            ("decay = a", 8, None),
            ("tracked = [1, 2", 15, None),
            ("[observer", 9, None),
        ] {
            assert_eq!(without_value(text, at), key, "{text}");
        }
    }

    #[test]
    fn a_quotation_is_short_and_printable() {
        assert_eq!(shorten("a\u{7}b"), "ab");
        assert_eq!(shorten(&"x".repeat(1000)).len(), QUOTATION + 3);
    }
}
