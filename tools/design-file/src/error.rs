//! What is wrong with a design file, and where.

use crate::{sentence, shape};
use std::fmt;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// A design file that cannot be read, or asks for something that does not fit together.
///
/// Its `Display` is one sentence that names file, key and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Error {
    /// The file, if it was read from one.
    pub file: Option<PathBuf>,
    /// The key at fault as the sentence names it, such as `controller.decay` or `mode 1: A`; none
    /// where no single key is.
    pub key: Option<String>,
    /// Line of the key, from 1; of the table around it where the key is missing.
    pub line: Option<usize>,
    /// The sentence without the file's name.
    pub sentence: String,
}

impl Error {
    /// A complaint about the file as a whole.
    pub fn of_file(sentence: impl Into<String>) -> Self {
        Self {
            file: None,
            key: None,
            line: None,
            sentence: sentence.into(),
        }
    }

    /// A complaint about what `text` asks for. The sentence begins with the key, if one is at fault.
    pub fn of_request(text: &str, sentence: String) -> Self {
        let found = DeTable::parse(text).ok().and_then(|document| {
            let mut keys = leading_keys(&sentence).into_iter();
            keys.find_map(|key| Some((key, line_of(text, document.get_ref(), key)?)))
        });
        Self {
            file: None,
            line: found.and_then(|(_, line)| line),
            key: found.map(|(key, _)| key.into()),
            sentence,
        }
    }

    /// The same error, found in this file.
    pub fn in_file(self, file: &Path) -> Self {
        Self {
            file: Some(file.to_path_buf()),
            ..self
        }
    }
}

impl std::error::Error for Error {}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}: {}", file.display(), self.sentence),
            None => f.write_str(&self.sentence),
        }
    }
}

/// Keys at the top of a design file, beside its tables.
const VALUES: [&str; 4] = ["continuous", "name", "sample_time", "mode"];

/// The keys at the top of a design file.
fn top() -> impl Iterator<Item = &'static str> {
    let tables = shape::TABLES.into_iter().filter(|path| !path.contains('.'));
    VALUES.into_iter().chain(tables)
}

/// What may be the key at the beginning of a sentence, the longest first.
fn leading_keys(sentence: &str) -> Vec<&str> {
    let to = |from: usize| {
        let rest = &sentence[from..];
        &sentence[..from + rest.find([' ', ':', '=', ',']).unwrap_or(rest.len())]
    };
    match sentence
        .strip_prefix("mode ")
        .and_then(|rest| rest.find(": "))
    {
        Some(number) => {
            let mode = "mode ".len() + number;
            vec![to(mode + ": ".len()), &sentence[..mode]]
        }
        None => vec![to(0)],
    }
}

/// The steps from the document to a key: `mode 1: A` is `mode`, `[0]`, `A`.
fn steps(key: &str) -> Vec<Step<'_>> {
    let mut steps = Vec::new();
    let key = match key.strip_prefix("mode ") {
        Some(rest) => {
            let (number, inside) = rest.split_once(": ").unwrap_or((rest, ""));
            steps.push(Step::Key("mode"));
            steps.extend(index(number));
            inside
        }
        None => key,
    };
    for part in key.split('.').filter(|part| !part.is_empty()) {
        let (name, entries) = part.split_once('[').unwrap_or((part, ""));
        steps.push(Step::Key(name));
        steps.extend(entries.split(['[', ']']).filter_map(index));
    }
    steps
}

/// A number counted from 1.
fn index(number: &str) -> Option<Step<'_>> {
    let number: usize = number.parse().ok()?;
    number.checked_sub(1).map(Step::Entry)
}

enum Step<'a> {
    Key(&'a str),
    Entry(usize),
}

/// The line of a key, or of the last table on the way to it. None where there is no such key: only
/// the first step and the keys of a mode are known to exist without standing in the document.
fn line_of(text: &str, document: &DeTable, key: &str) -> Option<Option<usize>> {
    let steps = steps(key);
    let is_top =
        matches!(steps.first(), Some(Step::Key(name)) if top().any(|known| known == *name));
    let mut offset = None;
    let mut here: Option<&DeValue> = None;
    let mut found = 0;
    for step in &steps {
        let next = match (step, here) {
            (Step::Key(name), None) => entry(document, name),
            (Step::Key(name), Some(DeValue::Table(table))) => entry(table, name),
            (Step::Entry(at), Some(DeValue::Array(list))) => list
                .get(*at)
                .map(|value| (value.span().start, value.get_ref())),
            _ => None,
        };
        let Some((start, value)) = next else { break };
        found += 1;
        offset = Some(start);
        here = Some(value);
    }
    let inside_a_mode = key.contains(": ");
    let exists = is_top && (!inside_a_mode || found == steps.len());
    exists.then(|| offset.map(|offset| sentence::place(text, offset).0))
}

/// Where a key of a table stands, and its value.
fn entry<'a>(table: &'a DeTable<'a>, name: &str) -> Option<(usize, &'a DeValue<'a>)> {
    let found = table.iter().find(|(key, _)| key.get_ref() == name);
    found.map(|(key, value)| (key.span().start, value.get_ref()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\"\n[[mode]]\nA = [[1]]\n[[mode]]\nA = [[2]]\nB = [[1]]\n[controller]\ndecay = 2\n";

    #[test]
    fn a_sentence_gives_away_its_key_and_line() {
        let of = |sentence: &str| {
            let error = Error::of_request(TEXT, sentence.into());
            (error.key, error.line)
        };
        let key = |key: &str, line| (Some(key.to_string()), line);
        assert_eq!(
            of("controller.decay is 2: give less"),
            key("controller.decay", Some(8))
        );
        assert_eq!(
            of("controller.tracked is empty"),
            key("controller.tracked", Some(7))
        );
        assert_eq!(of("mode 2: A: the entry is inf"), key("mode 2: A", Some(5)));
        assert_eq!(of("mode 2: there are 80 states"), key("mode 2", Some(4)));
        assert_eq!(
            of("signals.outputs[2].name is"),
            key("signals.outputs[2].name", None)
        );
        assert_eq!(of("neither of them is given"), (None, None));
    }

    #[test]
    fn every_top_level_key_is_known() {
        let error = toml::from_str::<crate::schema::DesignFile>("no_key = 1").unwrap_err();
        let listed: Vec<&str> = error.message().split('`').skip(3).step_by(2).collect();
        for name in &listed {
            assert!(top().any(|known| known == *name), "{name}");
        }
        assert_eq!(listed.len(), top().count());
    }
}
