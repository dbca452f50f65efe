//! What can stand in the way.

use std::path::PathBuf;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Data that the tables rest on are not there.
    #[error("{path}: there is no such file; --data names the folder of rooms, speech and noise")]
    Missing {
        /// What was looked for.
        path: PathBuf,
    },
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    Io {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Of sounds and measures.
    #[error(transparent)]
    Acoustics(#[from] sabine::acoustics::Error),
    /// Of responses.
    #[error(transparent)]
    Augment(#[from] sabine::augment::Error),
    /// Of the estimator.
    #[error(transparent)]
    Estimator(#[from] sabine::estimator::Error),
}
