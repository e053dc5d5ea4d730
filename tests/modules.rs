//! No circles among the modules of a library crate, at any depth: whoever reads one needs only those below it.
//!
//! A module needs another where its code names a path (`crate::`, `self::`, `super::`, a child, or a name that a
//! `use` brought in) to what that other defines; what a module only passes on is followed to where it is defined. A
//! parent that passes on what its descendants define does not need them by that. Unit tests do not count.

mod tokens;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use tokens::{Token, group_end, tokens, without_tests};

/// The library crates, and whether the root only names modules. Where it defines plain types as well, they
/// count as below every module.
const CRATES: [(&str, bool); 8] = [
    ("baselines", true),
    ("control", false),
    ("design", true),
    ("identify", false),
    ("lapack", true),
    ("plant", false),
    ("record", true),
    ("simulate", true),
];

/// Names from the crate's root on; the root itself is empty.
type Name = Vec<String>;

/// A path as the code writes it: the words between `::`; a last `*` stands for everything.
type Written = Vec<String>;

/// The paths of a use tree that begins at `at`, each with the name that it brings in; and where the tree ends.
fn use_tree(
    tokens: &[Token],
    mut at: usize,
    before: &[String],
    found: &mut Vec<(Written, String)>,
) -> usize {
    let mut path = before.to_vec();
    loop {
        match tokens.get(at).map_or("", String::as_str) {
            "{" => {
                at += 1;
                while tokens.get(at).is_some_and(|t| t != "}") {
                    at = use_tree(tokens, at, &path, found);
                    at += usize::from(tokens.get(at).is_some_and(|t| t == ","));
                }
                return at + 1;
            }
            "," | "}" | ";" | "" => break,
            "as" => {
                let name = tokens[at + 1].clone();
                found.push((path, name));
                return at + 2;
            }
            "::" => at += 1,
            word => {
                path.push(word.to_owned());
                at += 1;
            }
        }
    }
    // `a::{self}` is `a`.
    if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
        path.pop();
    }
    let name = path.last().cloned().unwrap_or_default();
    found.push((path, name));
    at
}

#[derive(Default)]
struct Module {
    file: PathBuf,
    children: BTreeSet<String>,
    /// What is defined here.
    defined: BTreeSet<String>,
    /// Names that a `use` brings in, and from where; whether it is passed on.
    brought: BTreeMap<String, (Written, bool)>,
    /// Paths of which everything is brought in; whether it is passed on.
    globs: Vec<(Written, bool)>,
    /// Paths in the code.
    paths: BTreeSet<Written>,
}

struct Sources(BTreeMap<Name, Module>);

impl Sources {
    fn read(source: &Path) -> Self {
        let mut sources = Self(BTreeMap::new());
        sources.read_file(source, source.join("lib.rs"), Name::new());
        sources
    }

    fn read_file(&mut self, source: &Path, file: PathBuf, name: Name) {
        let text =
            fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let inside = file.strip_prefix(source).unwrap().to_path_buf();
        for child in self.read_code(&without_tests(tokens(&text)), &inside, &name) {
            let folder = source.join(child.join("/"));
            let (flat, deep) = (folder.with_extension("rs"), folder.join("mod.rs"));
            let file = if flat.exists() { flat } else { deep };
            self.read_file(source, file, child);
        }
    }

    /// Reads a module's code; returns the modules that have files of their own.
    fn read_code(&mut self, tokens: &[Token], file: &Path, name: &Name) -> Vec<Name> {
        let mut outside = Vec::new();
        let mut module = Module {
            file: file.into(),
            ..Module::default()
        };
        let mut at = 0;
        let word = |at: usize| tokens.get(at).map_or("", String::as_str);
        while at < tokens.len() {
            let free = at == 0 || !matches!(word(at - 1), "::" | "." | "r");
            match word(at) {
                "mod" if matches!(word(at + 2), ";" | "{") => {
                    let child = word(at + 1).to_owned();
                    module.children.insert(child.clone());
                    let child = [name.as_slice(), &[child]].concat();
                    if word(at + 2) == ";" {
                        outside.push(child);
                        at += 3;
                    } else {
                        let end = group_end(tokens, at + 2);
                        outside.extend(self.read_code(&tokens[at + 3..end - 1], file, &child));
                        at = end;
                    }
                }
                "use"
                    if free
                        && (at == 0
                            || matches!(word(at - 1), ";" | "}" | "{" | "]" | ")" | "pub")) =>
                {
                    let public = at > 0 && (word(at - 1) == "pub" || word(at - 1) == ")");
                    let mut found = Vec::new();
                    at = use_tree(tokens, at + 1, &[], &mut found);
                    for (path, name) in found {
                        match name.as_str() {
                            "*" => module.globs.push((path, public)),
                            _ => drop(module.brought.insert(name, (path, public))),
                        }
                    }
                }
                "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union" => {
                    module.defined.insert(word(at + 1).to_owned());
                    at += 1;
                }
                "macro_rules" => {
                    module.defined.insert(word(at + 2).to_owned());
                    at += 1;
                }
                first
                    if free
                        && word(at + 1) == "::"
                        && first.starts_with(|c: char| c.is_alphabetic() || c == '_') =>
                {
                    let mut path = vec![first.to_owned()];
                    while word(at + 1) == "::"
                        && word(at + 2).starts_with(|c: char| c.is_alphabetic() || c == '_')
                    {
                        path.push(word(at + 2).to_owned());
                        at += 2;
                    }
                    module.paths.insert(path);
                    at += 1;
                }
                _ => at += 1,
            }
        }
        self.0.insert(name.clone(), module);
        outside
    }

