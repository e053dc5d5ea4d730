//! Files that are written whole or not at all, also when the program is interrupted or killed.
//!
//! [`Staging`] writes a set of files into a directory, [`Replacement`] a single file.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let staging = output::Staging::new(folder.path())?;
//! staging.add("one.txt", b"1")?;
//! staging.add("two.txt", b"2")?;
//! assert!(!folder.path().join("one.txt").exists());
//! let paths = staging.commit()?;
//! assert_eq!(std::fs::read(&paths[1])?, b"2");
//! # Ok(())
//! # }
//! ```

mod directory;
mod replacement;
mod unfinished;

pub use directory::{Error, Staging, unwritten, write};
pub use replacement::Replacement;
pub use unfinished::abandon;
