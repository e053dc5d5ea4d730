//! Forged designs: numbers exchanged, bytes damaged, the guid made to fit.

use fmu_abi::{Slave, Values};
use fmu_host::model::example;
use model_description::{DESIGN_FILE, write_design};
use libfuzzer_sys::arbitrary::{self, Arbitrary};
use std::path::Path;
use std::sync::LazyLock;

static UNCHANGED: LazyLock<String> = LazyLock::new(|| serde_json::to_string(&example()).unwrap());

static FOLDER: LazyLock<String> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("fmu-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder.to_str().unwrap().to_string()
});

/// What is done to the design: to its JSON, from which it is made again, or to its bytes.
#[derive(Arbitrary, Clone, Debug)]
pub enum Edit {
    /// The number at this place (of all numbers) becomes another.
    Number(u16, i16),
    /// The same, with a number of any size.
    Real(u16, f64),
    /// The same, with a whole number of any size: a length that somebody asks memory for.
    Size(u16, u64),
    /// An element is taken out.
    Without(u16),
    /// A byte is replaced.
    Byte(u16, u8),
}

/// Where the `which`-th number of the text lies.
fn number(text: &str, which: u16) -> std::ops::Range<usize> {
    let part = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
    let starts: Vec<usize> = text
        .match_indices(|c: char| c.is_ascii_digit())
        .map(|(at, _)| at)
        .filter(|&at| !text[..at].ends_with(part))
        .collect();
    let start = starts
        .get(usize::from(which) % starts.len().max(1))
        .copied()
        .unwrap_or(0);
    let length = text[start..].find(|c| !part(c)).unwrap_or(0);
    start..start + length
}

/// Changes the JSON; damaged bytes come later.
fn edit(text: &mut String, edit: &Edit) {
    match *edit {
        Edit::Number(which, value) => {
            let range = number(text, which);
            text.replace_range(range, &value.to_string());
        }
        Edit::Real(which, value) => {
            let range = number(text, which);
            text.replace_range(range, &format!("{value:e}"));
        }
        Edit::Size(which, value) => {
            let range = number(text, which);
            text.replace_range(range, &value.to_string());
        }
        Edit::Without(which) => {
            let range = number(text, which);
            let comma = usize::from(text[range.end..].starts_with(','));
            text.replace_range(range.start..range.end + comma, "");
        }
        Edit::Byte(..) => {}
    }
}

/// JSON with these changes; bytes of it are not replaced.
pub(crate) fn edited_text(text: &str, edits: &[Edit]) -> String {
    let mut text = text.to_string();
    for change in edits {
        edit(&mut text, change);
    }
    text
}

/// The bytes of the edited design; none where the JSON is no design any more.
fn edited(edits: &[Edit]) -> Option<Vec<u8>> {
    let text = edited_text(&UNCHANGED, edits);
    let design = serde_json::from_str(&text).ok()?;
    let mut bytes = write_design(&design).ok()?;
    for change in edits {
        if let Edit::Byte(at, value) = *change {
            let at = usize::from(at) % bytes.len();
            bytes[at] = value;
        }
    }
    Some(bytes)
}

/// Loads the design; if it is taken, a few ticks must go well.
fn run<S: Slave>(identifier: &str, bytes: &[u8]) {
    let guid = model_description::guid(identifier, bytes);
    let Ok(slave) = S::load(Path::new(&*FOLDER), &guid) else {
        return;
    };
    let mut values = Values::start(slave.variables());
    let mut state = slave.initial_state();
    if slave.check_inputs(&values).is_err() || slave.initialize(&mut state, &mut values).is_err() {
        return;
    }
    for k in 0..5 {
        if slave.begin_tick(&mut state, &mut values, k, k % 2 == 0).is_err()
            || slave.end_tick(&mut state, &mut values, k).is_err()
        {
            return;
        }
    }
    assert!(slave.fits(&state));
}

/// Forges a design and hands it to a slave, whose binary is called `identifier`.
pub fn load_edited<S: Slave>(identifier: &str, edits: &[Edit]) {
    let Some(bytes) = edited(&edits[..edits.len().min(8)]) else {
        return;
    };
    std::fs::write(Path::new(&*FOLDER).join(DESIGN_FILE), &bytes).unwrap();
    run::<S>(identifier, &bytes);
}
