//! Whose FMU it is: a signature over everything in it, in the formats of minisign and sha256sum.
//!
//! `resources/contents.sha256` lists every other file with its SHA-256, and
//! `resources/contents.sha256.minisig` signs that list. Both can be checked without this program:
//! in the unpacked FMU, `minisign -Vm resources/contents.sha256 -p KEY.pub` and
//! `sha256sum -c resources/contents.sha256`.

use crate::Error;
use crate::archive::Contents;
use ct_codecs::{Base64, Decoder};
use minisign::{PublicKey, PublicKeyBox, SecretKey, SecretKeyBox, SignatureBox};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt;
use std::io::{Cursor, IsTerminal};
use std::path::{Path, PathBuf};

/// The list of files with their hashes.
pub const MANIFEST: &str = "resources/contents.sha256";

/// The signature of that list.
pub const SIGNATURE: &str = "resources/contents.sha256.minisig";

/// Holds the password of a secret key where there is no terminal to ask on.
pub const PASSWORD: &str = "FTC_FMU_KEY_PASSWORD";

/// What `minisign -G` writes to its secret key file.
pub struct SigningKey {
    key: SecretKey,
    public: PublicKey,
}

/// What `minisign -G` writes to its public key file.
pub struct VerifyingKey {
    key: PublicKey,
    file: PathBuf,
}

/// What is known of an FMU's origin.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin {
    /// Anybody may have made it.
    Unsigned,
    /// It says that this key has signed it, which was not checked.
    Unchecked(String),
    /// The key that was given has signed it.
    Signed(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsigned => f.write_str("none: anybody may have made this FMU"),
            Self::Unchecked(id) => write!(
                f,
                "by key {id}, as the FMU says; not checked: give that key with --key"
            ),
            Self::Signed(id) => write!(f, "by key {id}, over every file of the FMU"),
        }
    }
}

impl SigningKey {
    /// Whether a file holds a secret key, without its password.
    ///
    /// # Errors
    /// [`Error::Key`] in one sentence.
    pub fn check(path: &Path) -> Result<(), Error> {
        let key = parsed(&text(path, SIGN)?);
        key.map(drop).ok_or_else(|| Error::Key {
            option: SIGN,
            file: path.into(),
            what: NO_KEY.into(),
        })
    }

    /// Reads a secret key; its password, if it has one, is that in the environment variable
    /// [`PASSWORD`], or is asked for on the terminal.
    ///
    /// # Errors
    /// [`Error::Key`] in one sentence.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let refused = |what: String| Error::Key {
            option: SIGN,
            file: path.into(),
            what,
        };
        let text = text(path, SIGN)?;
        let held = SecretKeyBox::from_string(&text).map_err(|_| refused(NO_KEY.into()))?;
        let found = match (unprotected(&text), std::env::var(PASSWORD)) {
            (Some(key), _) => Ok(key),
            (None, Ok(password)) => held.into_secret_key(Some(password)),
            (None, Err(_)) if std::io::stdin().is_terminal() => held.into_secret_key(None),
            (None, Err(_)) => held.into_unencrypted_secret_key(),
        };
        let key = found.map_err(|error| {
            refused(format!(
                "cannot be used ({error}): name a secret key that minisign -G has made, and if it has a password, set {PASSWORD}"
            ))
        })?;
        let public = PublicKey::from_secret_key(&key).map_err(|_| refused(NO_KEY.into()))?;
        Ok(Self { key, public })
    }

    /// Adds list and signature to the files of an FMU.
    ///
    /// # Errors
    /// [`Error::Contents`] where the key cannot sign.
    pub(crate) fn sign(&self, name: &str, contents: &mut Contents) -> Result<(), Error> {
        let list = manifest(contents);
        let signed = minisign::sign(
            Some(&self.public),
            &self.key,
            Cursor::new(&list),
            Some(&format!("contents of {name}")),
            Some("signature of an FMU's contents.sha256"),
        );
        let signature = signed.map_err(|error| Error::Contents {
            file: name.into(),
            what: format!("cannot be signed ({error})"),
        })?;
        contents.insert(MANIFEST.into(), list.into_bytes());
        contents.insert(SIGNATURE.into(), signature.into_string().into_bytes());
        Ok(())
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SigningKey({})", id(self.public.keynum()))
    }
}

/// The option that names a secret key.
const SIGN: &str = "sign";

/// The option that names a public key.
const KEY: &str = "key";

/// A key file is a few lines.
const LARGEST_KEY: u64 = 1 << 20;

impl VerifyingKey {
    /// Reads a public key.
    ///
    /// # Errors
    /// [`Error::Key`] in one sentence.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let found = PublicKeyBox::from_string(&text(path, KEY)?).and_then(PublicKey::from_box);
        let key = found.map_err(|_| Error::Key {
            option: KEY,
            file: path.into(),
            what: NO_KEY.into(),
        })?;
        Ok(Self {
            key,
            file: path.into(),
        })
    }
}

