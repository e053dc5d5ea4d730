//! `verify` proves what an FMU promises, and notices whatever does not belong to it.
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, Outcome, SOUND, installed, unzip};
use package::platform::HOST as HERE;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::sync::OnceLock;
use zip::write::SimpleFileOptions;

const DESIGN: &str = "resources/design.cbor";
const CERTIFICATE: &str = "resources/certificate.json";
const DESCRIPTION: &str = "modelDescription.xml";

/// Another platform than this machine's, and the number by which an ELF file names its processor.
const OTHER: (&str, u8) = if cfg!(target_arch = "aarch64") {
    ("linux64", 0x3E)
} else {
    ("aarch64-linux", 0xB7)
};
const ELSEWHERE: &str = OTHER.0;

/// A library for this machine that offers what an importer needs, and does nothing.
fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| compiled(&FUNCTIONS))
}

const FUNCTIONS: [&str; 10] = [
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi2Instantiate",
    "fmi2FreeInstance",
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2GetReal",
    "fmi2SetReal",
    "fmi2DoStep",
];

/// A shared library of empty functions, made by the C compiler.
fn compiled(functions: &[&str]) -> Vec<u8> {
    let bench = Bench::empty();
    let source: String = functions
        .iter()
        .map(|name| format!("void {name}(void) {{}}\n"))
        .collect();
    fs::write(bench.path("x.c"), source).unwrap();
    let status = std::process::Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .args([bench.path("x.so"), bench.path("x.c")])
        .status()
        .unwrap();
    assert!(status.success());
    fs::read(bench.path("x.so")).unwrap()
}

/// An exported controller, unpacked.
struct Exported {
    bench: Bench,
    files: BTreeMap<String, Vec<u8>>,
}

impl Exported {
    fn new(design: &str) -> Self {
        Self::made(Bench::new(design), &[])
    }

    /// Exported with more arguments.
    fn made(bench: Bench, arguments: &[&str]) -> Self {
        let program = installed(&bench, &[]);
        let folder = bench.path("bin/fmu-binaries").join(HERE);
        fs::create_dir_all(&folder).unwrap();
        for kind in ["controller", "plant"] {
            fs::write(folder.join(format!("ftc_{kind}.so")), library()).unwrap();
        }
        let output = std::process::Command::new(&program)
            .args(["export", FILE, "--out", "out"])
            .args(arguments)
            .current_dir(bench.path("."))
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let files = unzip(&bench.path("out/sound_controller.fmu"));
        Self { bench, files }
    }

    /// Design or certificate with its contents, as JSON, changed.
    fn change(&mut self, name: &str, change: impl Fn(&mut Value)) {
        let bytes = &self.files[name];
        let mut value: Value = match name {
            DESIGN => serde_json::to_value(model_description::read_design(bytes).unwrap()),
            _ => serde_json::from_slice(bytes),
        }
        .unwrap();
        let before = value.clone();
        change(&mut value);
        assert_ne!(value, before, "nothing was changed in {name}");
        let bytes = match name {
            DESIGN => {
                let design = serde_json::from_value(value).unwrap();
                model_description::write_design(&design).unwrap()
            }
            _ => serde_json::to_vec(&value).unwrap(),
        };
        self.files.insert(name.into(), bytes);
    }

    /// Makes fingerprints fit the design again, as a careful forger would.
    fn seal(&mut self) {
        let design = self.files[DESIGN].clone();
        let xml = String::from_utf8(self.files[DESCRIPTION].clone()).unwrap();
        let (before, rest) = xml.split_once("guid=\"").unwrap();
        let (_, after) = rest.split_once('"').unwrap();
        let guid = model_description::guid(model_description::CONTROLLER, &design);
        self.files.insert(
            DESCRIPTION.into(),
            format!("{before}guid=\"{guid}\"{after}").into_bytes(),
        );
        let fingerprint = model_description::guid("certificate", &design);
        self.change(CERTIFICATE, |value| {
            value["design"] = fingerprint.as_str().into()
        });
    }

