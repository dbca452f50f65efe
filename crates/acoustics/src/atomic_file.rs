//! Output files are there whole or not at all.

use crate::error::Error;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file under a temporary name beside it, then renames it: whatever goes wrong, a full disk included, `path` is
/// left as it was and no fragment stays behind.
///
/// ```
/// use std::io::Write;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("match.json");
/// sabine_acoustics::write_atomically(&path, |file| writeln!(file, "{{}}"))?;
/// assert_eq!(std::fs::read_to_string(&path)?, "{}\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error::Io`], naming `path`, if the file cannot be created, written or renamed, or if `write` says so.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Error> {
    let (unfinished, file) = UnfinishedFile::create(path)?;
    let mut writer = BufWriter::new(file);
    let written = write(&mut writer).and_then(|()| writer.flush());
    unfinished.finish(written.map(|()| writer.get_ref()))
}

/// A file under a temporary name; dropped before it is finished, it goes.
#[derive(Debug)]
pub(crate) struct UnfinishedFile {
    path: PathBuf,
    temporary: PathBuf,
}

impl UnfinishedFile {
    /// Creates a file beside `path`.
    pub(crate) fn create(path: &Path) -> Result<(Self, File), Error> {
        let make = |name: &Path| OpenOptions::new().write(true).create_new(true).open(name);
        let (temporary, file) =
            take_name_beside(path, make).map_err(|source| Error::Io { path: path.to_owned(), source })?;
        Ok((Self { path: path.to_owned(), temporary }, file))
    }

    /// Brings what was written to the disk and gives the file its name. Some file systems tell of a full disk only now.
    pub(crate) fn finish(self, written: io::Result<&File>) -> Result<(), Error> {
        let done =
            written.and_then(File::sync_all).and_then(|()| std::fs::rename(&self.temporary, &self.path));
        done.map_err(|source| Error::Io { path: self.path.clone(), source })
    }
}

impl Drop for UnfinishedFile {
    fn drop(&mut self) {
        // After the renaming there is none. Else the first error is the one to report: a fragment that cannot be removed has the
        // same cause.
        let _ = std::fs::remove_file(&self.temporary);
    }
}

/// Makes a folder beside `path` that nothing else uses: hidden, so that nobody takes it for what it is to become.
///
/// # Errors
/// Where the folder cannot be made.
pub fn create_folder_beside(path: &Path) -> io::Result<PathBuf> {
    Ok(take_name_beside(path, |name| std::fs::create_dir(name))?.0)
}

/// Tries temporary names beside `path` until `create` gets one that was free.
fn take_name_beside<T>(path: &Path, create: impl Fn(&Path) -> io::Result<T>) -> io::Result<(PathBuf, T)> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
    loop {
        let mut temporary = std::ffi::OsString::from(".");
        temporary.push(name);
        temporary.push(format!(".{}-{}.tmp", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed)));
        let temporary = path.with_file_name(temporary);
        match create(&temporary) {
            Ok(made) => return Ok((temporary, made)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        write_atomically(&path, |file| file.write_all(b"old")).unwrap();
        let full = |file: &mut BufWriter<File>| {
            file.write_all(&[b'x'; 100_000])?;
            Err(io::ErrorKind::StorageFull.into())
        };
        match write_atomically(&path, full) {
            Err(Error::Io { path: named, source }) => {
                assert_eq!(named, path);
                assert_eq!(source.kind(), io::ErrorKind::StorageFull);
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["result.json"]);
    }

    #[test]
    fn a_folder_in_the_way_or_missing_is_named() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("taken")).unwrap();
        for wrong in ["taken", "missing/result.json"] {
            let path = folder.path().join(wrong);
            let error = write_atomically(&path, |file| file.write_all(b"new")).unwrap_err();
            assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
        }
        assert_eq!(names(folder.path()), ["taken"]);
        assert!(write_atomically(Path::new("/"), |_| Ok(())).is_err());
    }
}