    /// The module that defines what `path` means in `module`; none of another crate.
    fn defining(&self, module: &Name, path: &[String], depth: usize) -> Option<Name> {
        let (first, rest) = path.split_first()?;
        let parent = || module.split_last().map(|(_, parent)| parent.to_vec());
        match first.as_str() {
            // What defines itself in terms of itself is no module.
            _ if depth > 20 => None,
            "crate" => self.within(Name::new(), rest, depth),
            "self" => self.within(module.clone(), rest, depth),
            "super" if rest.first().is_some_and(|next| next == "super") => {
                self.defining(&parent()?, rest, depth + 1)
            }
            "super" => self.within(parent()?, rest, depth),
            _ => self.named(module, path, depth),
        }
    }

    /// As [`Self::defining`], of a path that begins with a name of the module.
    fn named(&self, module: &Name, path: &[String], depth: usize) -> Option<Name> {
        let here = &self.0[module];
        let (first, rest) = path.split_first()?;
        if here.children.contains(first) {
            return self.within(
                [module.as_slice(), std::slice::from_ref(first)].concat(),
                rest,
                depth,
            );
        }
        if let Some((from, _)) = here.brought.get(first) {
            return self.defining(module, &[from.as_slice(), rest].concat(), depth + 1);
        }
        if here.defined.contains(first) {
            return Some(module.clone());
        }
        here.globs.iter().find_map(|(from, _)| {
            let from = from.split_last().map_or(from.as_slice(), |(_, from)| from);
            self.defining(module, &[from, path].concat(), depth + 1)
                .filter(|found| {
                    self.0[found].defined.contains(first)
                        || found.ends_with(std::slice::from_ref(first))
                })
        })
    }

    /// As [`Self::defining`], of a path from inside `module`: a name that is not known there, such as that of
    /// a macro's making, is its own.
    fn within(&self, module: Name, path: &[String], depth: usize) -> Option<Name> {
        match path.first().map(String::as_str) {
            None | Some("*") => Some(module),
            Some(_) => {
                let brought = self.0[&module].brought.contains_key(&path[0]);
                let found = self.named(&module, path, depth);
                // What came from another crate is passed on, not defined.
                if brought {
                    found
                } else {
                    found.or(Some(module))
                }
            }
        }
    }

    /// Paths to what a module passes on to whoever brings in everything of it by `path`.
    fn passed_on_by(&self, name: &Name, path: &[String], public: bool) -> Vec<(Written, bool)> {
        let Some(of) = self.defining(name, path, 0) else {
            return Vec::new();
        };
        let root = ["crate".to_owned()];
        let within = |name: &String| [&root, of.as_slice(), std::slice::from_ref(name)].concat();
        let brought = self.0[&of]
            .brought
            .iter()
            .filter(|(_, (_, public))| *public);
        brought.map(|(name, _)| (within(name), public)).collect()
    }

    /// Which module needs which.
    fn arrows(&self) -> BTreeMap<Name, BTreeSet<Name>> {
        let of = |name: &Name, module: &Module| {
            let passed_on = |to: &Name, public: bool| public && to.starts_with(name);
            let everything = module
                .globs
                .iter()
                .flat_map(|(path, public)| self.passed_on_by(name, path, *public));
            let everything: Vec<(Written, bool)> = everything.collect();
            let brought = module
                .brought
                .values()
                .chain(&module.globs)
                .chain(&everything);
            let brought = brought.filter_map(|(path, public)| {
                let to = self.defining(name, path, 0)?;
                (!passed_on(&to, *public)).then_some(to)
            });
            let paths = module
                .paths
                .iter()
                .filter_map(|path| self.defining(name, path, 0));
            brought.chain(paths).filter(|to| to != name).collect()
        };
        self.0
            .iter()
            .map(|(name, module)| (name.clone(), of(name, module)))
            .collect()
    }
}