    fn verify(&self) -> Outcome {
        self.verify_bytes(&self.zipped())
    }

    fn write(&self, bytes: &[u8]) {
        fs::write(self.bench.path("x.fmu"), bytes).unwrap();
    }

    fn zipped(&self) -> Vec<u8> {
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in &self.files {
            archive
                .start_file(name.as_str(), SimpleFileOptions::default())
                .unwrap();
            archive.write_all(bytes).unwrap();
        }
        archive.finish().unwrap().into_inner()
    }

    /// What verify says of the files with these arguments: exit code and its one sentence.
    fn says(&self, arguments: &[&str]) -> (i32, String) {
        self.write(&self.zipped());
        let run = self.bench.run(&[&["verify", "x.fmu"], arguments].concat());
        (run.code(), run.stderr() + &run.stdout())
    }

    fn verify_bytes(&self, bytes: &[u8]) -> Outcome {
        self.write(bytes);
        // The libraries of most tests do nothing, so that there is nothing to run.
        self.bench.run(&["verify", "x.fmu", "--json", "--no-run"])
    }

    /// The verdict must be no, in one sentence with these words.
    fn refused(&self, case: &str, code: i32, words: &[&str]) {
        let run = self.verify();
        assert_eq!(run.code(), code, "{case}: {}", run.stderr());
        assert_eq!(run.stderr().trim_end().lines().count(), 1, "{case}");
        for word in words {
            assert!(run.stderr().contains(word), "{case}: {}", run.stderr());
        }
        if code == 1 {
            assert_eq!(run.json()["verified"], false, "{case}");
        }
    }
}

fn scaled(value: &mut Value, factor: f64) {
    *value = (value.as_f64().unwrap() * factor).into();
}

fn dwelling() -> String {
    SOUND
        .replace("\"common\"", "\"dwell\"")
        .replace("decay = 0.7\noutput", "decay = 0.9\noutput")
}

