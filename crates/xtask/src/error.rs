//! What can go wrong with a chore.

use std::path::PathBuf;

/// A chore that was not done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A program could not be started.
    #[error("{program} cannot be started: {source}")]
    Start {
        /// The program.
        program: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A program ended with an error.
    #[error("failed: {}", names.join(", "))]
    Failed {
        /// What was run.
        names: Vec<String>,
    },
    /// A file is not as it should be.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// An argument is refused.
    #[error("{reason}")]
    Argument {
        /// Why.
        reason: String,
    },
    /// A table of the validation is no longer what its command prints.
    #[error("{table}: {lines} lines differ")]
    Differs {
        /// Its name.
        table: String,
        /// Lines removed and added.
        lines: usize,
    },
}

impl Error {
    /// An error of this file, for `map_err`.
    pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }

    /// A file whose content is not as it should be.
    pub fn content(path: impl Into<PathBuf>, reason: impl Into<String>) -> Self {
        Self::Content { path: path.into(), reason: reason.into() }
    }
}
