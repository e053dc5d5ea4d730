//! `export`: zips prebuilt generic binaries with the design as their resource. Nothing is compiled.

use crate::Error;
use crate::archive::{self, Contents};
use crate::certificate::{self, Certificate};
use crate::platform::{HOST, PLATFORMS, Platform};
use crate::signature::SigningKey;
use crate::ssp::{self, Component, System};
use ftc_design::{Design, Proof};
use model_description::xml::{self, Document};
use model_description::{CONTROLLER, Interface, PLANT, VariableTable};
use output::Staging;
use report::Digest;
use report::connection::{self, Misfit, Side};
use report::documentation;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// One of the two FMUs.
pub(crate) struct Kind {
    /// Ends the FMU's name.
    suffix: &'static str,
    /// Name of the generic binary, and the fingerprint's identifier.
    pub binary: &'static str,
    /// One line for the description, before how it is to be stepped.
    description: &'static str,
    side: Side,
    table: fn(&Interface) -> VariableTable,
}

/// Both FMUs of a design.
pub(crate) const KINDS: [Kind; 2] = [
    Kind {
        suffix: "controller",
        binary: CONTROLLER,
        description: "Sensor-fault-tolerant controller of a switched plant",
        side: Side::Controller,
        table: model_description::controller,
    },
    Kind {
        suffix: "plant",
        binary: PLANT,
        description: "Switched plant with its scenario: reference, modes, sensor faults, disturbance, noise",
        side: Side::Plant,
        table: model_description::plant,
    },
];

/// Licence texts and notices of all that the binaries link, gathered when this program is built.
const LICENSES: &str = include_str!(concat!(env!("OUT_DIR"), "/licenses.txt"));

/// The same for the standard library, as the toolchain has them.
const STANDARD_LIBRARY: &str =
    include_str!(concat!(env!("OUT_DIR"), "/rust-standard-library.html"));

/// What every FMU shows in a browser of models.
const ICON: &[u8] = include_bytes!("../assets/model.png");

/// Where the design stands in an FMU.
pub(crate) const RESOURCE: &str = "resources/design.cbor";

/// What an export needs of the design and of the machine.
struct Exporter<'a> {
    design: &'a Design,
    /// The design as the binaries read it.
    resource: Vec<u8>,
    /// The proof, as `verify` reads it.
    certificate: Vec<u8>,
    interface: Interface,
    /// The experiment, for the documentation's figures.
    runs: Vec<Digest>,
    binaries: Vec<Binaries>,
    key: Option<SigningKey>,
}

/// What to write, and from what.
#[derive(Clone, Debug)]
#[expect(
    clippy::exhaustive_structs,
    reason = "whoever exports must choose each of them"
)]
pub struct Options {
    /// Directory to write to; made if it does not exist.
    pub out: PathBuf,
    /// Directory of the generic binaries: those that cargo built for this machine, and those of
    /// every platform in `fmu-binaries/PLATFORM`.
    pub binaries: PathBuf,
    /// Whether to write the SSP package that holds both FMUs connected.
    pub ssp: bool,
    /// Which platforms to pack; all that are built when absent.
    pub platforms: Option<Vec<String>>,
    /// Secret key (a file of `minisign -G`) that signs the FMUs. Signatures are drawn at random: signed
    /// twice, an FMU differs in that one file.
    pub sign: Option<PathBuf>,
}

/// What an export wrote.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Exported {
    /// Every file, in alphabetical order.
    pub paths: Vec<PathBuf>,
    /// Platforms for which the FMUs hold binaries.
    pub packed: Vec<Packed>,
    /// Platforms whose binaries are older than those of this machine and were left out.
    pub outdated: Vec<&'static str>,
    /// How the FMUs must be stepped.
    pub coupling: &'static str,
    /// What does not fit in the package, if one was written.
    pub misfit: Option<Misfit>,
}

/// The files, how the FMUs are stepped, and the platforms.
impl fmt::Display for Exported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for path in &self.paths {
            writeln!(f, "wrote {}", path.display())?;
        }
        writeln!(f, "coupling: {}", self.coupling)?;
        let named = |packed: &Packed| match packed.native {
            true => format!("{} (built for this machine)", packed.platform),
            false => packed.platform.into(),
        };
        let platforms: Vec<String> = self.packed.iter().map(named).collect();
        writeln!(f, "platforms: {}", platforms.join(", "))?;
        for platform in &self.outdated {
            writeln!(
                f,
                "left out {platform}: its binaries are older than this program's: run make fmu-all"
            )?;
        }
        Ok(())
    }
}

/// A platform for which an FMU holds a binary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Packed {
    /// Name of the platform in FMI 2.0.
    pub platform: &'static str,
    /// Whether the binary was built for this machine only, not for older ones of its platform.
    pub native: bool,
}

