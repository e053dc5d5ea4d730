//! An output directory that gets all of its files or none.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Files are collected in a temporary directory inside the output directory and moved into place
/// together; dropped before that, it leaves nothing behind.
pub struct Staging {
    out: PathBuf,
    temporary: Option<TempDir>,
    /// Directories that were made for the output, innermost first.
    made: Vec<PathBuf>,
    names: Vec<String>,
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
        let made = ancestors
            .take_while(|path| !path.exists())
            .map(Path::to_path_buf)
            .collect();
        let mut staging = Self {
            out: out.to_path_buf(),
            temporary: None,
            made,
            names: Vec::new(),
        };
        let hidden = fs::create_dir_all(out)
            .and_then(|()| tempfile::Builder::new().prefix(".ftc-fmu-").tempdir_in(out));
        staging.temporary = Some(hidden.map_err(|error| staging.blame(&error))?);
        Ok(staging)
    }

    /// Adds a file.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let Some(temporary) = &self.temporary else {
            return Ok(());
        };
        fs::write(temporary.path().join(name), bytes).map_err(|error| self.blame(&error))?;
        self.names.push(name.to_string());
        Ok(())
    }

    /// Moves every file into place and returns their paths.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, String> {
        let mut paths = Vec::new();
        if let Some(temporary) = &self.temporary {
            for name in &self.names {
                let path = self.out.join(name);
                fs::rename(temporary.path().join(name), &path)
                    .map_err(|error| self.blame(&error))?;
                paths.push(path);
            }
        }
        self.made.clear();
        Ok(paths)
    }

    fn blame(&self, error: &io::Error) -> String {
        format!(
            "--out {}: cannot be written to ({error}): name a directory you may write to",
            self.out.display()
        )
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        drop(self.temporary.take());
        for path in &self.made {
            fs::remove_dir(path).ok();
        }
    }
}