/// Removes what needs nothing of the rest, until every module left is in a circle or needs one; then a way from
/// one of them back to it.
fn circle(arrows: &BTreeMap<Name, BTreeSet<Name>>) -> Option<Vec<Name>> {
    let mut left: BTreeSet<&Name> = arrows.keys().collect();
    loop {
        let needs = |name: &&Name| arrows[*name].iter().any(|to| left.contains(to));
        let next: BTreeSet<&Name> = left.iter().copied().filter(needs).collect();
        if next.len() == left.len() {
            break;
        }
        left = next;
    }
    let mut way = vec![(*left.first()?).clone()];
    loop {
        let next = arrows[way.last()?]
            .iter()
            .find(|to| left.contains(to))?
            .clone();
        if let Some(start) = way.iter().position(|name| *name == next) {
            way.drain(..start);
            way.push(next);
            return Some(way);
        }
        way.push(next);
    }
}

/// The first circle among single modules, or among the children of one module, each with all that is below it.
fn first_circle(sources: &Sources, root_only_names: bool) -> Option<String> {
    first_circle_of(sources, sources.arrows(), root_only_names)
}

/// As [`first_circle`], with these arrows.
fn first_circle_of(
    sources: &Sources,
    arrows: BTreeMap<Name, BTreeSet<Name>>,
    root_only_names: bool,
) -> Option<String> {
    let counts = |name: &Name| root_only_names || !name.is_empty();
    let mut levels = vec![arrows.clone()];
    for parent in arrows.keys() {
        let child = |name: &Name| {
            let below = name.len() > parent.len() && name.starts_with(parent);
            below.then(|| name[..=parent.len()].to_vec())
        };
        let mut level: BTreeMap<Name, BTreeSet<Name>> = BTreeMap::new();
        for (from, to) in &arrows {
            if let Some(from) = child(from) {
                level
                    .entry(from.clone())
                    .or_default()
                    .extend(to.iter().filter_map(child).filter(|to| *to != from));
            }
        }
        levels.push(level);
    }
    for mut level in levels {
        level.retain(|name, _| counts(name));
        for to in level.values_mut() {
            to.retain(counts);
        }
        if let Some(way) = circle(&level) {
            let named = |name: &Name| {
                if name.is_empty() {
                    "the root".into()
                } else {
                    name.join("::")
                }
            };
            let mut text = String::new();
            for pair in way.windows(2) {
                let _ = write!(text, "\n  {} needs {}", named(&pair[0]), named(&pair[1]));
                let below = |(name, to): &(&Name, &BTreeSet<Name>)| {
                    name.starts_with(&pair[0]) && to.iter().any(|to| to.starts_with(&pair[1]))
                };
                let file = arrows
                    .iter()
                    .find(below)
                    .map(|(name, _)| sources.0[name].file.display().to_string());
                let _ = write!(text, " ({})", file.unwrap_or_default());
            }
            return Some(text);
        }
    }
    None
}

#[test]
fn no_library_crate_has_a_circle_of_modules() {
    let source = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../src"));
    let mut circles = String::new();
    for (name, root_only_names) in CRATES {
        let sources = Sources::read(&source.join(name).join("src"));
        let arrows = sources.arrows();
        let count: usize = arrows.values().map(BTreeSet::len).sum();
        // What belongs together hangs together: of the modules below the root each but one has an arrow of its own.
        let fewest = arrows.len().saturating_sub(2).max(1);
        assert!(count >= fewest, "{count} arrows were found in {name}");
        if let Some(circle) = first_circle_of(&sources, arrows, root_only_names) {
            let _ = writeln!(
                circles,
                "{name}: modules need each other in a circle{circle}"
            );
        }
    }
    assert!(circles.is_empty(), "{circles}");
}

/// The circle of a crate made up of these files.
fn circle_of(files: &[(&str, &str)], root_only_names: bool) -> Option<String> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("ftc-modules-{}-{number}", std::process::id()));
    for (name, text) in files {
        let file = folder.join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
    }
    let found = first_circle(&Sources::read(&folder), root_only_names);
    fs::remove_dir_all(folder).unwrap();
    found
}