/// promise: carried-proof
#[test]
fn both_fmus_are_proved_and_their_promises_printed() {
    let exported = Exported::new(SOUND);
    let report = exported.bench.run(&["design", FILE, "--json"]).json();
    for kind in ["controller", "plant"] {
        let path = format!("out/sound_{kind}.fmu");
        let run = exported.bench.run(&["verify", &path, "--json", "--no-run"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let found = run.json();
        assert_eq!(found["verified"], true);
        assert_eq!(found["gamma"], report["gamma"]);
        assert_eq!(found["state_feedback"]["decay"], 0.7);
        assert_eq!(found["state_feedback"]["arbitrary_switching"], true);
        assert_eq!(found["observer"]["arbitrary_switching"], true);
        let run = exported.bench.run(&["verify", &path, "--no-run"]);
        for word in [
            "proved",
            "arbitrary switching",
            "decay",
            "l2 gain",
            "nothing was solved",
            "not run",
            "anybody may have made this FMU",
        ] {
            assert!(run.stdout().contains(word), "{word}: {}", run.stdout());
        }
    }
    assert_eq!(exported.verify().code(), 0, "packed again, it is the same");
}

/// promise: carried-proof
#[test]
fn a_dwell_time_is_proved_and_a_shorter_one_is_not() {
    let mut exported = Exported::new(&dwelling());
    let run = exported.verify();
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let found = run.json();
    assert_eq!(found["state_feedback"]["arbitrary_switching"], false);
    assert!(
        found["state_feedback"]["dwell_time_samples"]
            .as_f64()
            .unwrap()
            > 1.0
    );
    exported.change(CERTIFICATE, |certificate| {
        let dwell = &mut certificate["proof"]["state_feedback"]["dwell"];
        scaled(&mut dwell["samples"], 0.9);
        scaled(&mut dwell["seconds"], 0.9);
    });
    exported.refused("shorter dwell time", 1, &[]);
}

/// promise: carried-proof
#[test]
fn parts_that_do_not_belong_together() {
    let mut gain = Exported::new(SOUND);
    gain.change(DESIGN, |design| {
        scaled(
            &mut design["controller"]["feedback"]["modes"][0]["state_feedback"][0][0],
            1.0 + 1e-12,
        );
    });
    gain.refused("tampered gain", 1, &["guid", DESIGN]);

    let mut description = Exported::new(SOUND);
    let other = Exported::new(&SOUND.replace("seed = 3", "seed = 4"));
    description
        .files
        .insert(DESCRIPTION.into(), other.files[DESCRIPTION].clone());
    description.refused("foreign description", 1, &["guid"]);

    let mut certificate = Exported::new(SOUND);
    certificate
        .files
        .insert(CERTIFICATE.into(), other.files[CERTIFICATE].clone());
    certificate.refused("foreign certificate", 1, &[CERTIFICATE, "another design"]);

    for (path, factor) in [
        ("state_feedback/gamma/0", 0.99),
        ("state_feedback/decay", 0.5),
        ("observer/certificate/lyapunov/0/0/0", -1.0),
        ("state_feedback/certificate/lyapunov/0/core/0/0", 0.5),
        ("running_loop/noise_gain/0", 0.99),
    ] {
        let mut exported = Exported::new(SOUND);
        exported.change(CERTIFICATE, |value| {
            let number = value.pointer_mut(&format!("/proof/{path}"));
            scaled(number.unwrap(), factor);
        });
        exported.refused(path, 1, &["proved", "export"]);
    }
}

/// promise: carried-proof
#[test]
fn a_careful_forger_is_found_out() {
    let mut running = Exported::new(SOUND);
    running.change(DESIGN, |design| {
        scaled(
            &mut design["controller"]["feedback"]["modes"][1]["integral"][0][0],
            1.001,
        );
    });
    running.seal();
    running.refused("gain that runs", 1, &["mode 2", "proved"]);

    for (key, value, word) in [
        ("latency", serde_json::json!(1), "sizes"),
        ("resonators", serde_json::json!([0.02]), "sizes"),
        ("tracked", serde_json::json!([1, 0]), "proved"),
    ] {
        let mut changed = Exported::new(SOUND);
        changed.change(DESIGN, |design| {
            design["controller"]["feedback"][key] = value.clone();
        });
        changed.seal();
        changed.refused(key, 1, &[word, "export the design again"]);
    }

    // The range of an input stands in the description, too.
    let limited =
        "[signals]\ninputs = [{ name = \"c\", min = -9.0, max = 9.0 }, { name = \"d\" }]\n";
    let mut limit = Exported::new(&SOUND.replace("[signals]\n", limited));
    limit.change(DESIGN, |design| {
        design["signals"]["inputs"][0]["max"] = 8.0.into();
    });
    limit.seal();
    limit.refused("limit", 1, &[DESCRIPTION, "line"]);

    let mut observer = Exported::new(SOUND);
    observer.change(DESIGN, |design| {
        let gains = &mut design["controller"]["observer"]["gains"][0];
        let entry = first_number(gains).unwrap();
        *entry = (entry.as_f64().unwrap() + 0.1).into();
    });
    observer.seal();
    observer.refused("observer that runs", 1, &["proved"]);

    let mut wild = Exported::new(SOUND);
    wild.change(DESIGN, |design| {
        let gains = &mut design["controller"]["feedback"]["modes"][0]["state_feedback"];
        scaled(&mut gains[0][0], 1.5);
    });
    wild.seal();
    wild.refused("gain far off", 1, &["mode 1", "proved"]);

    let mut plant = Exported::new(SOUND);
    plant.change(DESIGN, |design| {
        scaled(&mut design["plant"]["modes"][0]["a"][0][0], 1.3);
    });
    plant.seal();
    plant.refused("another plant", 1, &["proved"]);

    let mut gamma = Exported::new(SOUND);
    gamma.change(CERTIFICATE, |certificate| {
        for mode in 0..2 {
            let gamma = &mut certificate["proof"]["state_feedback"]["gamma"][mode];
            scaled(gamma, 0.99);
        }
    });
    gamma.refused("gamma lowered", 1, &["attenuation", "proved"]);
}

/// promise: carried-proof
#[test]
fn a_description_that_says_something_else() {
    let mut renamed = Exported::new(SOUND);
    let xml = String::from_utf8(renamed.files[DESCRIPTION].clone()).unwrap();
    assert!(xml.contains("name=\"u[1]\""));
    let line = xml
        .lines()
        .position(|line| line.contains("name=\"u[1]\""))
        .unwrap()
        + 1;
    let changed = xml.replace("name=\"u[1]\"", "name=\"u[7]\"");
    renamed
        .files
        .insert(DESCRIPTION.into(), changed.into_bytes());
    renamed.refused("a name", 1, &[DESCRIPTION, &format!("line {line} on")]);
}

/// promise: carried-proof
#[test]
fn binaries_that_are_none() {
    let at = |platform: &str, name: &str| format!("binaries/{platform}/{name}.so");
    let path = at(HERE, "sound_controller");
    let path = path.as_str();
    let with = |name: &str, bytes: Option<&[u8]>| {
        let mut exported = Exported::new(SOUND);
        let sound = exported.files.remove(path).unwrap();
        exported
            .files
            .extend(bytes.map(|bytes| (name.to_string(), bytes.to_vec())));
        exported
            .files
            .extend((name != path).then(|| (path.to_string(), sound)));
        exported
    };
    with(path, None).refused("removed", 1, &["no binary"]);
    with(path, Some(b"hello")).refused("text", 1, &[path, &format!("is no library for {HERE}")]);
    let cut = &library()[..library().len() / 2];
    with(path, Some(cut)).refused("cut", 1, &[path]);
    let (last, most) = FUNCTIONS.split_last().unwrap();
    with(path, Some(&compiled(most))).refused("a function less", 1, &[path, last]);
    let other = at(ELSEWHERE, "sound_controller");
    with(&other, Some(library())).refused(
        "another machine",
        1,
        &[&other, &format!("is no library for {ELSEWHERE}")],
    );
    let stranger = at(HERE, "other");
    with(&stranger, Some(library())).refused("stranger", 1, &[&stranger, "no part of this FMU"]);
}

fn first_number(value: &mut Value) -> Option<&mut Value> {
    match value {
        Value::Number(_) => Some(value),
        Value::Array(list) => list.iter_mut().find_map(first_number),
        Value::Object(map) => map.values_mut().find_map(first_number),
        _ => None,
    }
}

/// promise: carried-proof
#[test]
fn what_is_missing_or_no_fmu_of_ours() {
    for name in [DESIGN, CERTIFICATE, DESCRIPTION] {
        let mut exported = Exported::new(SOUND);
        exported.files.remove(name);
        exported.refused(name, 2, &[name, "export"]);
        let mut exported = Exported::new(SOUND);
        exported.files.insert(name.into(), b"{".to_vec());
        let code = if name == DESIGN { 1 } else { 2 };
        exported.refused(name, code, &[name]);
    }
    let mut longer = Exported::new(SOUND);
    longer.files.get_mut(DESIGN).unwrap().push(0);
    longer.seal();
    longer.refused("a byte more", 2, &[DESIGN, "more than a design"]);
    let bench = Bench::new(SOUND);
    for (path, word) in [
        (FILE, "this is no FMU"),
        (".", "directory"),
        ("none.fmu", "opened"),
    ] {
        let run = bench.run(&["verify", path]);
        assert_eq!(run.code(), 2, "{path}");
        assert!(run.stderr().contains(path), "{}", run.stderr());
        assert!(run.stderr().contains(word), "{}", run.stderr());
    }
    let packed = Exported::made(Bench::new(SOUND), &["--ssp"]);
    let run = packed.bench.run(&["verify", "out/sound.ssp"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr()
            .contains("an SSP package: name one of the FMUs in its resources"),
        "{}",
        run.stderr()
    );
}

/// promise: carried-proof
#[test]
fn a_damaged_archive_is_never_taken_for_another_design() {
    let exported = Exported::new(SOUND);
    let bytes = fs::read(exported.bench.path("out/sound_controller.fmu")).unwrap();
    let sound = exported.verify_bytes(&bytes).stdout();
    for length in (0..bytes.len()).step_by(bytes.len() / 40) {
        let run = exported.verify_bytes(&bytes[..length]);
        assert_eq!(run.code(), 2, "{length} bytes: {}", run.stderr());
    }
    // Bits of time stamps and the like carry no meaning; every other one is noticed.
    let mut noticed = 0;
    let places: Vec<usize> = (0..bytes.len()).step_by(bytes.len() / 150).collect();
    for &at in &places {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0x10;
        let run = exported.verify_bytes(&flipped);
        match run.code() {
            0 => assert_eq!(run.stdout(), sound, "byte {at}"),
            1 | 2 => noticed += 1,
            code => panic!("byte {at}: exit code {code}: {}", run.stderr()),
        }
    }
    assert!(10 * noticed > 8 * places.len(), "{noticed}");
}

/// Archives too large to unpack, and descriptions that took minutes to read.
///
/// promise: bounded-reading
#[test]
fn archives_that_are_none_of_ours() {
    let exported = Exported::new(SOUND);
    let bytes = fs::read(exported.bench.path("out/sound_controller.fmu")).unwrap();
    let refused = |case: &str, bytes: &[u8], word: &str| {
        let run = exported.verify_bytes(bytes);
        assert_eq!(run.code(), 2, "{case}: {}", run.stderr());
        assert!(run.stderr().contains(word), "{case}: {}", run.stderr());
        assert_eq!(run.stderr().trim_end().lines().count(), 1, "{case}");
    };
    refused(
        "junk after the end",
        &[&bytes[..], b"junk"].concat(),
        "damaged",
    );
    let mut two_names = bytes.clone();
    two_names[30] ^= 1;
    refused("two names", &two_names, "another name");
    let mut fewer = bytes.clone();
    let count = fewer.len() - 22 + 10;
    fewer[count] -= 1;
    refused("a count that is wrong", &fewer, "damaged");

    for (name, word) in [
        ("notes.txt", "no part"),
        ("documentation/../../escaped", "no path inside"),
        ("/etc/passwd", "no path inside"),
        ("documentation\\windows", "no path inside"),
        ("binaries/a\0b", "no path inside"),
    ] {
        let mut other = Exported::new(SOUND);
        other.files.insert(name.into(), b"x".to_vec());
        other.refused(name, 2, &[word]);
    }
    let mut many = Exported::new(SOUND);
    for number in 0..70 {
        let name = format!("documentation/{number}");
        many.files.insert(name, Vec::new());
    }
    many.refused("many entries", 2, &["more than 64 entries"]);

    let mut large = Exported::new(SOUND);
    let zeros = vec![0; (256 << 20) + 1];
    large.files.insert("documentation/index.html".into(), zeros);
    large.refused("unpacked size", 2, &["larger than 256 MB"]);

    let mut wide = Exported::new(SOUND);
    let attributes: String = (0..60_000).map(|at| format!(" a{at}=\"\"")).collect();
    let xml = format!("<fmiModelDescription{attributes} guid=\"none\"/>");
    wide.files.insert(DESCRIPTION.into(), xml.into_bytes());
    let begun = std::time::Instant::now();
    wide.refused("many attributes", 1, &["guid"]);
    assert!(begun.elapsed().as_secs() < 20, "{:?}", begun.elapsed());
}

/// Writes a key pair of minisign as `NAME.key` and `NAME.pub`.
fn key_pair(bench: &Bench, name: &str) {
    let pair = minisign::KeyPair::generate_unencrypted_keypair().unwrap();
    let secret = pair.sk.to_box(None).unwrap().into_string();
    fs::write(bench.path(&format!("{name}.key")), secret).unwrap();
    let public = pair.pk.to_box().unwrap().into_string();
    fs::write(bench.path(&format!("{name}.pub")), public).unwrap();
}

/// A signed FMU is accepted by its key alone; what nothing else looks at cannot be changed either; every
/// refusal says what is wrong.
///
/// promise: signed
#[test]
fn a_signature_tells_whose_fmu_it_is() {
    let bench = Bench::new(SOUND);
    key_pair(&bench, "own");
    key_pair(&bench, "other");
    let mut signed = Exported::made(bench, &["--sign", "own.key"]);
    let own = ["--no-run", "--key", "own.pub"];
    let (code, said) = signed.says(&own);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("over every file of the FMU"), "{said}");
    let (code, said) = signed.says(&["--no-run"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("not checked"), "{said}");
    let (code, said) = signed.says(&["--no-run", "--key", "other.pub"]);
    assert!(code == 1 && said.contains("not by key"), "{said}");
    for absent in ["none.pub", "own.key"] {
        let (code, said) = signed.says(&["--no-run", "--key", absent]);
        assert!(code == 2 && said.contains(absent), "{said}");
    }
    let page = "documentation/index.html";
    signed.files.insert(page.into(), b"another page".to_vec());
    for arguments in [&own[..], &["--no-run"]] {
        let (code, said) = signed.says(arguments);
        assert!(code == 1 && said.contains(page), "{said}");
    }
    let bench = Bench::new(SOUND);
    key_pair(&bench, "own");
    let (code, said) = Exported::made(bench, &[]).says(&own);
    assert!(code == 1 && said.contains("not signed"), "{said}");
}

/// A key that cannot be used is refused before anything is written.
///
/// promise: signed
#[test]
fn a_key_that_cannot_sign_is_refused() {
    let bench = Bench::new(SOUND);
    fs::write(bench.path("no.key"), "no key\n").unwrap();
    for key in ["no.key", "none.key"] {
        let run = bench.run(&["export", FILE, "--out", "out", "--sign", key]);
        assert_eq!(run.code(), 2, "{}", run.stderr());
        assert!(run.stderr().contains(key), "{}", run.stderr());
        assert!(!bench.path("out/sound_controller.fmu").exists());
    }
}

/// A library that offers the functions of an FMU and does nothing is found out by running it, and so
/// is one that crashes or hangs; the program goes on.
///
/// promise: carried-proof
#[test]
fn a_binary_that_does_something_else_is_found_out() {
    let exported = Exported::new(SOUND);
    let (code, said) = exported.says(&["--no-run"]);
    assert!(code == 0 && said.contains("not run"), "{said}");
    let (code, said) = exported.says(&[]);
    assert_eq!(code, 1, "{said}");
    assert!(said.contains(&format!("the binary for {HERE}")), "{said}");
    let mut elsewhere = exported;
    let own = format!("binaries/{HERE}/sound_controller.so");
    let other = format!("binaries/{ELSEWHERE}/sound_controller.so");
    let mut bytes = elsewhere.files.remove(&own).unwrap();
    bytes[18..20].copy_from_slice(&[OTHER.1, 0]);
    elsewhere.files.insert(other, bytes);
    let (code, said) = elsewhere.says(&[]);
    assert_eq!(code, 0, "{said}");
    assert!(
        said.contains(&format!("not run: there is none for {HERE}")),
        "{said}"
    );
}
