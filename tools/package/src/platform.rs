//! The platforms an FMU may run on, and what their binaries must be.

use object::{Architecture, BinaryFormat, Object};

/// Why bytes are no library of an FMU: the end of a sentence that begins with the library's path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LibraryError {
    /// Another format, or for another processor.
    #[error("is no library for {0}")]
    Platform(&'static str),
    /// Its table of functions cannot be read.
    #[error("cannot be read ({0})")]
    Unreadable(String),
    /// A function of the interface is missing.
    #[error("offers no function {0}")]
    Function(&'static str),
}

/// A platform for which binaries may have been built.
pub struct Platform {
    /// Directory inside the FMU and beside this program.
    pub name: &'static str,
    /// Extension of its shared libraries.
    pub extension: &'static str,
    /// Whether this program is for it.
    here: bool,
    format: BinaryFormat,
    architecture: Architecture,
}

/// All of them.
pub const PLATFORMS: &[Platform] = &[
    Platform {
        name: "linux64",
        extension: "so",
        here: cfg!(all(target_os = "linux", target_arch = "x86_64")),
        format: BinaryFormat::Elf,
        architecture: Architecture::X86_64,
    },
    Platform {
        name: "win64",
        extension: "dll",
        here: cfg!(all(windows, target_arch = "x86_64")),
        format: BinaryFormat::Pe,
        architecture: Architecture::X86_64,
    },
    Platform {
        name: "aarch64-linux",
        extension: "so",
        here: cfg!(all(target_os = "linux", target_arch = "aarch64")),
        format: BinaryFormat::Elf,
        architecture: Architecture::Aarch64,
    },
];

/// The name of the platform of this machine.
pub const HOST: &str = {
    let (mut name, mut at) = ("this machine", 0);
    while at < PLATFORMS.len() {
        if PLATFORMS[at].here {
            name = PLATFORMS[at].name;
        }
        at += 1;
    }
    name
};

/// Functions without which no importer closes a loop.
const NEEDED: [&str; 10] = [
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

impl Platform {
    /// Where the binary of an FMU lies in its archive.
    pub fn path(&self, identifier: &str) -> String {
        let Self {
            name, extension, ..
        } = self;
        format!("binaries/{name}/{identifier}.{extension}")
    }

    /// Whether these bytes are a library for this platform that offers the functions of an FMU.
    /// What its machine code does is not looked at.
    ///
    /// # Errors
    /// Why they are not.
    pub fn check(&self, bytes: &[u8]) -> Result<(), LibraryError> {
        let file = object::File::parse(bytes)
            .ok()
            .filter(|file| file.format() == self.format && file.architecture() == self.architecture)
            .ok_or(LibraryError::Platform(self.name))?;
        let exports = file
            .exports()
            .map_err(|error| LibraryError::Unreadable(error.to_string()))?;
        let offers = |name: &&str| exports.iter().any(|found| found.name() == name.as_bytes());
        match NEEDED.iter().find(|name| !offers(name)) {
            Some(name) => Err(LibraryError::Function(name)),
            None => Ok(()),
        }
    }
}
