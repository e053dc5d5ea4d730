//! An output directory that gets all of its files or none, also when the program is killed.
//!
//! Files are collected in a hidden directory of the output directory and flushed to the disk. It
//! is renamed to `.ftc-fmu-ready` once it is complete: from then on the new files count, and are moved into
//! place one by one. Who is killed before that has changed nothing; who is killed after it leaves
//! whole files, old ones and new ones, and the next run into that directory moves the rest before
//! it does anything else. A hidden directory is locked by the run that writes it, so that runs that
//! ended are told from those that go on, and swept.

use crate::unfinished::{self, HIDDEN, Unfinished};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The hidden directory whose files are complete.
const READY: &str = ".ftc-fmu-ready";

/// The file in a hidden directory that its run has locked.
const LOCK: &str = ".lock";

/// Where replaced files are kept until all new ones are in place.
const REPLACED: &str = ".replaced";

/// Why an output directory did not get its files.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", directory.display())]
#[non_exhaustive]
pub struct Error {
    /// The output directory, or the file that could not be written.
    pub directory: PathBuf,
    /// What is wrong with it, and what to do.
    pub what: String,
}

impl Error {
    /// A file that could not be written, of which the user names the directory.
    pub fn of_file(file: &Path, error: &io::Error) -> Self {
        failed_at(file, error)
    }
}

/// Writes all files into a directory, or none, and returns their paths in alphabetical order.
///
/// # Errors
/// One sentence that names the directory.
pub fn write(out: &Path, files: &[(String, Vec<u8>)]) -> Result<Vec<PathBuf>, Error> {
    let staging = Staging::new(out)?;
    staging.add_all(files)?;
    staging.commit()
}

/// Files are collected in a temporary directory inside the output directory and moved into place
/// together; dropped before that, it leaves nothing behind.
pub struct Staging {
    out: PathBuf,
    temporary: TempDir,
    /// Locked as long as this run goes on.
    _lock: File,
    /// Directories that were made for the output, innermost first.
    made: Vec<PathBuf>,
    _unfinished: Unfinished,
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
        let prepare = || {
            fs::create_dir_all(out)?;
            let _turn = unfinished::turn(out);
            recover(out)?;
            let temporary = tempfile::Builder::new().prefix(HIDDEN).tempdir_in(out)?;
            let lock = File::create(temporary.path().join(LOCK))?;
            lock.lock()?;
            let mut paths = made.clone();
            paths.push(temporary.path().to_path_buf());
            Ok(((temporary, lock), paths))
        };
        let ((temporary, lock), unfinished) = Unfinished::make(prepare).map_err(|error| {
            remove(&made);
            failed_at(out, &error)
        })?;
        Ok(Self {
            out: out.to_path_buf(),
            _unfinished: unfinished,
            temporary,
            _lock: lock,
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
        self.add_written(name, |file| file.write_all(bytes))
    }

    /// Adds several files.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn add_all(&self, files: &[(String, Vec<u8>)]) -> Result<(), Error> {
        files
            .iter()
            .try_for_each(|(name, bytes)| self.add(name, bytes))
    }

    /// Adds a file that is written piece by piece.
    ///
    /// # Errors
    /// One sentence that names the directory.
    pub fn add_written(
        &self,
        name: &str,
        write: impl FnOnce(&mut File) -> io::Result<()>,
    ) -> Result<(), Error> {
        let written = || {
            let mut file = File::create(self.folder().join(name))?;
            write(&mut file)?;
            file.sync_all()
        };
        written().map_err(|error| failed_at(&self.out, &error))
    }

    /// Moves every file into place and returns their paths in alphabetical order. Where one cannot
    /// be moved, all are taken back, and what stood in their places is there again.
    ///
    /// # Errors
    /// One sentence that names the file in the way, or the directory.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, Error> {
        let names = self.names().map_err(|error| failed_at(&self.out, &error))?;
        for name in &names {
            self.check_way(name)?;
        }
        let ready = self.out.join(READY);
        let _moving = unfinished::moving();
        let prepare = || {
            fs::create_dir(self.folder().join(REPLACED))?;
            flush(self.folder())?;
            fs::rename(self.folder(), &ready)?;
            flush(&self.out)
        };
        prepare().map_err(|error| failed_at(&self.out, &error))?;
        let moved = exchange(&self.out, &ready, &names);
        // What is left of it is gone either way.
        fs::remove_dir_all(&ready).ok();
        moved.map_err(|what| fault(&self.out, what))?;
        self.made.clear();
        Ok(names.iter().map(|name| self.out.join(name)).collect())
    }

    /// The files collected, in alphabetical order.
    fn names(&self) -> io::Result<Vec<OsString>> {
        collected(self.folder())
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
}

