//! Input files are files: what never ends, or has no bytes, is refused before it is read.

use crate::error::Error;
use std::fs::{File, FileType};
use std::io::Read;
use std::path::Path;

/// Opens a regular file for reading. A named pipe would wait for a writer for ever, a device may have no end.
///
/// ```
/// let error = sabine_acoustics::open_file(std::env::temp_dir()).unwrap_err();
/// assert!(error.to_string().ends_with("is a directory; a file is needed"));
/// ```
///
/// # Errors
/// [`Error::NotAFile`], or [`Error::Io`] if it cannot be opened. Both name the file.
pub fn open_file(path: impl AsRef<Path>) -> Result<File, Error> {
    let path = path.as_ref();
    let failed = |source| Error::Io { path: path.to_owned(), source };
    // Before it is opened: opening a named pipe waits already.
    let kind = std::fs::metadata(path).map_err(failed)?.file_type();
    if !kind.is_file() {
        return Err(Error::NotAFile { path: path.to_owned(), found: name(kind) });
    }
    File::open(path).map_err(failed)
}

/// Reads at most so many bytes of a regular file.
///
/// # Errors
/// As [`open_file`].
pub fn read_at_most(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    let failed = |source| Error::Io { path: path.to_owned(), source };
    let file = open_file(path)?;
    let length = file.metadata().map_err(failed)?.len();
    let mut bytes = Vec::with_capacity(length.min(most) as usize);
    file.take(most).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}

/// Reads a text file of a person's making: its names may be in any old encoding, numbers and keywords are ASCII.
///
/// # Errors
/// As [`open_file`].
pub fn read_text(path: &Path) -> Result<String, Error> {
    Ok(String::from_utf8_lossy(&read_at_most(path, u64::MAX)?).into_owned())
}

#[cfg(unix)]
fn name(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if kind.is_dir() {
        "a directory"
    } else if kind.is_fifo() {
        "a named pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn name(kind: FileType) -> &'static str {
    if kind.is_dir() { "a directory" } else { "a device" }
}
