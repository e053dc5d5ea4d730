//! One file that is written whole or not at all.

use crate::directory::recover;
use crate::unfinished::{self, HIDDEN, Unfinished};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile};

/// A file that takes its place once it is complete; dropped before that, it leaves what stood there.
#[derive(Debug)]
pub struct Replacement {
    temporary: NamedTempFile,
    target: PathBuf,
    _unfinished: Unfinished,
}

impl Replacement {
    /// An empty file, under another name in the folder of `target`.
    ///
    /// # Errors
    /// What the file system says.
    pub fn of(target: &Path) -> io::Result<Self> {
        let folder = match target.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut builder = Builder::new();
        builder.prefix(HIDDEN);
        // A result may be read by whoever may read other files of this user.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        // What is said of a folder that is missing names no temporary file.
        std::fs::metadata(folder)?;
        let begin = || {
            let _turn = unfinished::turn(folder);
            // What cannot be removed does no harm.
            recover(folder).ok();
            let temporary = builder.tempfile_in(folder)?;
            temporary.as_file().lock()?;
            let path = temporary.path().to_path_buf();
            Ok((temporary, vec![path]))
        };
        let (temporary, unfinished) = Unfinished::make(begin)?;
        Ok(Self {
            _unfinished: unfinished,
            temporary,
            target: target.to_path_buf(),
        })
    }

    /// A handle to write with.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn file(&self) -> io::Result<File> {
        self.temporary.as_file().try_clone()
    }

    /// Where the file will stand.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Flushes the file to the disk and puts it in its place.
    ///
    /// # Errors
    /// What the file system says; then the place is as it was.
    pub fn keep(self) -> io::Result<()> {
        self.temporary.as_file().sync_all()?;
        let _moving = unfinished::moving();
        let kept = self.temporary.persist(&self.target);
        kept.map(drop).map_err(|error| error.error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::io::Write;

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("kept");
        fs::write(&target, "old").unwrap();
        let dropped = Replacement::of(&target).unwrap();
        dropped.file().unwrap().write_all(b"half").unwrap();
        drop(dropped);
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
        let kept = Replacement::of(&target).unwrap();
        kept.file().unwrap().write_all(b"new").unwrap();
        assert_eq!(fs::read_to_string(kept.target()).unwrap(), "old");
        kept.keep().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