/// The files of a hidden directory, in alphabetical order.
fn collected(folder: &Path) -> io::Result<Vec<OsString>> {
    let names = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.file_name()));
    let mut names: Vec<OsString> = names.collect::<io::Result<_>>()?;
    names.retain(|name| name != LOCK && name != REPLACED);
    names.sort();
    Ok(names)
}

/// Finishes what runs that were killed had completed, and sweeps what they had not.
pub(crate) fn recover(out: &Path) -> io::Result<()> {
    for entry in fs::read_dir(out)? {
        let folder = entry?.path();
        let name = folder.file_name().unwrap_or_default();
        if !name.to_string_lossy().starts_with(HIDDEN) {
            continue;
        }
        if !folder.is_dir() {
            unfinished::sweep(&folder)?;
            continue;
        }
        let lock = File::options().write(true).open(folder.join(LOCK));
        if lock.as_ref().is_ok_and(|lock| lock.try_lock().is_err()) {
            // Its run goes on.
            continue;
        }
        if name == READY {
            for name in collected(&folder)? {
                fs::rename(folder.join(&name), out.join(&name))?;
            }
            flush(out)?;
        }
        fs::remove_dir_all(&folder)?;
    }
    Ok(())
}

/// Puts all files of `ready` into place in `out`, or none.
fn exchange(out: &Path, ready: &Path, names: &[OsString]) -> Result<(), String> {
    for (done, name) in names.iter().enumerate() {
        if let Err(error) = swap(out, ready, name) {
            for name in names[..=done].iter().rev() {
                swap_back(out, ready, name);
            }
            return Err(format!(
                "{} cannot be written ({error}): name another directory",
                name.to_string_lossy()
            ));
        }
    }
    flush(out).map_err(|error| format!("cannot be flushed to the disk ({error})"))
}

/// Puts a file into place; what stood there remains under its name until then, and in [`REPLACED`].
fn swap(out: &Path, ready: &Path, name: &OsStr) -> io::Result<()> {
    let (target, old) = (out.join(name), ready.join(REPLACED).join(name));
    if fs::symlink_metadata(&target).is_ok() {
        // Not every file system has hard links.
        match fs::hard_link(&target, &old) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Err(error),
            Err(_) => fs::rename(&target, &old)?,
            Ok(()) => {}
        }
    }
    fs::rename(ready.join(name), target)
}

/// The reverse, as far as it had come.
fn swap_back(out: &Path, ready: &Path, name: &OsStr) {
    let (target, fresh, old) = (
        out.join(name),
        ready.join(name),
        ready.join(REPLACED).join(name),
    );
    if !fresh.exists() {
        fs::rename(&target, fresh).ok();
    }
    if fs::symlink_metadata(&old).is_ok() {
        fs::rename(old, target).ok();
    }
}

