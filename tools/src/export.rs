//! `export`: zips prebuilt generic binaries with the design as their resource. Nothing is compiled.

use crate::certificate::{self, Certificate};
use crate::output::Staging;
use crate::summary;
use ftc::design::Design;
use model_description::xml::{self, Document};
use model_description::{CONTROLLER, Interface, PLANT, VariableTable};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// One of the two FMUs.
struct Kind {
    /// Ends the FMU's name.
    suffix: &'static str,
    /// Name of the generic binary, and the fingerprint's identifier.
    binary: &'static str,
    /// One line for the description.
    description: &'static str,
    table: fn(&Interface) -> VariableTable,
}

const KINDS: [Kind; 2] = [
    Kind {
        suffix: "controller",
        binary: CONTROLLER,
        description: "Sensor-fault-tolerant controller of a switched plant",
        table: model_description::controller,
    },
    Kind {
        suffix: "plant",
        binary: PLANT,
        description: "Switched plant with its scenario: reference, modes, sensor faults, disturbance, noise",
        table: model_description::plant,
    },
];

/// A platform for which binaries may have been built.
struct Platform {
    /// Directory inside the FMU and beside this program.
    name: &'static str,
    /// Extension of its shared libraries.
    extension: &'static str,
}

const PLATFORMS: [Platform; 3] = [
    Platform {
        name: "linux64",
        extension: "so",
    },
    Platform {
        name: "win64",
        extension: "dll",
    },
    Platform {
        name: "aarch64-linux",
        extension: "so",
    },
];

/// The platform this program runs on.
const HOST: &str = if cfg!(target_os = "windows") {
    "win64"
} else if cfg!(target_arch = "aarch64") {
    "aarch64-linux"
} else {
    "linux64"
};

const LICENSES: &str = include_str!("../assets/licenses.txt");

/// The contents of an FMU by path, in the order they are written.
type Contents = BTreeMap<String, Vec<u8>>;

/// Writes both FMUs; refuses a design whose certificate does not check.
///
/// # Errors
/// One sentence: no certificate, no binaries, or the output directory.
pub fn write(design: &Design, staging: Staging) -> Result<String, String> {
    prove(design)?;
    let folder = std::env::current_exe()
        .ok()
        .and_then(|program| program.parent().map(Path::to_path_buf))
        .ok_or("cannot find the directory of this program: start it by its full path")?;
    let resource = serde_json::to_vec(design).map_err(|error| error.to_string())?;
    let certificate = serde_json::to_vec_pretty(&Certificate::of(design, &resource))
        .map_err(|error| error.to_string())?;
    let interface = Interface::from(design);
    let mut packed = Vec::new();
    for kind in &KINDS {
        let identifier = format!("{}_{}", design.name, kind.suffix);
        let binaries = binaries(kind, &identifier, &folder)?;
        packed = binaries.keys().cloned().collect();
        let mut contents = binaries;
        contents.insert(
            "modelDescription.xml".into(),
            describe(design, kind, &identifier, &interface, &resource)?.into_bytes(),
        );
        contents.insert("resources/design.json".into(), resource.clone());
        contents.insert(certificate::PATH.into(), certificate.clone());
        contents.insert(
            "documentation/index.html".into(),
            documentation(design, kind).into_bytes(),
        );
        contents.insert("documentation/licenses/license.txt".into(), LICENSES.into());
        let bytes = zip(&contents).map_err(|error| format!("cannot zip {identifier}: {error}"))?;
        staging.add(&format!("{identifier}.fmu"), &bytes)?;
    }
    let paths = staging.commit()?;
    let mut text = String::new();
    for path in paths {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    let platforms: Vec<&str> = packed.iter().filter_map(|p| p.split('/').nth(1)).collect();
    let _ = writeln!(text, "platforms: {}", platforms.join(", "));
    Ok(text)
}

fn prove(design: &Design) -> Result<(), String> {
    let synthesis = design
        .synthesis
        .as_ref()
        .ok_or("the design carries no certificate and is not exported: design it again")?;
    synthesis
        .verify(&design.controller.plant)
        .map_err(|error| format!("the certificate does not check ({error}): design it again"))
}

/// The binaries that are there, under their paths in the FMU.
fn binaries(kind: &Kind, identifier: &str, folder: &Path) -> Result<Contents, String> {
    let mut found = Contents::new();
    for platform in &PLATFORMS {
        let Platform { name, extension } = platform;
        let prebuilt = folder.join(format!("fmu-binaries/{name}/{}.{extension}", kind.binary));
        let host = folder.join(host_library(kind.binary));
        let path = match (prebuilt.is_file(), *name == HOST && host.is_file()) {
            (true, _) => prebuilt,
            (false, true) => host,
            (false, false) => continue,
        };
        let bytes = fs::read(&path)
            .map_err(|error| format!("cannot read {} ({error}): build it again", path.display()))?;
        found.insert(format!("binaries/{name}/{identifier}.{extension}"), bytes);
    }
    if found.is_empty() {
        return Err(format!(
            "no FMU binary is built: {} is missing: run cargo build --release --workspace",
            folder.join(host_library(kind.binary)).display()
        ));
    }
    Ok(found)
}

/// What cargo calls the shared library on this platform.
fn host_library(binary: &str) -> String {
    format!(
        "{}{binary}{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    )
}

fn describe(
    design: &Design,
    kind: &Kind,
    identifier: &str,
    interface: &Interface,
    resource: &[u8],
) -> Result<String, String> {
    let table = (kind.table)(interface);
    xml::write(&Document {
        model_name: identifier,
        model_identifier: identifier,
        description: kind.description,
        guid: &model_description::guid(kind.binary, resource),
        version: env!("CARGO_PKG_VERSION"),
        license: env!("CARGO_PKG_LICENSE"),
        step_size: design.controller.plant.sample_time,
        stop_time: interface.stop_time,
        directional_derivative: true,
        table: &table,
    })
    .map_err(|what| format!("{identifier}: {what}"))
}

/// Deflated, sorted, with one time stamp: the same contents give the same bytes.
fn zip(contents: &Contents) -> zip::result::ZipResult<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(6))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    for (path, bytes) in contents {
        let mode = if path.starts_with("binaries/") {
            0o755
        } else {
            0o644
        };
        archive.start_file(path.as_str(), options.unix_permissions(mode))?;
        archive.write_all(bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// A page with the design report.
fn documentation(design: &Design, kind: &Kind) -> String {
    let mut body = String::new();
    for (title, lines) in summary::sections(design) {
        let _ = writeln!(body, "<h2>{title}</h2>\n<table>");
        for (name, value) in lines {
            let _ = writeln!(
                body,
                "<tr><th>{}</th><td>{}</td></tr>",
                escape(&name),
                escape(&value)
            );
        }
        body.push_str("</table>\n");
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name} {suffix}</title>\n\
         <style>body{{font-family:sans-serif;max-width:50em;margin:2em auto;padding:0 1em}}\
         table{{border-collapse:collapse}}th{{text-align:left;font-weight:normal;color:#555;padding-right:2em;\
         vertical-align:top}}td,th{{padding-top:.2em}}</style>\n</head>\n<body>\n\
         <h1>{name}: {suffix}</h1>\n<p>{description}.</p>\n{body}</body>\n</html>\n",
        name = escape(&design.name),
        suffix = kind.suffix,
        description = kind.description,
    )
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
