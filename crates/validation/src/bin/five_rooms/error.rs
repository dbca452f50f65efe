//! What can stand in the way.

use std::path::PathBuf;

/// Why the comparison could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Data that the table rests on are not there.
    #[error("{path}: there is no such file; --data names the folder of measured rooms")]
    Missing {
        /// What was looked for.
        path: PathBuf,
    },
    /// Nothing of a kind is left to work with.
    #[error("there is no {what}")]
    Nothing {
        /// What was looked for.
        what: String,
    },
    /// A file or folder cannot be written, read or removed.
    #[error("{path}: {source}")]
    Io {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Of the main job.
    #[error(transparent)]
    Match(#[from] sabine::Error),
    /// Of sounds and measures.
    #[error(transparent)]
    Acoustics(#[from] sabine::acoustics::Error),
    /// Of rooms.
    #[error(transparent)]
    Scene(#[from] sabine::scene::Error),
    /// Of tracing and rendering.
    #[error(transparent)]
    Propagate(#[from] sabine::propagate::Error),
    /// Of fits.
    #[error(transparent)]
    Optimize(#[from] sabine::optimize::Error),
    /// Of filters.
    #[error(transparent)]
    Filter(#[from] sabine::eqfilter::Error),
    /// Of data sets.
    #[error(transparent)]
    Augment(#[from] sabine::augment::Error),
    /// Of results.
    #[error(transparent)]
    Output(#[from] sabine_cli::output::OutputError),
    /// Of tables.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// Of charts.
    #[error("a chart cannot be drawn: {reason}")]
    Chart {
        /// Why, in words.
        reason: String,
    },
}