/// Flushes a directory's names to the disk, where the system can.
fn flush(folder: &Path) -> io::Result<()> {
    if cfg!(unix) {
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

fn failed_at(out: &Path, error: &io::Error) -> Error {
    fault(out, unwritten(error, "directory"))
}

/// Why a file or directory (`what`) could not be written, and what to do, as the rest of a sentence.
pub fn unwritten(error: &io::Error, what: &str) -> String {
    use io::ErrorKind as Kind;
    match error.kind() {
        Kind::StorageFull => format!(
            "cannot be written, the disk is full ({error}): make room on it, or name a {what} on another disk"
        ),
        Kind::QuotaExceeded => format!(
            "cannot be written, your share of the disk is used up ({error}): make room, or name a {what} on another disk"
        ),
        Kind::FileTooLarge => format!(
            "cannot be written, a file would be larger than is allowed ({error}): raise that limit (ulimit -f), or ask for less"
        ),
        Kind::PermissionDenied | Kind::ReadOnlyFilesystem => {
            format!("cannot be written to ({error}): name a {what} you may write to")
        }
        _ => format!("cannot be written to ({error}): name another {what}"),
    }
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
        // The old c cannot be kept: a directory bears its name there.
        fs::create_dir_all(staging.folder().join(REPLACED).join("c")).unwrap();
        let message = exchange(out, staging.folder(), &names).unwrap_err();
        assert!(message.starts_with("c cannot be written"), "{message}");
        assert_eq!(fs::read_to_string(out.join("a")).unwrap(), "old a");
        assert!(!out.join("b").exists());
        assert_eq!(fs::read_to_string(out.join("c")).unwrap(), "old c");
        fs::remove_dir_all(staging.folder().join(REPLACED)).unwrap();
        let paths = staging.commit().unwrap();
        assert_eq!(paths.len(), 3);
        assert_eq!(fs::read_to_string(out.join("c")).unwrap(), "new");
    }

    /// Which generation each file is of.
    fn generations(out: &Path) -> Vec<String> {
        let read = |name: &str| fs::read_to_string(out.join(name)).unwrap_or_default();
        NAMES.iter().map(|name| read(name)).collect()
    }

    const NAMES: [&str; 4] = ["a.fmu", "b.fmu", "c.ssp", "d.csv"];

    /// Not a test of its own: writes set after set, until it is killed by the test below.
    #[test]
    fn writes_until_it_is_killed() {
        let Some(out) = std::env::var_os("FTC_OUTPUT_TO_BE_KILLED") else {
            return;
        };
        for generation in 0..1_000_000 {
            let staging = Staging::new(Path::new(&out)).unwrap();
            for name in NAMES {
                staging
                    .add(name, generation.to_string().as_bytes())
                    .unwrap();
            }
            staging.commit().unwrap();
        }
    }

    // promise: all-or-none
    #[test]
    #[cfg(unix)]
    fn a_run_that_is_killed_leaves_one_set_once_the_next_has_begun() {
        let root = TempDir::new().unwrap();
        let (_, module) = module_path!().split_once("::").unwrap();
        let writer = format!("{module}::writes_until_it_is_killed");
        let mut last = -1;
        for round in 0..40_u64 {
            let before = generations(root.path());
            let mut run = std::process::Command::new(std::env::current_exe().unwrap())
                .args(["--exact", &writer])
                .env("FTC_OUTPUT_TO_BE_KILLED", root.path())
                .stdout(std::process::Stdio::null())
                .spawn()
                .unwrap();
            // Another moment in every round: early ones, and those after a set was written.
            let begun = std::time::Instant::now();
            while round % 2 == 1
                && generations(root.path()) == before
                && begun.elapsed().as_secs() < 60
            {
                std::thread::yield_now();
            }
            let micros = 2_000 + round * 7_919 % 40_000;
            std::thread::sleep(std::time::Duration::from_micros(micros));
            run.kill().unwrap();
            run.wait().unwrap();
            drop(Staging::new(root.path()).unwrap());
            let found = generations(root.path());
            assert!(
                found.iter().all(|of| *of == found[0]),
                "round {round}: {found:?}"
            );
            last = last.max(found[0].parse().unwrap_or(-1));
            let hidden = fs::read_dir(root.path()).unwrap().filter(|entry| {
                let name = entry.as_ref().unwrap().file_name();
                name.to_string_lossy().starts_with('.')
            });
            assert_eq!(hidden.count(), 0, "round {round}");
        }
        assert!(last >= 0, "some sets were completed");
    }

    #[test]
    fn a_full_disk_is_not_blamed_on_the_directory() {
        let said = |kind| unwritten(&io::Error::from(kind), "directory");
        let full = said(io::ErrorKind::StorageFull);
        assert!(full.contains("the disk is full") && full.contains("make room"));
        assert!(!full.contains("may write"), "{full}");
        assert!(said(io::ErrorKind::QuotaExceeded).contains("your share of the disk"));
        assert!(said(io::ErrorKind::PermissionDenied).contains("a directory you may write to"));
        // A writer that fails halfway passes its error on, of its kind.
        let root = TempDir::new().unwrap();
        let staging = Staging::new(root.path()).unwrap();
        let written = staging.add_written("a", |_| Err(io::ErrorKind::StorageFull.into()));
        assert!(written.unwrap_err().what.contains("the disk is full"));
    }

    #[test]
    fn a_directory_that_a_run_works_in_is_left_alone() {
        let root = TempDir::new().unwrap();
        let first = Staging::new(root.path()).unwrap();
        first.add("a", b"first").unwrap();
        let second = Staging::new(root.path()).unwrap();
        second.add("a", b"second").unwrap();
        first.commit().unwrap();
        assert_eq!(fs::read_to_string(root.path().join("a")).unwrap(), "first");
        second.commit().unwrap();
        assert_eq!(fs::read_to_string(root.path().join("a")).unwrap(), "second");
    }
}