/// Writes both FMUs of a design, and on request the SSP package; refuses a design whose
/// certificate does not check. Every file is written, or none.
///
/// # Errors
/// [`Error::Uncertified`], [`Error::NoBinaries`], [`Error::Binary`], [`Error::Key`] or [`Error::Output`];
/// [`Error::Contents`] where a file cannot be made from this design.
pub fn export(design: &Design, options: &Options) -> Result<Exported, Error> {
    let key = options.sign.as_deref().map(SigningKey::read).transpose()?;
    let proof = prove(design)?;
    let staging = Staging::new(&options.out)?;
    let unwritten = |file: &str, what: String| Error::Contents {
        file: file.into(),
        what,
    };
    let resource = model_description::write_design(design)
        .map_err(|error| unwritten(RESOURCE, error.to_string()))?;
    let exporter = Exporter {
        design,
        certificate: serde_json::to_vec_pretty(&Certificate::new(proof, &resource))
            .map_err(|error| unwritten(certificate::PATH, error.to_string()))?,
        resource,
        interface: Interface::of(design),
        runs: documentation::runs(design),
        binaries: Binaries::find(options)?,
        key,
    };
    let mut fmus = Contents::new();
    for kind in &KINDS {
        fmus.insert(exporter.file(kind), exporter.fmu(kind)?);
    }
    for (name, bytes) in &fmus {
        staging.add(name, bytes)?;
    }
    if options.ssp {
        let name = format!("{}.ssp", design.name);
        staging.add(&name, &exporter.package(&name, &fmus)?)?;
    }
    let (outdated, packed): (Vec<_>, Vec<_>) = exporter
        .binaries
        .iter()
        .partition(|binaries| binaries.outdated);
    let packed = packed.iter().map(|binaries| Packed {
        platform: binaries.platform.name,
        native: binaries.native,
    });
    Ok(Exported {
        paths: staging.commit()?,
        packed: packed.collect(),
        coupling: connection::coupling(design),
        misfit: options.ssp.then(|| connection::misfit(design)).flatten(),
        outdated: outdated
            .iter()
            .map(|binaries| binaries.platform.name)
            .collect(),
    })
}

impl Kind {
    /// The FMU's name, and that of its binaries.
    pub fn identifier(&self, design: &Design) -> String {
        format!("{}_{}", design.name, self.suffix)
    }

    /// `modelDescription.xml` of a design whose record has these bytes.
    ///
    /// # Errors
    /// What the XML writer says.
    pub fn describe(&self, design: &Design, resource: &[u8]) -> Result<String, Error> {
        let identifier = &self.identifier(design);
        let interface = Interface::of(design);
        xml::write(&Document {
            model_name: identifier,
            model_identifier: identifier,
            description: &format!("{}. {}", self.description, connection::coupling(design)),
            guid: &model_description::guid(self.binary, resource),
            version: env!("CARGO_PKG_VERSION"),
            license: env!("CARGO_PKG_LICENSE"),
            step_size: interface.sample_time,
            stop_time: interface.stop_time,
            directional_derivative: true,
            table: &(self.table)(&interface),
        })
        .map_err(|what| Error::Contents {
            file: format!("modelDescription.xml of {identifier}"),
            what: what.to_string(),
        })
    }
}

impl Exporter<'_> {
    fn file(&self, kind: &Kind) -> String {
        format!("{}.fmu", kind.identifier(self.design))
    }

    fn fmu(&self, kind: &Kind) -> Result<Vec<u8>, Error> {
        let identifier = kind.identifier(self.design);
        let mut contents = Contents::from([
            (
                "modelDescription.xml".into(),
                kind.describe(self.design, &self.resource)?.into_bytes(),
            ),
            ("model.png".into(), ICON.into()),
            (RESOURCE.into(), self.resource.clone()),
            (certificate::PATH.into(), self.certificate.clone()),
            (
                "documentation/index.html".into(),
                self.document(kind).into_bytes(),
            ),
            ("documentation/licenses/license.txt".into(), LICENSES.into()),
            (
                "documentation/licenses/rust-standard-library.html".into(),
                STANDARD_LIBRARY.into(),
            ),
        ]);
        for binaries in self.binaries.iter().filter(|binaries| !binaries.outdated) {
            contents.insert(binaries.platform.path(&identifier), binaries.read(kind)?);
        }
        if let Some(key) = &self.key {
            key.sign(&self.file(kind), &mut contents)?;
        }
        archive::zip(&identifier, &contents)
    }

    fn document(&self, kind: &Kind) -> String {
        let title = format!("{}: {}", self.design.name, kind.suffix);
        let lead = format!("{}.", kind.description);
        documentation::page(self.design, &self.runs, Some(kind.side), title, lead)
    }

    /// The SSP package: the FMUs under `resources/` beside the description of how they connect.
    fn package(&self, name: &str, fmus: &Contents) -> Result<Vec<u8>, Error> {
        let component = |kind: &'static Kind| Component {
            name: kind.suffix,
            source: format!("{}/{}", ssp::RESOURCES, self.file(kind)),
            table: (kind.table)(&self.interface),
        };
        let system = System {
            name: &self.design.name,
            description: &format!(
                "Switched plant under sensor-fault-tolerant control. {}",
                connection::coupling(self.design)
            ),
            stop_time: self.interface.stop_time,
            step_size: self.interface.sample_time,
            components: KINDS.iter().map(component).collect(),
        };
        let description = ssp::describe(&system).map_err(|error| Error::Contents {
            file: name.into(),
            what: error.to_string(),
        })?;
        let mut contents: Contents = fmus
            .iter()
            .map(|(file, bytes)| (format!("{}/{file}", ssp::RESOURCES), bytes.clone()))
            .collect();
        contents.insert(ssp::DESCRIPTION.into(), description);
        archive::zip(name, &contents)
    }
}

