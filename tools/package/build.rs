//! Gathers the licence texts of every crate that the FMU binaries link, for the FMUs' documentation.
//!
//! Cargo says which crates these are and where their sources lie; the texts are those that came with
//! the sources.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// The crates of the FMU binaries.
const BINARIES: [&str; 2] = ["ftc-controller-fmu", "ftc-plant-fmu"];

/// How the files with licences and notices begin, in small letters.
const TEXTS: [&str; 5] = ["license", "licence", "copying", "copyright", "notice"];

/// What the Rust toolchain says of its standard library.
const STANDARD_LIBRARY: &str = "share/doc/rust/COPYRIGHT-library.html";

/// Crates within the standard library that its own notices leave out. Their texts come with the versions
/// that this repository uses itself.
const IN_STANDARD_LIBRARY: [&str; 5] = ["addr2line", "adler2", "memchr", "miniz_oxide", "object"];

/// One linked crate.
struct Package {
    name: String,
    version: String,
    license: String,
    authors: Vec<String>,
    folder: PathBuf,
    /// Whether the binaries have it by the standard library.
    in_standard_library: bool,
}

fn main() {
    let root = Path::new(&variable("CARGO_MANIFEST_DIR")).join("../..");
    let out = PathBuf::from(variable("OUT_DIR"));
    for file in ["Cargo.lock", "LICENSE-MIT", "LICENSE-APACHE", "fmu"] {
        println!("cargo:rerun-if-changed={}", root.join(file).display());
    }
    let packages = packages(&root);
    let missing: Vec<&str> = (packages.iter())
        .filter(|package| texts(&package.folder).is_empty())
        .map(|package| package.name.as_str())
        .collect();
    assert!(missing.is_empty(), "no licence text came with {missing:?}");
    fs::write(out.join("licenses.txt"), document(&root, &packages)).expect("OUT_DIR is writable");
    fs::write(out.join("rust-standard-library.html"), standard_library()).expect("as above");
}

fn variable(name: &str) -> String {
    env::var(name).unwrap_or_else(|_| panic!("cargo sets {name}"))
}

/// What a cargo command says; it fetches nothing but crates that are in the lock file and not here yet.
fn cargo(root: &Path, arguments: &[&str]) -> String {
    let output = Command::new(variable("CARGO"))
        .args(arguments)
        .arg("--locked")
        .current_dir(root)
        .output()
        .expect("cargo runs");
    assert!(
        output.status.success(),
        "cargo {arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).expect("cargo writes UTF-8")
}

/// The crates that the binaries link, but for those of this repository.
fn packages(root: &Path) -> Vec<Package> {
    let mut tree = vec!["tree", "--edges", "normal,no-proc-macro"];
    tree.extend(["--prefix", "none", "--format", "{p}"]);
    tree.extend(BINARIES.iter().flat_map(|name| ["--package", name]));
    let tree = cargo(root, &tree);
    let linked: Vec<(&str, &str)> = tree
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?, words.next()?.strip_prefix('v')?))
        })
        .collect();
    let target = variable("TARGET");
    let metadata = cargo(
        root,
        &[
            "metadata",
            "--format-version",
            "1",
            "--filter-platform",
            &target,
        ],
    );
    let metadata: Value = serde_json::from_str(&metadata).expect("cargo writes JSON");
    let text = |value: &Value| value.as_str().unwrap_or_default().to_string();
    let mut packages: Vec<Package> = metadata["packages"]
        .as_array()
        .expect("there are packages")
        .iter()
        .filter(|package| !package["source"].is_null())
        .map(|package| Package {
            name: text(&package["name"]),
            version: text(&package["version"]),
            license: text(&package["license"]),
            authors: (package["authors"].as_array().into_iter().flatten())
                .map(text)
                .collect(),
            folder: Path::new(&text(&package["manifest_path"])).with_file_name(""),
            in_standard_library: IN_STANDARD_LIBRARY.contains(&text(&package["name"]).as_str()),
        })
        .filter(|package| {
            package.in_standard_library || linked.contains(&(&package.name, &package.version))
        })
        .collect();
    let found = |name| packages.iter().any(|package| package.name == name);
    let missing: Vec<_> = IN_STANDARD_LIBRARY
        .iter()
        .filter(|name| !found(**name))
        .collect();
    assert!(
        missing.is_empty(),
        "no crate in the lock file brings the licence of {missing:?}"
    );
    packages.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
    packages
}

/// The files with licences and notices that lie beside a crate's manifest.
fn texts(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let name = name.to_lowercase();
            path.is_file() && (name == "unlicense" || TEXTS.iter().any(|t| name.starts_with(t)))
        })
        .collect();
    files.sort();
    files
}

/// The list of crates, and every text once, with the crates that it came with.
fn document(root: &Path, packages: &[Package]) -> String {
    let mut out = format!(
        "This FMU contains a generic binary of ftc-fmu {}, licensed under either of MIT or\n\
         Apache-2.0 at your option, and a design (resources/design.cbor), which belongs to whoever\n\
         made it.\n\n\
         The binary links the Rust standard library (rust-standard-library.html beside this file)\n\
         and these crates statically; their licence texts and notices follow.\n\n",
        variable("CARGO_PKG_VERSION")
    );
    for package in packages {
        let (name, version, license) = (&package.name, &package.version, &package.license);
        let authors = package.authors.join(", ");
        let within = if package.in_standard_library {
            " (in the standard library)"
        } else {
            ""
        };
        writeln!(out, "  {name} {version}  {license}  {authors}{within}")
            .expect("a string takes all");
    }
    let mut by_text: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut note = |path: &Path, of: String| {
        let bytes = fs::read(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
        let text = String::from_utf8_lossy(&bytes).replace("\r\n", "\n");
        let of_text = by_text.entry(text.trim_end().to_string()).or_default();
        if !of_text.contains(&of) {
            of_text.push(of);
        }
    };
    for file in ["LICENSE-MIT", "LICENSE-APACHE"] {
        note(&root.join(file), "ftc-fmu".into());
    }
    for package in packages {
        for path in texts(&package.folder) {
            note(&path, format!("{} {}", package.name, package.version));
        }
    }
    let mut texts: Vec<_> = by_text.into_iter().collect();
    texts.sort_by(|a, b| a.1.cmp(&b.1));
    for (text, of) in texts {
        let line = "=".repeat(80);
        write!(out, "\n{line}\n{}\n{line}\n\n{text}\n", of.join(", ")).expect("as above");
    }
    out
}

/// The notices of the standard library as the toolchain has them, or where they are to be found.
fn standard_library() -> String {
    let rustc = env::var_os("RUSTC").unwrap_or("rustc".into());
    let sysroot = Command::new(rustc).args(["--print", "sysroot"]).output();
    let sysroot = sysroot.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_string());
    let notices = sysroot.map(|root| fs::read_to_string(Path::new(&root).join(STANDARD_LIBRARY)));
    match notices {
        Ok(Ok(notices)) => notices,
        _ => "<!DOCTYPE html><title>Rust standard library</title><p>Copyright the Rust Project \
              contributors, MIT OR Apache-2.0. The toolchain that built this program came without \
              its notices: see COPYRIGHT-library.html of a Rust release.\n"
            .into(),
    }
}
