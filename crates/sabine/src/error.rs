//! What can go wrong on the way from speech to a matched room.

/// Errors of this crate: each names the recording, the room's file or the stage.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A recording that is too short to be judged.
    #[error("{recording}: {duration_s:.2} s of sound; at least {needed_s} s are needed")]
    TooShort {
        /// Name of the recording.
        recording: String,
        /// Its length in seconds.
        duration_s: f64,
        /// Length needed, in seconds.
        needed_s: f64,
    },
    /// A recording without sound.
    #[error("{recording}: silent (peak {peak:e} of full scale)")]
    Silent {
        /// Name of the recording.
        recording: String,
        /// Largest magnitude.
        peak: f32,
    },
    /// A recording whose peaks are cut off.
    #[error(
        "{recording}: clipped ({percent:.1} % of the samples are cut off): record it again at a lower level"
    )]
    Clipped {
        /// Name of the recording.
        recording: String,
        /// Share of samples in flat tops, in percent.
        percent: f64,
    },
    /// No path leads from the source to the receiver.
    #[error(
        "no path reaches receiver \"{receiver}\" from source \"{source_id}\": is one of them closed off?"
    )]
    NoPath {
        /// The source.
        source_id: String,
        /// The receiver.
        receiver: String,
    },
    /// The vocabulary, a measure or a file.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// A room that cannot be read, or materials that do not fit it.
    #[error(transparent)]
    Scene(#[from] sabine_scene::Error),
    /// The equalisation filter.
    #[error(transparent)]
    EqFilter(#[from] sabine_eqfilter::Error),
    /// The estimator.
    #[error(transparent)]
    Estimator(#[from] sabine_estimator::Error),
    /// The tracer or the renderer.
    #[error(transparent)]
    Propagate(#[from] sabine_propagate::Error),
    /// The material fit.
    #[error(transparent)]
    Optimize(#[from] sabine_optimize::Error),
    /// A number that JSON cannot hold.
    #[error("summary: {0}")]
    Json(#[from] serde_json::Error),
}