/// The design's proof, gone through once more.
fn prove(design: &Design) -> Result<Proof, Error> {
    let Some(synthesis) = design.synthesis() else {
        return Err(Error::Uncertified(
            "the design carries no certificate and is not exported".into(),
        ));
    };
    match synthesis.verify(&design.plant) {
        Ok(()) => Ok(synthesis.into()),
        Err(error) => Err(Error::Uncertified(format!(
            "the certificate does not check ({error})"
        ))),
    }
}

/// The generic binaries of one platform.
struct Binaries {
    platform: &'static Platform,
    /// Directory they are in.
    folder: PathBuf,
    /// Whether they are those that cargo built for this machine.
    native: bool,
    /// Whether the sources were built again since, on this machine but not for that platform.
    outdated: bool,
}

impl Binaries {
    /// All that are built and wanted. For this machine's own platform the newest, else the portable
    /// ones.
    fn find(options: &Options) -> Result<Vec<Self>, Error> {
        let folder = &options.binaries;
        let mut found = Self::all(folder);
        if found.iter().all(|binaries| binaries.outdated) {
            return Err(Error::NoBinaries {
                library: folder.join(host_library(CONTROLLER)),
            });
        }
        if let Some(wanted) = &options.platforms {
            found.retain(|binaries| !binaries.outdated);
            let built = |name: &&String| found.iter().any(|b| b.platform.name == name.as_str());
            if let Some(missing) = wanted.iter().find(|name| !built(name)) {
                return Err(Error::NoPlatform {
                    platform: missing.clone(),
                    built: found
                        .iter()
                        .map(|binaries| binaries.platform.name)
                        .collect(),
                });
            }
            found.retain(|binaries| wanted.iter().any(|name| name == binaries.platform.name));
        }
        match found.is_empty() {
            true => Err(Error::NoPlatform {
                platform: "(none)".into(),
                built: Self::all(folder).iter().map(|b| b.platform.name).collect(),
            }),
            false => Ok(found),
        }
    }

    fn all(folder: &Path) -> Vec<Self> {
        let built_here = newest(folder, host_library);
        PLATFORMS
            .iter()
            .filter_map(|platform| {
                let others = folder.join("fmu-binaries").join(platform.name);
                let library = |binary: &str| format!("{binary}.{}", platform.extension);
                let prebuilt = newest(&others, library);
                let current = prebuilt.is_some() && prebuilt >= built_here;
                let native = !current && platform.name == HOST && built_here.is_some();
                (native || prebuilt.is_some()).then(|| Self {
                    platform,
                    folder: if native { folder.into() } else { others },
                    native,
                    outdated: !native && !current,
                })
            })
            .collect()
    }

    fn read(&self, kind: &Kind) -> Result<Vec<u8>, Error> {
        let path = self.folder.join(if self.native {
            host_library(kind.binary)
        } else {
            format!("{}.{}", kind.binary, self.platform.extension)
        });
        fs::read(&path).map_err(|source| Error::Binary {
            library: path,
            source,
        })
    }
}

/// When the last of the two libraries was built; `None` unless both are there.
fn newest(folder: &Path, library: impl Fn(&str) -> String) -> Option<SystemTime> {
    let built = |binary: &str| fs::metadata(folder.join(library(binary)))?.modified();
    let times = KINDS.iter().map(|kind| built(kind.binary));
    times
        .collect::<std::io::Result<Vec<_>>>()
        .ok()?
        .into_iter()
        .max()
}

/// What cargo calls the shared library on this platform: the crate is the binary's name and `_fmu`.
fn host_library(binary: &str) -> String {
    format!(
        "{}{binary}_fmu{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    )
}
