//! What is wrong with what is asked for, and which key is at fault.

use ftc_plant::PlantError;
use serde_path_to_error::{Path, Segment};
use std::fmt::{self, Display};
use toml::de::{DeTable, DeValue};

/// Where a value stands in a design file. As text it counts as the user does: `signals.outputs[2].name`,
/// `mode 1: A`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Key(Vec<Step>);

/// One step from a table or a list to what it holds.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Name(String),
    /// An entry of a list, from 0.
    Entry(usize),
}

impl Key {
    /// A name, whatever letters it has.
    pub(crate) fn of_name(name: &str) -> Self {
        Self(vec![Step::Name(name.into())])
    }

    /// One of the plant's modes (from 0).
    pub(crate) fn mode(index: usize) -> Self {
        Self(vec![Step::Name("mode".into()), Step::Entry(index)])
    }

    /// What this table holds under another key.
    pub(crate) fn then(mut self, key: impl Into<Self>) -> Self {
        self.0.extend(key.into().0);
        self
    }

    /// An entry (from 0) of this list.
    pub(crate) fn entry(mut self, index: usize) -> Self {
        self.0.push(Step::Entry(index));
        self
    }

    /// Whether it is that of the document as a whole.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The last name on the way to it.
    pub(crate) fn name(&self) -> Option<&str> {
        match self.0.last() {
            Some(Step::Name(name)) => Some(name),
            _ => None,
        }
    }

    /// Where it begins in a document; where it is not there, the table or list that would hold it.
    pub(crate) fn place(&self, document: &DeTable) -> Option<usize> {
        let (first, rest) = self.0.split_first()?;
        let Step::Name(name) = first else { return None };
        let (mut place, mut here) = held(document, name)?;
        for step in rest {
            let next = match (step, here) {
                (Step::Name(name), DeValue::Table(table)) => held(table, name),
                (Step::Entry(at), DeValue::Array(list)) => list
                    .get(*at)
                    .map(|value| (value.span().start, value.get_ref())),
                _ => None,
            };
            let Some((start, value)) = next else { break };
            (place, here) = (start, value);
        }
        Some(place)
    }
}

/// Where a key of a table stands, and its value.
fn held<'a>(table: &'a DeTable<'a>, name: &str) -> Option<(usize, &'a DeValue<'a>)> {
    let found = table.iter().find(|(key, _)| key.get_ref() == name);
    found.map(|(key, value)| (key.span().start, value.get_ref()))
}

/// Names between dots.
impl From<&str> for Key {
    fn from(path: &str) -> Self {
        Self(
            path.split('.')
                .map(|name| Step::Name(name.into()))
                .collect(),
        )
    }
}

impl From<&Path> for Key {
    fn from(path: &Path) -> Self {
        let step = |segment: &Segment| match segment {
            Segment::Map { key } | Segment::Enum { variant: key } => {
                Some(Step::Name(crate::sentence::shorten(key)))
            }
            Segment::Seq { index } => Some(Step::Entry(*index)),
            Segment::Unknown => None,
        };
        Self(path.iter().filter_map(step).collect())
    }
}

impl Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut steps = self.0.iter().peekable();
        let mut separator = "";
        while let Some(step) = steps.next() {
            match (step, steps.peek()) {
                (Step::Name(name), Some(Step::Entry(mode))) if name == "mode" => {
                    let colon = if separator.is_empty() { "" } else { ": " };
                    write!(f, "{colon}mode {}", mode + 1)?;
                    steps.next();
                    separator = ": ";
                }
                (Step::Name(name), _) => {
                    write!(f, "{separator}{name}")?;
                    separator = ".";
                }
                (Step::Entry(at), _) => write!(f, "[{}]", at + 1)?,
            }
        }
        Ok(())
    }
}

/// One sentence about what is asked for. It begins with the key, if a single one is at fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Complaint {
    key: Key,
    /// What follows the key, with what separates it from that.
    what: String,
}

impl Complaint {
    /// What is wrong with a key: the rest of the sentence, which may begin with a colon.
    pub(crate) fn of(key: impl Into<Key>, what: impl Display) -> Self {
        let (key, what) = (key.into(), what.to_string());
        let what = match key.is_empty() || what.starts_with(':') {
            true => what,
            false => format!(" {what}"),
        };
        Self { key, what }
    }

    /// A sentence about more than one key.
    pub(crate) fn general(sentence: impl Into<String>) -> Self {
        Self {
            key: Key::default(),
            what: sentence.into(),
        }
    }

    /// The same of what stands in this table or list.
    pub(crate) fn inside(self, table: impl Into<Key>) -> Self {
        let what = match self.key.is_empty() {
            true => format!(": {}", self.what),
            false => self.what,
        };
        Self {
            key: table.into().then(self.key),
            what,
        }
    }

    /// The key at fault; none where no single one is.
    pub fn key(&self) -> Option<&Key> {
        Some(&self.key).filter(|key| !key.is_empty())
    }
}

impl Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.key, self.what)
    }
}

impl std::error::Error for Complaint {}

impl From<PlantError> for Complaint {
    fn from(error: PlantError) -> Self {
        crate::wording::of_plant(&error)
    }
}

/// Puts the key before what is wrong with its value.
pub(crate) fn at<T>(key: impl Into<Key>, result: Result<T, impl Display>) -> Result<T, Complaint> {
    result.map_err(|what| Complaint::of(key, what))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\"\n[[mode]]\nA = [[1]]\n[[mode]]\nA = [[2]]\nB = [[1]]\n[controller]\ndecay = 2\n\
                        [scenario]\nevents = [{ from = 1 },\n{ from = 2 }]\n";

    fn line(key: Key) -> Option<usize> {
        let document = DeTable::parse(TEXT).unwrap();
        let place = key.place(document.get_ref())?;
        Some(crate::sentence::place(TEXT, place).0)
    }

    #[test]
    fn a_key_has_the_line_it_stands_on_or_that_of_the_table_around_it() {
        assert_eq!(line("controller.decay".into()), Some(8));
        assert_eq!(line("controller.tracked".into()), Some(7));
        assert_eq!(line(Key::mode(1).then("A")), Some(5));
        assert_eq!(line(Key::mode(1).then("C")), Some(4));
        let event = Key::from("scenario.events").entry(1);
        assert_eq!(line(event.clone().then("from")), Some(11));
        assert_eq!(line(event.then("size")), Some(11));
        assert_eq!(line("signals.outputs".into()), None);
    }

    #[test]
    fn a_key_is_written_as_the_user_counts() {
        let said = |key: Key| key.to_string();
        assert_eq!(
            said(Key::mode(0).then("operating_point.x")),
            "mode 1: operating_point.x"
        );
        assert_eq!(
            said(Key::from("scenario.plant").then(Key::mode(1)).then("A")),
            "scenario.plant: mode 2: A"
        );
        assert_eq!(
            said(Key::from("scenario.events").entry(1).then("size")),
            "scenario.events[2].size"
        );
    }

    #[test]
    fn a_sentence_begins_with_its_key() {
        let said = |complaint: Complaint| complaint.inside(Key::mode(0)).to_string();
        assert_eq!(said(Complaint::of("A", "is 2 x 3")), "mode 1: A is 2 x 3");
        assert_eq!(
            said(Complaint::of("A", ": row 2 is short")),
            "mode 1: A: row 2 is short"
        );
        assert_eq!(said(Complaint::general("it grows")), "mode 1: it grows");
    }
}
