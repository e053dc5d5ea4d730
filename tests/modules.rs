//! No circles among the modules of a library crate: whoever reads one needs only those below it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The library crates, and whether the root only names modules. Where it defines plain types as well, they
/// count as below every module.
const CRATES: [(&str, bool); 6] = [
    ("control", false),
    ("design", true),
    ("identify", false),
    ("lapack", true),
    ("plant", false),
    ("simulate", true),
];

/// Which module needs which, and a file that says so.
type Arrows = BTreeMap<String, BTreeMap<String, PathBuf>>;

/// The code of a file without comments and without the unit tests at its end.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text
        .split("#[cfg(test)]\nmod tests")
        .next()
        .unwrap_or_default();
    text.lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join("\n")
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files(&path, found),
            false => found.push(path),
        }
    }
}

/// The first name of a path.
fn first_name(path: &str) -> &str {
    let end = path.find(|c: char| !c.is_alphanumeric() && c != '_');
    &path[..end.unwrap_or(path.len())]
}

/// The entries of `{a, b::{c, d}}`, which begins after the brace.
fn entries(group: &str) -> Vec<&str> {
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            ',' if depth == 0 => {
                found.push(group[start..at].trim());
                start = at + 1;
            }
            '}' if depth == 0 => {
                found.push(group[start..at].trim());
                return found;
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    found
}

/// Names that follow `prefix::` in the code.
fn names<'a>(code: &'a str, prefix: &str) -> Vec<&'a str> {
    let prefix = format!("{prefix}::");
    let mut found = Vec::new();
    for (at, _) in code.match_indices(&prefix) {
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':') {
            continue;
        }
        let rest = &code[at + prefix.len()..];
        match rest.strip_prefix('{') {
            Some(group) => found.extend(entries(group).into_iter().map(first_name)),
            None => found.push(first_name(rest)),
        }
    }
    found
}

/// What the crate's root names: its modules, and where a name that it exports comes from.
fn exports(root: &str) -> (BTreeSet<&str>, BTreeMap<&str, &str>) {
    let declared = root
        .match_indices("mod ")
        .map(|(at, word)| &root[at + word.len()..]);
    let modules: BTreeSet<&str> = declared
        .filter(|rest| rest[first_name(rest).len()..].starts_with(';'))
        .map(first_name)
        .collect();
    let mut origins = BTreeMap::new();
    for &module in &modules {
        for name in names(root, module) {
            origins.insert(name, module);
        }
    }
    (modules, origins)
}

fn arrows(source: &Path, root_only_names: bool) -> Arrows {
    let root = code(&source.join("lib.rs"));
    let (modules, origins) = exports(&root);
    let mut paths = Vec::new();
    files(source, &mut paths);
    let mut found = Arrows::new();
    for path in paths {
        let inside = path.strip_prefix(source).unwrap();
        let top = inside.components().next().unwrap().as_os_str();
        let module = top.to_str().unwrap().trim_end_matches(".rs").to_owned();
        if module == "lib" || path.extension().is_none_or(|kind| kind != "rs") {
            continue;
        }
        let code = code(&path);
        let mut needed = names(&code, "crate");
        if inside.components().count() == 1 {
            needed.extend(names(&code, "super"));
        }
        for name in needed {
            let to = match modules.get(name) {
                Some(module) => module,
                None => origins.get(name).unwrap_or(&"lib"),
            };
            if *to != module && (root_only_names || *to != "lib") {
                let of = found.entry(module.clone()).or_default();
                of.entry((*to).to_owned()).or_insert_with(|| inside.into());
            }
        }
    }
    let through_root = modules.iter().map(|&m| (m.to_owned(), "lib.rs".into()));
    found.insert("lib".into(), through_root.collect());
    found
}

/// A way from `at` back to `start`, which `path` leads to.
fn circle(arrows: &Arrows, start: &str, at: &str, seen: &mut BTreeSet<String>) -> Option<String> {
    for (to, file) in arrows.get(at)? {
        let step = format!("\n  {at} needs {to} ({})", file.display());
        if to == start {
            return Some(step);
        }
        if seen.insert(to.clone())
            && let Some(rest) = circle(arrows, start, to, seen)
        {
            return Some(step + &rest);
        }
    }
    None
}

fn first_circle(arrows: &Arrows) -> Option<String> {
    let mut starts = arrows.keys();
    starts.find_map(|start| circle(arrows, start, start, &mut BTreeSet::new()))
}

#[test]
fn no_library_crate_has_a_circle_of_modules() {
    let source = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../src"));
    for (name, root_only_names) in CRATES {
        let arrows = arrows(&source.join(name).join("src"), root_only_names);
        assert!(arrows.len() > 1, "no arrows were found in {name}");
        if let Some(circle) = first_circle(&arrows) {
            panic!("{name}: modules need each other in a circle{circle}");
        }
    }
}

#[test]
fn a_circle_is_found_however_it_is_written() {
    let folder = std::env::temp_dir().join(format!("ftc-modules-{}", std::process::id()));
    fs::create_dir_all(folder.join("b")).unwrap();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write(
        "lib.rs",
        "mod a;\npub mod b;\nmod c;\npub use a::{One, Two};\n",
    );
    write("a.rs", "use super::{b::Three, c};\n");
    write("b.rs", "mod d;\n");
    write(
        "c.rs",
        "// crate::a\n#[cfg(test)]\nmod tests { use crate::a::One; }\n",
    );
    let below = |text: &str| {
        write("b/d.rs", text);
        first_circle(&arrows(&folder, true))
    };
    assert_eq!(below("use crate::c::Four;\n"), None);
    for text in [
        "use crate::{Two, c::Four};\n",
        "fn f() { crate::a::g() }\n",
        "use crate::defined_in_the_root;\n",
    ] {
        let circle = below(text).expect(text);
        assert!(circle.contains("b/d.rs"), "{circle}");
    }
    fs::remove_dir_all(folder).unwrap();
}
