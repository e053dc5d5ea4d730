//! What the user should know of files that were read without a fault.

use std::cell::RefCell;

/// Sentences, in the order in which they came up; each once.
#[derive(Debug, Default)]
pub struct Notes(RefCell<Vec<String>>);

impl Notes {
    /// Adds a sentence.
    pub fn add(&self, sentence: String) {
        let mut all = self.0.borrow_mut();
        if !all.contains(&sentence) {
            all.push(sentence);
        }
    }

    /// All of them.
    pub fn into_sentences(self) -> Vec<String> {
        self.0.into_inner()
    }
}
