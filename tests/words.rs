//! The library crates speak of what is asked for, never of the design file that may ask for it: the keys and the
//! syntax of TOML, and names with an underscore, are put on by who reads it (`design_file::wording`).

mod tokens;

use std::fs;
use std::path::{Path, PathBuf};
use tokens::{tokens, without_tests};

/// The tables of a design file.
const TABLES: [&str; 9] = [
    "controller",
    "observer",
    "estimator",
    "signals",
    "scenario",
    "disturbance",
    "compensation",
    "true_plant",
    "mode",
];

/// How TOML gives a text or a truth value, as it stands in a string of Rust.
const SYNTAX: [&str; 4] = [" = \\\"", " = \"", " = true", " = false"];

/// The string literals of a source, documentation and tests left out.
fn strings(source: &str) -> Vec<String> {
    let tokens = without_tests(tokens(source));
    let documents = |at: usize| at >= 2 && tokens[at - 1] == "=" && tokens[at - 2] == "doc";
    let is_string = |text: &str| {
        text.trim_start_matches(['b', 'c', 'r', '#'])
            .starts_with('"')
    };
    let found = tokens.iter().enumerate();
    let found = found.filter(|(at, token)| is_string(token) && !documents(*at));
    found.map(|(_, token)| token.clone()).collect()
}

/// A literal without what is filled in between braces.
fn without_holes(literal: &str) -> String {
    let parts = literal.split('{').enumerate();
    let kept = parts.map(|(at, part)| match at {
        0 => part,
        _ => part.split_once('}').map_or("", |(_, after)| after),
    });
    kept.collect()
}

/// What only who writes a design file knows, in a string literal.
fn of_a_design_file(literal: &str) -> Option<String> {
    if let Some(syntax) = SYNTAX.iter().find(|syntax| literal.contains(**syntax)) {
        return Some((*syntax).into());
    }
    // A path or a name alone is that of a field, which a typed error names.
    let sentence = literal.contains(' ');
    let in_words = without_holes(literal);
    let mut words = in_words.split(|c: char| !(c.is_alphanumeric() || c == '_'));
    let name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let joined = |word: &&str| word.trim_matches('_').contains('_') && word.chars().all(name);
    if let Some(word) = words.find(joined).filter(|_| sentence) {
        return Some(word.into());
    }
    let key = |table: &&str| {
        let mut parts = literal.match_indices(*table);
        parts.any(|(at, _)| {
            let inside_a_word = literal[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
            let mut after = literal[at + table.len()..].chars();
            let dotted = after.next() == Some('.');
            let named = after
                .next()
                .is_some_and(|c| c.is_ascii_lowercase() || c == '{');
            !inside_a_word && dotted && named
        })
    };
    let table = TABLES.iter().find(|table| sentence && key(table))?;
    Some(format!("{table}."))
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs")
            && path.file_name().is_some_and(|name| name != "tests.rs")
        {
            found.push(path);
        }
    }
}

#[test]
fn no_library_crate_names_keys_of_a_design_file() {
    let libraries = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../src"));
    let mut files = Vec::new();
    for library in fs::read_dir(libraries).unwrap() {
        sources(&library.unwrap().path().join("src"), &mut files);
    }
    let (mut count, mut found) = (0, Vec::new());
    for file in &files {
        for literal in strings(&fs::read_to_string(file).unwrap()) {
            count += 1;
            if let Some(what) = of_a_design_file(&literal) {
                found.push(format!("{}: {what} in {literal}", file.display()));
            }
        }
    }
    assert!(
        files.len() > 100 && count > 300,
        "{count} strings in {} files",
        files.len()
    );
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn keys_and_syntax_are_found_where_a_user_would_read_them() {
    let found = |source: &str| -> Vec<String> {
        let strings = strings(source);
        strings
            .iter()
            .filter_map(|text| of_a_design_file(text))
            .collect()
    };
    for source in [
        r#"#[error("a slower decay is feasible: controller.decay = {decay}")] struct A;"#,
        r#"const A: &str = "set method = \"observer\"";"#,
        r##"const A: &str = r#"set kind = "auto""#;"##,
        r#"fn f() -> &'static str { "use none (internal_model = false)" }"#,
        r#"fn f() { write!(f, "give operating_point.u within signals.inputs") }"#,
        r#"fn f() { write!(f, "choose a longer sample_time for {mode:?}") }"#,
        r#"fn f() { format!("the key disturbance.{name} is missing") }"#,
    ] {
        assert_eq!(found(source).len(), 1, "{source}");
    }
    for source in [
        r#"/// Set `controller.decay = 0.9`, or `kind = "auto"`.
           struct A;"#,
        r#"#[cfg(test)] mod tests { const A: &str = "controller.decay = 1"; }"#,
        r#"fn f() { length("observer.gains", 3); field("estimator.tuning.{part}") }"#,
        r#"fn f() { format!("mode {of_mode} has {not_enough:?} samples") }"#,
        r#"const A: &str = "ask for another controller. It has rank(E) = {rank}, H_i = 0";"#,
    ] {
        assert!(found(source).is_empty(), "{source}: {:?}", found(source));
    }
}
