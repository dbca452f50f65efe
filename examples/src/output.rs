//! A folder of results that appear together or not at all.

use std::io;
use std::path::{Path, PathBuf};

/// Files are written beside their final place under a temporary name; [`OutputFolder::finish`] renames them. Dropped before
/// that, it leaves nothing behind.
pub struct OutputFolder {
    folder: PathBuf,
    created: bool,
    waiting: PathBuf,
    names: Vec<String>,
}

/// A result that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct OutputError {
    /// The file or folder.
    pub path: PathBuf,
    /// The cause.
    pub source: io::Error,
}

fn at(path: &Path) -> impl FnOnce(io::Error) -> OutputError {
    let path = path.to_owned();
    |source| OutputError { path, source }
}

impl OutputFolder {
    /// Makes the folder, and tries at once whether it can be written to.
    ///
    /// # Errors
    /// [`OutputError`] if it cannot.
    pub fn create(folder: &Path) -> Result<Self, OutputError> {
        let created = !folder.exists();
        std::fs::create_dir_all(folder).map_err(at(folder))?;
        let waiting = folder.join(format!(".unfinished-{}", std::process::id()));
        if let Err(error) = std::fs::create_dir_all(&waiting) {
            if created {
                let _ = std::fs::remove_dir(folder);
            }
            return Err(at(folder)(error));
        }
        Ok(Self { folder: folder.to_owned(), created, waiting, names: Vec::new() })
    }

    /// Writes a file of the folder, to the disk and not only to its cache.
    ///
    /// # Errors
    /// [`OutputError`], naming the file as it will be called.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let unfinished = self.waiting.join(name);
        let write = || {
            let mut file = std::fs::File::create(&unfinished)?;
            io::Write::write_all(&mut file, bytes)?;
            file.sync_all()
        };
        write().map_err(at(&self.folder.join(name)))?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Moves all files to their names.
    ///
    /// # Errors
    /// [`OutputError`] for a name that cannot be taken, a folder of that name for example.
    pub fn finish(mut self) -> Result<(), OutputError> {
        for name in &self.names {
            let target = self.folder.join(name);
            std::fs::rename(self.waiting.join(name), &target).map_err(at(&target))?;
        }
        self.created = false;
        Ok(())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.waiting);
        if self.created {
            // Removes it only if nothing is in it.
            let _ = std::fs::remove_dir(&self.folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_appear_together_or_not_at_all() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("results");
        let mut out = OutputFolder::create(&folder).unwrap();
        out.write("a.txt", b"a").unwrap();
        assert!(!folder.join("a.txt").exists());
        drop(out);
        assert!(!folder.exists(), "an abandoned folder stays");

        let mut out = OutputFolder::create(&folder).unwrap();
        out.write("a.txt", b"a").unwrap();
        out.finish().unwrap();
        assert_eq!(std::fs::read(folder.join("a.txt")).unwrap(), b"a");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        std::fs::write(&file, b"x").unwrap();
        let error = OutputFolder::create(&file).err().unwrap();
        assert_eq!(error.path, file);
    }
}
