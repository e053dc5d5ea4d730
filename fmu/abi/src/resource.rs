//! Where the FMU's resources lie, and whether they are the right ones.

use percent_encoding::percent_decode_str;
use std::fs;
use std::path::{Path, PathBuf};

/// The host that a URI may name in front of a local path, in any case, and the slash after it.
const LOCAL_HOST: &str = "//localhost/";

/// The greatest resource that is read, in bytes: far more than a design has.
pub const MOST_BYTES: u64 = 1 << 28;

/// The folder behind `fmuResourceLocation`, as importers really write it.
///
/// `file:///tmp/a%20b`, `file:/tmp/a b`, `file:////tmp`, `file://localhost/tmp`, a plain path,
/// `file:///C:/tmp`, with or without a slash at the end. What exists under its undecoded name
/// is taken as it stands, since some importers do not encode at all.
pub fn folder(location: &str) -> Result<PathBuf, String> {
    let raw = path_part(location)?;
    let as_written = PathBuf::from(local(raw, cfg!(windows)));
    if raw.contains('%') && !as_written.exists() {
        let decoded = percent_decode_str(raw)
            .decode_utf8()
            .map_err(|_| format!("fmuResourceLocation {location} is not UTF-8 when decoded"))?;
        return Ok(PathBuf::from(local(&decoded, cfg!(windows))));
    }
    Ok(as_written)
}

/// The bytes of a resource whose fingerprint is the importer's `guid`.
///
/// `identifier` names the binary, see [`model_description::guid`]. A missing, truncated,
/// altered or foreign resource, another FMU's binary and another release's XML are refused.
pub fn read_verified(
    resources: &Path,
    file: &str,
    identifier: &str,
    guid: &str,
) -> Result<Vec<u8>, String> {
    let path = resources.join(file);
    size(&path)?;
    let bytes =
        fs::read(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let found = model_description::guid(identifier, &bytes);
    if found == guid.trim() {
        Ok(bytes)
    } else {
        Err(format!(
            "{} does not belong to this FMU: its fingerprint for {identifier} is {found}, \
             but the importer handed over the guid {guid}; export the FMU again",
            path.display()
        ))
    }
}

/// The size of a resource in bytes; only a file of no absurd size is one.
pub fn size(path: &Path) -> Result<u64, String> {
    let found =
        fs::metadata(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    if !found.is_file() {
        return Err(format!("{} is no file", path.display()));
    }
    if found.len() > MOST_BYTES {
        return Err(format!(
            "{} has {} bytes, more than the {MOST_BYTES} that are read",
            path.display(),
            found.len()
        ));
    }
    Ok(found.len())
}

/// The path in a file URI, or the location itself if it is a path.
fn path_part(location: &str) -> Result<&str, String> {
    let Some((scheme, rest)) = location.split_once(':') else {
        return Ok(location);
    };
    if scheme.len() == 1 || scheme.contains(['/', '\\']) {
        // A drive letter, or a path with a colon in it.
        return Ok(location);
    }
    if !scheme.eq_ignore_ascii_case("file") {
        return Err(format!(
            "fmuResourceLocation {location} is no file URI: unpack the FMU to a local folder"
        ));
    }
    // The slash that makes the path absolute is kept.
    let path = match rest.get(..LOCAL_HOST.len()) {
        Some(host) if host.eq_ignore_ascii_case(LOCAL_HOST) => &rest[LOCAL_HOST.len() - 1..],
        _ => rest,
    };
    if path.is_empty() {
        return Err("fmuResourceLocation names no folder".into());
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
