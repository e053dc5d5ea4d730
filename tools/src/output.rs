//! An output directory that gets all of its files or none.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

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
    pub fn new(out: &Path) -> Result<Self, String> {
        if out.exists() && !out.is_dir() {
            return Err(format!(
                "--out {}: this is a file: name a directory",
                out.display()
            ));
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
    pub fn folder(&self) -> &Path {
        self.temporary.path()
    }

    /// Where a file will be once all are moved into place.
    pub fn target(&self, name: &str) -> PathBuf {
        self.out.join(name)
    }

    /// Adds a file.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn add(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        fs::write(self.folder().join(name), bytes).map_err(|error| blame(&self.out, &error))
    }

    /// Moves every file into place and returns their paths in alphabetical order.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, String> {
        let paths = self
            .move_files()
            .map_err(|error| blame(&self.out, &error))?;
        self.made.clear();
        Ok(paths)
    }

    fn move_files(&self) -> io::Result<Vec<PathBuf>> {
        let mut names = Vec::new();
        for entry in fs::read_dir(self.folder())? {
            names.push(entry?.file_name());
        }
        names.sort();
        let mut paths = Vec::new();
        for name in names {
            let path = self.out.join(&name);
            fs::rename(self.folder().join(&name), &path)?;
            paths.push(path);
        }
        Ok(paths)
    }
}

fn blame(out: &Path, error: &io::Error) -> String {
    format!(
        "--out {}: cannot be written to ({error}): name a directory you may write to",
        out.display()
    )
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
