//! What a page is told when something is refused.

/// Errors of this crate; each says what to do where that is known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A sound or a value that is refused.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// A mesh, a place or a SOFA file that is refused.
    #[error(transparent)]
    Scene(#[from] sabine_scene::Error),
    /// Settings of the tracer, or a mesh that leaks.
    #[error(transparent)]
    Propagate(#[from] sabine_propagate::Error),
    /// What the diagnosis says.
    #[error(transparent)]
    Diagnose(#[from] sabine_diagnose::Error),
    /// A request that is no JSON of the documented form.
    #[error("request: {0}")]
    Json(#[from] serde_json::Error),
    /// A file without bytes.
    #[error("{name}: the file is empty")]
    EmptyFile {
        /// The file.
        name: String,
    },
    /// A file larger than a page can hold.
    #[error("{name}: {bytes} bytes; at most {limit} are read here (the command sabine reads longer files)")]
    TooManyBytes {
        /// The file.
        name: String,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// A sound longer than any response.
    #[error(
        "{name}: this lasts {duration_s:.0} s; an impulse response of at most {limit_s:.0} s is read (music and speech are none)"
    )]
    TooLong {
        /// The file.
        name: String,
        /// Its length, or what was decoded of it, in seconds.
        duration_s: f64,
        /// The limit in seconds.
        limit_s: f64,
    },
    /// A sound of zeros.
    #[error("{name}: all samples are zero")]
    Silent {
        /// The file.
        name: String,
    },
    /// A sound that is no response.
    #[error("{name}: {source}")]
    NotAResponse {
        /// The file.
        name: String,
        /// Why.
        source: sabine_acoustics::Error,
    },
    /// A number of a response that a file does not have.
    #[error("response {index} does not exist; there are {count}")]
    NoSuchResponse {
        /// The number, from 0.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A room that is neither a box nor a mesh, or both.
    #[error("room: give either size_m (three lengths in metres) or obj (the text of an OBJ file)")]
    BoxOrMesh,
    /// A setting outside its range.
    #[error("{0}")]
    OutOfRange(#[from] sabine_acoustics::OutOfRange),
}
