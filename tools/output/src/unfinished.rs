//! What is being written: taken away where the program is interrupted, swept where it was killed.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How hidden files and directories begin.
pub(crate) const HIDDEN: &str = ".ftc-fmu-";

/// Held while a set of files is moved into place.
static MOVING: Mutex<()> = Mutex::new(());

/// Hidden files and directories of this process.
static PATHS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn paths() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PATHS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An interrupted program has to wait as long as this is held.
pub(crate) fn moving() -> MutexGuard<'static, ()> {
    MOVING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a program does before it ends at an interrupt: lets a set of files that is being moved into
/// place have its turn, and removes what unfinished ones consist of. None is completed afterwards.
pub fn abandon() {
    std::mem::forget(moving());
    // Files first, then directories from the inside: of those only empty ones are removed, but for
    // the hidden ones.
    let paths = paths();
    for path in paths.iter().rev() {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match (path.is_dir(), name.starts_with(HIDDEN)) {
            (true, true) => remove_filling(path),
            (true, false) => drop(fs::remove_dir(path)),
            (false, _) => drop(fs::remove_file(path)),
        }
    }
    // Nothing is begun any more.
    std::mem::forget(paths);
}

/// Removes a directory to which another thread may still add files.
fn remove_filling(folder: &Path) {
    for _ in 0..1000 {
        if fs::remove_dir_all(folder).is_ok() || !folder.exists() {
            return;
        }
    }
}

/// Paths that are removed where the program is interrupted while this lives.
#[derive(Debug)]
pub(crate) struct Unfinished(Vec<PathBuf>);

impl Unfinished {
    /// What `make` makes at these paths; an interrupt comes before it or after it.
    pub(crate) fn make<T>(
        make: impl FnOnce() -> io::Result<(T, Vec<PathBuf>)>,
    ) -> io::Result<(T, Self)> {
        let mut all = paths();
        let (made, at) = make()?;
        all.extend(at.iter().cloned());
        Ok((made, Self(at)))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut all = paths();
        for path in &self.0 {
            all.remove(path);
        }
    }
}

/// Lets one program at a time sweep a directory and begin a file or set in it, where the system can
/// lock directories: what another has begun and not yet locked would look abandoned.
pub(crate) fn turn(folder: &Path) -> Option<File> {
    if !cfg!(unix) {
        return None;
    }
    let directory = File::open(folder).ok()?;
    for _ in 0..100 {
        if directory.try_lock().is_ok() {
            return Some(directory);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    None
}

/// Removes a hidden file unless the run that writes it goes on.
pub(crate) fn sweep(file: &Path) -> io::Result<()> {
    let opened = File::options().write(true).open(file);
    match opened.as_ref().map(File::try_lock) {
        Ok(Err(_)) => Ok(()),
        _ => fs::remove_file(file),
    }
}
