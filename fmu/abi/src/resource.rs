//! Where the FMU's resources lie, and whether they are the right ones.

use percent_encoding::percent_decode_str;
use std::fs;
use std::path::{Path, PathBuf};

/// The host that a URI may name in front of a local path, in any case, and the slash after it.
const LOCAL_HOST: &str = "//localhost/";

/// The greatest resource that is read, in bytes: far more than a design has.
pub const MOST_BYTES: u64 = 1 << 28;

/// Why a resource cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResourceError {
    /// The location is not UTF-8 once it is decoded.
    #[error("fmuResourceLocation {0} is not UTF-8 when decoded")]
    NotUtf8(String),
    /// The location is a URI of another kind.
    #[error("fmuResourceLocation {0} is no file URI: unpack the FMU to a local folder")]
    NoFileUri(String),
    /// The location is a file URI without a path.
    #[error("fmuResourceLocation names no folder")]
    NoFolder,
    /// The file is not there, or cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A folder or a device.
    #[error("{} is no file", .0.display())]
    NoFile(PathBuf),
    /// Larger than any resource is.
    #[error("{} has {size} bytes, more than the {MOST_BYTES} that are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: u64,
    },
    /// The file is not the one that the importer's guid was made of.
    #[error(
        "{} does not belong to this FMU: its fingerprint for {identifier} is {found}, \
         but the importer handed over the guid {guid}; export the FMU again",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The binary.
        identifier: String,
        /// Fingerprint of the file for this binary.
        found: String,
        /// What the importer handed over.
        guid: String,
    },
}

/// The folder behind `fmuResourceLocation`, as importers really write it.
///
/// `file:///tmp/a%20b`, `file:/tmp/a b`, `file:////tmp`, `file://localhost/tmp`, a plain path,
/// `file:///C:/tmp`, with or without a slash at the end. What exists under its undecoded name
/// is taken as it stands, since some importers do not encode at all.
///
/// # Errors
/// A location that is no path and no file URI.
pub fn folder(location: &str) -> Result<PathBuf, ResourceError> {
    let raw = path_part(location)?;
    let as_written = PathBuf::from(local(raw, cfg!(windows)));
    if raw.contains('%') && !as_written.exists() {
        let decoded = percent_decode_str(raw)
            .decode_utf8()
            .map_err(|_| ResourceError::NotUtf8(location.to_string()))?;
        return Ok(PathBuf::from(local(&decoded, cfg!(windows))));
    }
    Ok(as_written)
}

/// The bytes of a resource whose fingerprint is the importer's `guid`.
///
/// `identifier` names the binary, see [`model_description::guid`].
///
/// # Errors
/// A missing, truncated, altered or foreign resource, another FMU's binary and another release's XML.
pub fn read_verified(
    resources: &Path,
    file: &str,
    identifier: &str,
    guid: &str,
) -> Result<Vec<u8>, ResourceError> {
    let path = resources.join(file);
    size(&path)?;
    let bytes = fs::read(&path).map_err(|error| unreadable(&path, error))?;
    let found = model_description::guid(identifier, &bytes);
    if found == guid.trim() {
        Ok(bytes)
    } else {
        Err(ResourceError::Foreign {
            path,
            identifier: identifier.to_string(),
            found,
            guid: guid.to_string(),
        })
    }
}

/// The size of a resource in bytes.
///
/// # Errors
/// What is no file, or larger than [`MOST_BYTES`].
pub fn size(path: &Path) -> Result<u64, ResourceError> {
    let found = fs::metadata(path).map_err(|error| unreadable(path, error))?;
    if !found.is_file() {
        return Err(ResourceError::NoFile(path.into()));
    }
    let size = found.len();
    if size > MOST_BYTES {
        let path = path.into();
        return Err(ResourceError::TooLarge { path, size });
    }
    Ok(size)
}

fn unreadable(path: &Path, source: std::io::Error) -> ResourceError {
    let path = path.into();
    ResourceError::Unreadable { path, source }
}

/// The path in a file URI, or the location itself if it is a path.
fn path_part(location: &str) -> Result<&str, ResourceError> {
    let Some((scheme, rest)) = location.split_once(':') else {
        return Ok(location);
    };
    if scheme.len() == 1 || scheme.contains(['/', '\\']) {
        // A drive letter, or a path with a colon in it.
        return Ok(location);
    }
    if !scheme.eq_ignore_ascii_case("file") {
        return Err(ResourceError::NoFileUri(location.to_string()));
    }
    // The slash that makes the path absolute is kept.
    let path = match rest.get(..LOCAL_HOST.len()) {
        Some(host) if host.eq_ignore_ascii_case(LOCAL_HOST) => &rest[LOCAL_HOST.len() - 1..],
        _ => rest,
    };
    if path.is_empty() {
        return Err(ResourceError::NoFolder);
    }
    Ok(path)
}

/// The operating system's spelling of a URI's path.
fn local(path: &str, windows: bool) -> String {
    let bare = path.trim_start_matches('/');
    let slashes = path.len() - bare.len();
    let drive = bare.as_bytes().get(1) == Some(&b':');
    match (windows, slashes) {
        (true, _) if drive => bare.to_string(),
        // file:////server/share and file://server/share
        (true, 2 | 4..) => format!(r"\\{}", bare.replace('/', r"\")),
        (_, 0) => path.to_string(),
        _ => format!("/{bare}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(windows: bool, location: &str) -> String {
        let raw = path_part(location).unwrap();
        local(&percent_decode_str(raw).decode_utf8().unwrap(), windows)
    }

    #[test]
    fn every_spelling_leads_to_the_same_folder() {
        for location in [
            "file:///tmp/a b/resources",
            "file:///tmp/a%20b/resources",
            "file:/tmp/a%20b/resources",
            "file:////tmp/a b/resources",
            "FILE:///tmp/a b/resources",
            "file://localhost/tmp/a%20b/resources",
            "file://LocalHost/tmp/a b/resources",
            "FILE://LOCALHOST/tmp/a b/resources",
            "/tmp/a b/resources",
        ] {
            assert_eq!(on(false, location), "/tmp/a b/resources", "{location}");
        }
        assert_eq!(on(false, "file:///tmp/%C3%A9"), "/tmp/é");
        assert_eq!(on(false, "file:///tmp/é"), "/tmp/é");
        assert_eq!(on(false, "relative/resources"), "relative/resources");
    }

    #[test]
    fn drive_letters_and_shares() {
        for location in [
            "file:///C:/a%20b",
            "file:/C:/a b",
            "file://C:/a b",
            "C:/a b",
        ] {
            assert_eq!(on(true, location), "C:/a b", "{location}");
        }
        assert_eq!(on(true, "file:////server/share"), r"\\server\share");
        assert_eq!(on(true, "file://server/share"), r"\\server\share");
    }

    #[test]
    fn other_schemes_are_refused() {
        for location in ["http://host/x", "https:/x", "fmi2:x", "file:"] {
            assert!(path_part(location).is_err(), "{location}");
        }
    }

    #[test]
    fn a_folder_with_a_percent_sign_is_found_encoded_or_not() {
        let root = tempfile::tempdir().unwrap();
        let made = root.path().join("100%25 sure");
        fs::create_dir(&made).unwrap();
        let plain = format!("file://{}", made.display());
        assert_eq!(folder(&plain).unwrap(), made);
        let encoded = plain.replace('%', "%25").replace(' ', "%20");
        assert_eq!(folder(&encoded).unwrap(), made);
    }
}
