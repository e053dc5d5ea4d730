//! One sentence for whatever a parser complains about.

use crate::suggest;
use serde_path_to_error::{Path, Segment};

/// Longest quotation from the user's file.
const QUOTATION: usize = 60;

/// Where a byte of the text is, as a person counts.
pub fn position(text: &str, offset: usize) -> String {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let start = before
        .iter()
        .rposition(|&b| b == b'\n')
        .map_or(0, |at| at + 1);
    let column = String::from_utf8_lossy(&before[start..]).chars().count() + 1;
    format!("line {line}, column {column}")
}

/// A syntax error as one sentence.
pub fn syntax(text: &str, error: &toml::de::Error) -> String {
    let at = error.span().map_or(0, |span| span.start);
    format!(
        "{}: this is not TOML ({}): correct the syntax there",
        position(text, at),
        one_line(error.message())
    )
}

/// A value that does not fit the schema as one sentence: place, key, what is wrong, what to do.
pub fn mismatch(text: &str, path: &Path, error: &toml::de::Error) -> String {
    let place = match error.span() {
        Some(span) if span.start > 0 => format!("{}: ", position(text, span.start)),
        _ => String::new(),
    };
    let message = one_line(error.message());
    let quoted = quotations(&message);
    let table = key(path);
    let inside = |name: &str| {
        let already = table.rsplit(['.', ' ']).next() == Some(name);
        if already {
            table.clone()
        } else {
            join(&table, name)
        }
    };
    match (
        &quoted[..],
        message.split_once('`').map(|(head, _)| head.trim()),
    ) {
        ([field], Some("missing field")) => {
            format!("{place}{} is missing: add it", inside(field))
        }
        ([field, known @ ..], Some("unknown field")) => format!(
            "{place}{} is not a known key: {}",
            inside(&shorten(field)),
            suggest::nearest(field, known)
        ),
        ([value, known @ ..], Some("unknown variant")) => format!(
            "{place}{table} = \"{}\" is not a known value: {}",
            shorten(value),
            suggest::nearest(value, known)
        ),
        _ => format!(
            "{place}{}{}: correct the value",
            if table.is_empty() {
                String::new()
            } else {
                format!("{table}: ")
            },
            plain_types(&message)
        ),
    }
}

/// A path as the user counts: `mode[0].A[1]` is `mode 1: A[2]`.
fn key(path: &Path) -> String {
    let mut out = String::new();
    let mut segments = path.iter().peekable();
    while let Some(segment) = segments.next() {
        match (segment, segments.peek()) {
            (Segment::Map { key }, Some(Segment::Seq { index })) if key == "mode" => {
                out = format!("mode {}:", index + 1);
                segments.next();
            }
            (Segment::Map { key } | Segment::Enum { variant: key }, _) => {
                out = join(&out, &shorten(key));
            }
            (Segment::Seq { index }, _) => out.push_str(&format!("[{}]", index + 1)),
            (Segment::Unknown, _) => {}
        }
    }
    out
}

/// A key inside a table.
fn join(table: &str, key: &str) -> String {
    let separator = match table.chars().last() {
        None => "",
        Some(':') => " ",
        Some(_) => ".",
    };
    format!("{table}{separator}{key}")
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
        ("this is a integer", "this is the integer"),
        ("this is a floating point", "this is the number"),
    ]
    .iter()
    .fold(message.to_string(), |text, (from, to)| {
        text.replace(from, to)
    })
}

/// The message on one line, of bearable length.
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
    fn a_quotation_is_short_and_printable() {
        assert_eq!(shorten("a\u{7}b"), "ab");
        assert_eq!(shorten(&"x".repeat(1000)).len(), QUOTATION + 3);
    }
}
