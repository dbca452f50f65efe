//! A folder of results that appear together or not at all.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Beginning of the names of folders that are being written.
const UNFINISHED: &str = ".unfinished-";
/// File in them that their process holds locked: the lock ends with the process, however it ends.
const LOCK: &str = "lock";
/// Age from which a folder without a lock counts as left behind: older versions made none.
const LEFT_BEHIND: Duration = Duration::from_secs(3600);

/// Files are written beside their final place under a temporary name; [`OutputFolder::finish`] renames them. Dropped before
/// that, it leaves nothing behind. A process that is killed leaves its `.unfinished-...` folder, and only that; the next that
/// writes to the same place removes it.
pub struct OutputFolder {
    folder: PathBuf,
    /// Held until the end.
    _lock: File,
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
        remove_left_behind(folder);
        let waiting = folder.join(format!("{UNFINISHED}{}", std::process::id()));
        let locked = || {
            std::fs::create_dir_all(&waiting)?;
            let lock = File::create(waiting.join(LOCK))?;
            // Where there are no locks, the age of the folder has to do.
            let _ = lock.try_lock();
            Ok(lock)
        };
        let lock = locked().map_err(|error| {
            let _ = std::fs::remove_dir(&waiting);
            if created {
                let _ = std::fs::remove_dir(folder);
            }
            at(folder)(error)
        })?;
        Ok(Self { folder: folder.to_owned(), _lock: lock, created, waiting, names: Vec::new() })
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

    /// Where a file of the folder is to be written by somebody else, whole, before [`OutputFolder::finish`].
    pub fn path_of(&mut self, name: &str) -> PathBuf {
        self.names.push(name.to_owned());
        self.waiting.join(name)
    }

    /// Moves all files to their names. If one cannot take its name, those before it give theirs back, and what was there before is
    /// there again.
    ///
    /// # Errors
    /// [`OutputError`] for a name that cannot be taken, a folder of that name for example.
    pub fn finish(mut self) -> Result<(), OutputError> {
        let before = self.waiting.join("before");
        std::fs::create_dir(&before).map_err(at(&before))?;
        for (i, name) in self.names.iter().enumerate() {
            if let Err(error) = self.place(name, &before) {
                for name in &self.names[..i] {
                    self.take_back(name, &before);
                }
                return Err(at(&self.folder.join(name))(error));
            }
        }
        self.created = false;
        Ok(())
    }

    /// Gives a file its name; the one that had it is kept in `before`, too, and has it until the very moment.
    fn place(&self, name: &str, before: &Path) -> io::Result<()> {
        let target = self.folder.join(name);
        if target.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        if target.exists() {
            let kept = before.join(name);
            // Not every file system has links.
            std::fs::hard_link(&target, &kept).or_else(|_| std::fs::copy(&target, &kept).map(|_| ()))?;
        }
        std::fs::rename(self.waiting.join(name), &target)
    }

    /// Undoes [`OutputFolder::place`]; the error that counts is the one that led here.
    fn take_back(&self, name: &str, before: &Path) {
        let target = self.folder.join(name);
        if std::fs::rename(before.join(name), &target).is_err() {
            // There was none.
            let _ = std::fs::remove_file(&target);
        }
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

/// Removes what killed processes left in the folder. That it cannot be removed is no reason to refuse the work.
fn remove_left_behind(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        let is_unfinished = entry.file_name().to_string_lossy().starts_with(UNFINISHED);
        if is_unfinished && is_left_behind(&path) {
            let _ = std::fs::remove_dir_all(&path);
        }
    }
}

/// Whether the process that made an unfinished folder is gone.
fn is_left_behind(unfinished: &Path) -> bool {
    if let Ok(lock) = File::open(unfinished.join(LOCK)) {
        return match lock.try_lock() {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => false,
            Err(TryLockError::Error(_)) => is_old(unfinished),
        };
    }
    is_old(unfinished)
}

fn is_old(folder: &Path) -> bool {
    let age = folder.metadata().and_then(|data| data.modified()).map(|time| time.elapsed());
    matches!(age, Ok(Ok(age)) if age > LEFT_BEHIND)
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
    fn a_name_that_is_taken_leaves_the_old_results() {
        let parent = tempfile::tempdir().unwrap();
        let write = |names: &[&str], text: &[u8]| {
            let mut out = OutputFolder::create(parent.path())?;
            for name in names {
                out.write(name, text)?;
            }
            out.finish()
        };
        write(&["a.txt", "b.txt"], b"old").unwrap();
        std::fs::create_dir(parent.path().join("taken.txt")).unwrap();
        let error = write(&["a.txt", "new.txt", "taken.txt", "b.txt"], b"new").unwrap_err();
        assert_eq!(error.path, parent.path().join("taken.txt"));
        for name in ["a.txt", "b.txt"] {
            assert_eq!(std::fs::read(parent.path().join(name)).unwrap(), b"old", "{name}");
        }
        let mut names: Vec<_> =
            std::fs::read_dir(parent.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["a.txt", "b.txt", "taken.txt"]);
        write(&["a.txt", "b.txt"], b"new").unwrap();
        assert_eq!(std::fs::read(parent.path().join("b.txt")).unwrap(), b"new");
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        std::fs::write(&file, b"x").unwrap();
        let error = OutputFolder::create(&file).err().unwrap();
        assert_eq!(error.path, file);
    }

    #[test]
    fn what_a_killed_process_left_is_removed_and_what_a_living_one_writes_is_not() {
        let parent = tempfile::tempdir().unwrap();
        let unfinished = |name: &str| {
            let folder = parent.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            std::fs::write(folder.join("a.txt"), b"a").unwrap();
            folder
        };
        let (killed, living) = (unfinished(".unfinished-1"), unfinished(".unfinished-2"));
        let unlocked = unfinished(".unfinished-3");
        std::fs::write(killed.join(LOCK), b"").unwrap();
        let lock = File::create(living.join(LOCK)).unwrap();
        lock.try_lock().unwrap();
        OutputFolder::create(parent.path()).unwrap().finish().unwrap();
        assert!(!killed.exists(), "left");
        // One without a lock may have been made this very moment.
        assert!(living.exists() && unlocked.exists());
        let before = std::time::SystemTime::now() - 2 * LEFT_BEHIND;
        File::open(&unlocked).unwrap().set_modified(before).unwrap();
        OutputFolder::create(parent.path()).unwrap().finish().unwrap();
        assert!(living.exists() && !unlocked.exists());
    }
}
