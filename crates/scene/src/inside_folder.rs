//! Files that a file names: only those below a folder, unless asked.

use crate::error::Error;
use std::path::{Component, Path, PathBuf};

/// Refuses a file that does not lie below a folder, be it by `..`, by an absolute path or by a symbolic link.
///
/// # Errors
/// [`Error::OutsideFolder`].
pub(crate) fn check_inside(folder: &Path, file: &Path) -> Result<(), Error> {
    // The empty path is the current folder.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let below = match (folder.canonicalize(), file.canonicalize()) {
        (Ok(real_folder), Ok(real_file)) => real_file.starts_with(real_folder),
        // What does not exist is judged by its name: an error that tells whether a foreign file exists says too much.
        _ => match (std::path::absolute(folder), std::path::absolute(file)) {
            (Ok(folder), Ok(file)) => plain(&file).starts_with(plain(&folder)),
            _ => false,
        },
    };
    let outside = || Error::OutsideFolder { named: file.to_owned(), folder: folder.to_owned() };
    if below { Ok(()) } else { Err(outside()) }
}

/// The path without `.` and `..`, as far as its text tells.
fn plain(path: &Path) -> PathBuf {
    let mut result = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if matches!(result.components().next_back(), Some(Component::Normal(_))) => {
                result.pop();
            }
            other => result.push(other),
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_below_the_folder_pass() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("room");
        std::fs::create_dir_all(folder.join("ir")).unwrap();
        for file in ["secret", "room/a.obj", "room/ir/b.wav", "roommate"] {
            std::fs::write(parent.path().join(file), "x").unwrap();
        }
        let inside = |name: &str| check_inside(&folder, &folder.join(name)).is_ok();
        for name in ["a.obj", "ir/b.wav", "ir/../a.obj", "./ir/./b.wav", "ir/missing.wav", "../room/a.obj"] {
            assert!(inside(name), "{name}");
        }
        for name in ["../secret", "ir/../../secret", "/etc/passwd", "../missing", "/missing", "../roommate"] {
            assert!(!inside(name), "{name}");
        }
        assert!(inside(folder.join("a.obj").to_str().unwrap()), "an absolute path below the folder");
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("../secret", folder.join("link")).unwrap();
            std::os::unix::fs::symlink("a.obj", folder.join("good")).unwrap();
            std::os::unix::fs::symlink(&folder, parent.path().join("alias")).unwrap();
            assert!(!inside("link") && inside("good"));
            let alias = parent.path().join("alias");
            assert!(check_inside(&alias, &alias.join("a.obj")).is_ok());
        }
    }

    #[test]
    fn relative_folders_are_read_as_they_stand() {
        assert_eq!(plain(Path::new("a/./b/../c")), Path::new("a/c"));
        assert_eq!(plain(Path::new("../a")), Path::new("../a"));
        assert!(check_inside(Path::new(""), Path::new("missing.obj")).is_ok());
        assert!(check_inside(Path::new("missing"), Path::new("missing/room.obj")).is_ok());
        for file in ["../missing.obj", "/missing.obj"] {
            assert!(check_inside(Path::new("."), Path::new(file)).is_err(), "{file}");
        }
    }
}