fn text(path: &Path, option: &'static str) -> Result<String, Error> {
    let refused = |what: String| Error::Key {
        option,
        file: path.into(),
        what,
    };
    let bytes =
        ftc_tables::read_regular(path, LARGEST_KEY).map_err(|why| refused(why.to_string()))?;
    String::from_utf8(bytes).map_err(|_| refused("is no text: name a key file of minisign".into()))
}

/// What is said of a file that holds something else.
const NO_KEY: &str = "is no such key: name a key file of minisign";

/// A secret key without a password. Those of the minisign program have no checksum, which its box asks
/// for; a damaged one cannot verify what it signs, which is tried.
fn unprotected(text: &str) -> Option<SecretKey> {
    parsed(text).filter(|key| !key.is_encrypted())
}

/// A secret key as it stands in a file, its numbers still hidden if it has a password.
fn parsed(text: &str) -> Option<SecretKey> {
    let line = text.lines().nth(1)?;
    let bytes = Base64::decode_to_vec(line.trim(), None).ok()?;
    SecretKey::from_bytes(&bytes).ok()
}

/// A key's number as minisign writes it.
fn id(number: &[u8]) -> String {
    let digits = number.iter().rev().map(|byte| format!("{byte:02X}"));
    digits.collect()
}

/// A line for every file, as sha256sum writes it; folders and the signature itself left out.
fn manifest(contents: &BTreeMap<String, Vec<u8>>) -> String {
    let listed = contents.iter().filter(|(path, _)| {
        ![MANIFEST, SIGNATURE].contains(&path.as_str()) && !path.ends_with('/')
    });
    let line = |(path, bytes): (&String, &Vec<u8>)| {
        let hash: String = Sha256::digest(bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        format!("{hash}  {path}\n")
    };
    listed.map(line).collect()
}

/// Holds the files of an FMU against their signature, where there is one or a key asks for it.
///
/// # Errors
/// One sentence that says what does not fit.
pub(crate) fn check(
    files: &BTreeMap<String, Vec<u8>>,
    key: Option<&VerifyingKey>,
) -> Result<Origin, String> {
    let (list, signature) = match (files.get(MANIFEST), files.get(SIGNATURE), key) {
        (None, None, None) => return Ok(Origin::Unsigned),
        (None, None, Some(_)) => {
            return Err("it is not signed: export it with --sign, or leave --key out".into());
        }
        (Some(list), Some(signature), _) => (list, signature),
        (list, ..) => {
            let missing = if list.is_some() { SIGNATURE } else { MANIFEST };
            return Err(format!(
                "{missing} is missing, it was taken out after signing: get the FMU anew"
            ));
        }
    };
    let signature = std::str::from_utf8(signature)
        .ok()
        .and_then(|text| SignatureBox::from_string(text).ok())
        .ok_or_else(|| format!("{SIGNATURE} is no signature of minisign: get the FMU anew"))?;
    let signer = id(signature.keynum());
    if let Some(given) = key {
        let own = id(given.key.keynum());
        if own != signer {
            return Err(format!(
                "it is signed by key {signer}, not by key {own} of {}: name the other key if you trust it",
                given.file.display()
            ));
        }
        minisign::verify(&given.key, &signature, Cursor::new(list), true, false, false).map_err(
            |_| {
                format!(
                    "{MANIFEST} is not what key {signer} has signed: it was changed after signing, get the FMU anew"
                )
            },
        )?;
    }
    compare(list, &manifest(files))?;
    Ok(match key {
        Some(_) => Origin::Signed(signer),
        None => Origin::Unchecked(signer),
    })
}

/// The first file that is not as the list has it.
fn compare(listed: &[u8], found: &str) -> Result<(), String> {
    let lines = |text: &str| -> BTreeMap<String, String> {
        let split = |line: &str| {
            line.split_once("  ")
                .map(|(hash, path)| (path.into(), hash.into()))
        };
        text.lines().filter_map(split).collect()
    };
    let (listed, found) = (lines(&String::from_utf8_lossy(listed)), lines(found));
    let changed = listed
        .iter()
        .find(|(path, hash)| found.get(*path) != Some(*hash));
    if let Some((path, _)) = changed {
        return Err(format!(
            "{path} is not the file that was signed: it was changed or taken out after signing, get the FMU anew"
        ));
    }
    match found.keys().find(|path| !listed.contains_key(*path)) {
        Some(path) => Err(format!(
            "{path} was not signed: it was added after signing, get the FMU anew"
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use minisign::KeyPair;
    use std::fs;

    fn key_files(folder: &Path, name: &str, password: Option<&str>) -> [PathBuf; 2] {
        let paths = [
            folder.join(format!("{name}.key")),
            folder.join(format!("{name}.pub")),
        ];
        let KeyPair { pk, sk } = match password {
            None => KeyPair::generate_unencrypted_keypair().unwrap(),
            Some(password) => {
                let password = Some(password.to_owned());
                KeyPair::generate_encrypted_keypair(password).unwrap()
            }
        };
        fs::write(&paths[0], sk.to_box(None).unwrap().into_string()).unwrap();
        fs::write(&paths[1], pk.to_box().unwrap().into_string()).unwrap();
        paths
    }

    fn signed(key: &SigningKey) -> Contents {
        let file = |(path, bytes): (&str, &str)| (path.to_owned(), bytes.as_bytes().to_vec());
        let mut contents: Contents = [("a.xml", "one"), ("resources/b", "two")].map(file).into();
        key.sign("x.fmu", &mut contents).unwrap();
        contents
    }

    /// A sound FMU passes with its key and says whose it is; every change is refused by name, also
    /// where no key is given, and another key is never taken for the right one.
    #[test]
    fn every_change_after_signing_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [secret, public] = key_files(folder.path(), "own", None);
        let [_, other] = key_files(folder.path(), "other", None);
        let sound = signed(&SigningKey::read(&secret).unwrap());
        let [own, other] = [&public, &other].map(|path| VerifyingKey::read(path).unwrap());
        let number = id(own.key.keynum());
        assert_eq!(
            check(&sound, Some(&own)),
            Ok(Origin::Signed(number.clone()))
        );
        assert_eq!(check(&sound, None), Ok(Origin::Unchecked(number.clone())));
        assert!(check(&sound, Some(&other)).unwrap_err().contains(&number));

        let refused = |words: &str, change: &dyn Fn(&mut Contents)| {
            let mut changed = sound.clone();
            change(&mut changed);
            for key in [Some(&own), None] {
                let sentence = check(&changed, key).unwrap_err();
                assert!(sentence.contains(words), "{words}: {sentence}");
            }
        };
        refused("a.xml is not the file", &|files| {
            files.insert("a.xml".into(), b"ONE".to_vec());
        });
        refused("resources/b is not the file", &|files| {
            files.remove("resources/b");
        });
        refused("c was not signed", &|files| {
            files.insert("c".into(), Vec::new());
        });
        refused(SIGNATURE, &|files| {
            files.remove(SIGNATURE);
        });
        refused(MANIFEST, &|files| {
            files.remove(MANIFEST);
        });
        refused("no signature of minisign", &|files| {
            files.insert(SIGNATURE.into(), b"none".to_vec());
        });

        // Whoever changes a file and the list with it is found out by the key alone.
        let mut forged = sound.clone();
        forged.insert("a.xml".into(), b"ONE".to_vec());
        let list = manifest(&forged);
        forged.insert(MANIFEST.into(), list.into_bytes());
        let sentence = check(&forged, Some(&own)).unwrap_err();
        assert!(sentence.contains("is not what key"), "{sentence}");

        let plain: Contents = [("a.xml".to_owned(), Vec::new())].into();
        assert_eq!(check(&plain, None), Ok(Origin::Unsigned));
        assert!(
            check(&plain, Some(&own))
                .unwrap_err()
                .contains("not signed")
        );
    }

    /// Made by the minisign program with `-W`, for this test alone.
    const SECRET: &str = "untrusted comment: a key for tests\nRWQAAEIyAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAZfGWMZGuxZHTQeMz1dAeFLRZKmQJVKFEmPvY2i8R1b8kPCz80iuhrOKqhtY0lHaN9doUgI0xeuO3qa91LC4ARpGGs5yg0rnDAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=\n";
    const PUBLIC: &str = "untrusted comment: a key for tests\nRWRl8ZYxka7FkeKqhtY0lHaN9doUgI0xeuO3qa91LC4ARpGGs5yg0rnD\n";

    #[test]
    fn keys_of_the_minisign_program_sign() {
        let folder = tempfile::tempdir().unwrap();
        let [secret, public] = ["k.key", "k.pub"].map(|name| folder.path().join(name));
        fs::write(&secret, SECRET).unwrap();
        fs::write(&public, PUBLIC).unwrap();
        let sound = signed(&SigningKey::read(&secret).unwrap());
        let key = VerifyingKey::read(&public).unwrap();
        assert!(matches!(check(&sound, Some(&key)), Ok(Origin::Signed(_))));
        // One digit of the secret half: it cannot sign for its public half.
        fs::write(&secret, SECRET.replacen("GuxZHTQ", "GuxZHTR", 1)).unwrap();
        let mut contents = Contents::new();
        let signs = SigningKey::read(&secret).and_then(|key| key.sign("x", &mut contents));
        assert!(signs.is_err());
    }

    #[test]
    fn a_password_is_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let [secret, _] = key_files(folder.path(), "own", Some("word"));
        // Tests have no terminal to ask on, or one that nobody answers at: only the sentence is tried.
        if !std::io::stdin().is_terminal() {
            let sentence = SigningKey::read(&secret).unwrap_err().to_string();
            assert!(sentence.contains(PASSWORD), "{sentence}");
        }
    }

    #[test]
    fn files_that_are_no_keys_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let [secret, public] = key_files(folder.path(), "own", None);
        for (path, word) in [
            (&folder.path().join("none"), "check the path"),
            (&public, "minisign"),
        ] {
            let sentence = SigningKey::read(path).unwrap_err().to_string();
            assert!(sentence.contains(word), "{sentence}");
        }
        let sentence = VerifyingKey::read(&secret)
            .map(|_| ())
            .unwrap_err()
            .to_string();
        assert!(sentence.contains("own.key"), "{sentence}");
    }
}
