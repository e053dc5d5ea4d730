//! What is wrong with a design file, and where.

use crate::complaint::{Complaint, Key};
use crate::sentence;
use std::fmt;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

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

    /// A complaint about what `text` asks for.
    pub fn of_request(text: &str, complaint: &Complaint) -> Self {
        let place = complaint.key().and_then(|key| {
            let document = DeTable::parse(text).ok()?;
            key.place(document.get_ref())
        });
        Self {
            file: None,
            line: place.map(|place| sentence::place(text, place).0),
            key: complaint.key().map(Key::to_string),
            sentence: complaint.to_string(),
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
