//! An output directory that gets all of its files or none.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Where replaced files are kept until all new ones are in place.
const ASIDE: &str = ".replaced";

/// Why an output directory did not get its files.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", directory.display())]
pub struct Error {
    /// The output directory.
    pub directory: PathBuf,
    /// What is wrong with it, and what to do.
    pub what: String,
}

/// Files are collected in a temporary directory inside the output directory and moved into place
/// together; dropped before that, it leaves nothing behind.
pub struct Staging {
    out: PathBuf,
    temporary: TempDir,
    /// Directories that were made for the output, innermost first.
    made: Vec<PathBuf>,
}

impl Staging {
    /// Makes `out` where it does not exist and proves that it can be written to.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn new(out: &Path) -> Result<Self, Error> {
        if out.exists() && !out.is_dir() {
            return Err(fault(out, "this is a file: name a directory".into()));
        }
        let ancestors = out.ancestors().filter(|path| !path.as_os_str().is_empty());
        let made: Vec<PathBuf> = ancestors
            .take_while(|path| !path.exists())
            .map(Path::to_path_buf)
            .collect();
        let temporary = fs::create_dir_all(out)
            .and_then(|()| tempfile::Builder::new().prefix(".ftc-fmu-").tempdir_in(out))
            .map_err(|error| {
                remove(&made);
                blame(out, &error)
            })?;
        Ok(Self {
            out: out.to_path_buf(),
            temporary,
            made,
        })
    }

    /// Where files are collected.
    fn folder(&self) -> &Path {
        self.temporary.path()
    }

    /// Adds a file.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn add(&self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        fs::write(self.folder().join(name), bytes).map_err(|error| blame(&self.out, &error))
    }

    /// Moves every file into place and returns their paths in alphabetical order. Where one cannot
    /// be moved, all are taken back, and what stood in their places is there again.
    ///
    /// # Errors
    /// One sentence that names the file in the way, or the directory.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, Error> {
        let names = self.names().map_err(|error| blame(&self.out, &error))?;
        for name in &names {
            self.check_way(name)?;
        }
        let aside = self.folder().join(ASIDE);
        fs::create_dir(&aside).map_err(|error| blame(&self.out, &error))?;
        self.exchange(&names, &aside)?;
        self.made.clear();
        Ok(names.iter().map(|name| self.out.join(name)).collect())
    }

    /// Puts all files into place, or none.
    fn exchange(&self, names: &[OsString], aside: &Path) -> Result<(), Error> {
        for (done, name) in names.iter().enumerate() {
            if let Err(error) = self.swap(name, aside) {
                for name in names[..=done].iter().rev() {
                    self.swap_back(name, aside);
                }
                let what = format!(
                    "{} cannot be written ({error}): name another directory",
                    name.to_string_lossy()
                );
                return Err(fault(&self.out, what));
            }
        }
        Ok(())
    }

    /// The files collected, in alphabetical order.
    fn names(&self) -> io::Result<Vec<OsString>> {
        let entries = fs::read_dir(self.folder())?;
        let mut names: Vec<OsString> = entries
            .map(|entry| entry.map(|entry| entry.file_name()))
            .collect::<io::Result<_>>()?;
        names.sort();
        Ok(names)
    }

    /// A file may be replaced, a directory may not.
    fn check_way(&self, name: &OsStr) -> Result<(), Error> {
        match fs::symlink_metadata(self.out.join(name)) {
            Ok(there) if there.is_dir() => Err(fault(
                &self.out,
                format!(
                    "{} is a directory there, but a file of that name is to be written: \
                     move it away, or name another directory",
                    name.to_string_lossy()
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Puts a file into place, and what stood there `aside`.
    fn swap(&self, name: &OsStr, aside: &Path) -> io::Result<()> {
        let target = self.out.join(name);
        if fs::symlink_metadata(&target).is_ok() {
            fs::rename(&target, aside.join(name))?;
        }
        fs::rename(self.folder().join(name), target)
    }

    /// The reverse, as far as it had come.
    fn swap_back(&self, name: &OsStr, aside: &Path) {
        let (target, fresh, old) = (
            self.out.join(name),
            self.folder().join(name),
            aside.join(name),
        );
        if !fresh.exists() {
            fs::rename(&target, fresh).ok();
        }
        if fs::symlink_metadata(&old).is_ok() {
            fs::rename(old, target).ok();
        }
    }
}

fn blame(out: &Path, error: &io::Error) -> Error {
    fault(
        out,
        format!("cannot be written to ({error}): name a directory you may write to"),
    )
}

fn fault(out: &Path, what: String) -> Error {
    Error {
        directory: out.to_path_buf(),
        what,
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // The temporary directory goes first: only empty directories are removed.
        fs::remove_dir_all(self.folder()).ok();
        remove(&self.made);
    }
}

/// Removes directories that are empty, innermost first.
fn remove(directories: &[PathBuf]) {
    for path in directories {
        fs::remove_dir(path).ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_moved_is_taken_back_where_another_cannot_be() {
        let root = TempDir::new().unwrap();
        let out = root.path();
        fs::write(out.join("a"), "old a").unwrap();
        fs::write(out.join("c"), "old c").unwrap();
        let staging = Staging::new(out).unwrap();
        for name in ["a", "b", "c"] {
            staging.add(name, b"new").unwrap();
        }
        let names = staging.names().unwrap();
        // The old c cannot be put aside: a directory bears its name there.
        let aside = TempDir::new_in(out).unwrap();
        fs::create_dir(aside.path().join("c")).unwrap();
        let message = staging
            .exchange(&names, aside.path())
            .unwrap_err()
            .to_string();
        assert!(message.contains(": c cannot be written"), "{message}");
        assert_eq!(fs::read_to_string(out.join("a")).unwrap(), "old a");
        assert!(!out.join("b").exists());
        assert_eq!(fs::read_to_string(out.join("c")).unwrap(), "old c");
        let paths = staging.commit().unwrap();
        assert_eq!(paths.len(), 3);
        assert_eq!(fs::read_to_string(out.join("c")).unwrap(), "new");
    }
}