/// A crate in which `a` needs `b::d` and `c`; `b::d` is given.
fn made_up(below: &str) -> Option<String> {
    let files = [
        (
            "lib.rs",
            "mod a;\npub mod b;\nmod c;\npub use a::{One, Two as Deux};\npub struct Root;\n",
        ),
        (
            "a.rs",
            "use super::{b::d::Three, c};\npub struct One;\npub struct Two;\npub fn g() {}\n",
        ),
        ("b.rs", "mod d;\npub use d::Three;\n"),
        ("b/d.rs", below),
        ("c.rs", "pub struct Four;\n"),
    ];
    circle_of(&files, true)
}

#[test]
fn a_circle_is_found_however_the_path_is_written() {
    for text in [
        "use crate::{Deux, c::Four};",
        "use crate::{c::{self, Four}, a::{self as other}};",
        "pub struct Three; fn f() { crate::a::g() }",
        "fn f() { super::super::a::g() }",
        "use super::super::One;",
        "use super::super::*; fn f(one: a::One) {}",
        "use crate::*; fn f(one: One) {}",
        "fn f<'a>(q: char) -> &'a str { if q == '\"' { crate::a::g() } \"\" }",
        "const S: &str = r#\"\"#; fn f() { crate::a::g() }",
        "mod inside { fn f() { super::super::super::a::g() } }",
        "mod inside { use self::deep::g; mod deep { pub use crate::a::g; } }",
        "#[cfg(not(test))] mod x { use crate::a::One; }",
    ] {
        let circle = made_up(text).unwrap_or_else(|| panic!("none in {text}"));
        assert!(circle.contains("b/d.rs"), "{text}: {circle}");
    }
}

#[test]
fn what_does_not_count_makes_no_circle() {
    for text in [
        "use crate::c::Four; pub struct Three;",
        "// crate::a\n/* use crate::a::One; /* nested */ */ pub struct Three;",
        "const S: &str = \"crate::a::g()\"; const R: &str = r#\"use \"crate::a\"; \"#;",
        "#[cfg(test)] mod tests { use crate::a::One; }",
        "#[cfg(test)]\n#[allow(unused)]\n\n  mod others {\n use crate::a::One; fn f() { { } } }",
        "#[cfg(all(test, unix))] fn f() { crate::a::g() }",
        "use nalgebra::a::One; use std::{a, fmt};",
        "use self::Three as Drei; pub struct Three;",
    ] {
        assert_eq!(made_up(text), None, "{text}");
    }
}

#[test]
fn a_root_that_defines_something_counts_only_where_it_is_told_to() {
    let files = [
        ("lib.rs", "mod a;\npub struct Root;\nfn f() { a::g() }\n"),
        ("a.rs", "use crate::Root;\npub fn g() {}\n"),
    ];
    assert!(circle_of(&files, true).is_some());
    assert_eq!(circle_of(&files, false), None);
}

#[test]
fn circles_of_nested_modules_are_found() {
    let among_siblings = [
        ("lib.rs", "mod a;\n"),
        ("a/mod.rs", "mod b;\nmod c;\nmod d;\n"),
        ("a/b.rs", "use super::c::C;\npub struct B;\n"),
        (
            "a/c.rs",
            "pub struct C;\npub(super) fn f() { super::d::e::g() }\n",
        ),
        ("a/d.rs", "pub mod e;\n"),
        ("a/d/e.rs", "pub fn g() -> crate::a::b::B { todo!() }\n"),
    ];
    let circle = circle_of(&among_siblings, false).unwrap();
    for step in ["a::b needs a::c", "a::c needs a::d", "(a/d/e.rs)"] {
        assert!(circle.contains(step), "{circle}");
    }
    // None of these files is in a circle, only the folders are.
    let of_folders = [
        ("lib.rs", "mod a;\nmod b;\n"),
        ("a.rs", "pub mod one;\npub mod two;\n"),
        ("a/one.rs", "pub struct One;\n"),
        ("a/two.rs", "use crate::b::three::Three;\n"),
        ("b.rs", "pub mod three;\npub mod four;\n"),
        ("b/three.rs", "pub struct Three;\n"),
        ("b/four.rs", "use crate::a::one::One;\n"),
    ];
    let circle = circle_of(&of_folders, false).unwrap();
    assert!(circle.contains("a needs b (a/two.rs)"), "{circle}");
    assert!(circle.contains("b needs a (b/four.rs)"), "{circle}");
    let with_parent = [
        ("lib.rs", "mod a;\n"),
        (
            "a.rs",
            "mod b;\npub struct A;\npub fn f(a: &A) { b::g(a) }\n",
        ),
        ("a/b.rs", "use super::A;\npub fn g(_: &A) {}\n"),
    ];
    let circle = circle_of(&with_parent, false).unwrap();
    assert!(circle.contains("a::b needs a (a/b.rs)"), "{circle}");
}
