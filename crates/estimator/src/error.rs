//! What can go wrong in estimation and training.

use std::path::PathBuf;

/// Errors of this crate; each names the file and the field where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The recording has a lower sample rate than the network was trained on: the upper octaves are not in it.
    #[error("the recording has {found_hz} Hz; the network needs at least {needed_hz} Hz")]
    SampleRate {
        /// Sample rate of the recording, in Hz.
        found_hz: u32,
        /// Sample rate of the network, in Hz.
        needed_hz: u32,
    },
    /// The recording is too short to hear a room in it.
    #[error("the recording lasts {duration_s:.2} s; at least {needed_s:.2} s are needed")]
    TooShort {
        /// Its length, in seconds.
        duration_s: f64,
        /// The least length, in seconds.
        needed_s: f64,
    },
    /// The recording holds no sound.
    #[error("the recording is silent: its peak is {peak:.1e} of full scale")]
    Silent {
        /// Largest magnitude; full scale is 1.
        peak: f32,
    },
    /// There is nothing to join.
    #[error("there are no recordings to combine")]
    NoRecordings,
    /// The weights do not say how recordings of one room are joined, or what they say is no distribution.
    #[error(
        "the weights do not say how recordings of one room are combined: `combination` is missing or no distribution"
    )]
    NoCombination,
    /// The recording is beyond anything that is sound.
    #[error("the recording's peak is {peak:.1e} of full scale; at most 1e10 (200 dB) can be heard")]
    TooLoud {
        /// Largest magnitude; full scale is 1.
        peak: f32,
    },
    /// A sample of a stream that is no number.
    #[error("sample {index} of the stream is not a finite number")]
    NotFinite {
        /// Its place in the stream, from 0.
        index: u64,
    },
    /// A setting outside its range.
    #[error("{field} is {value}; it must be {range}")]
    Config {
        /// The setting.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// Weights that cannot be used.
    #[error("weights {name}: {fault}")]
    Weights {
        /// The file, or what stands for it.
        name: String,
        /// What is wrong with them.
        #[source]
        fault: Box<WeightsFault>,
    },
    /// A data set that cannot be used.
    #[error("{}: {fault}", path.display())]
    Dataset {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        #[source]
        fault: Box<DatasetFault>,
    },
    /// A checkpoint that belongs to another training.
    #[error("{}: `{field}` of the checkpoint differs from that of this training", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// The setting that differs.
        field: &'static str,
    },
    /// The loss is no longer a number. The last good checkpoint is kept.
    #[error("the loss became {loss} in epoch {epoch}, step {step}; the last good checkpoint is kept")]
    Diverged {
        /// Epoch, from 1.
        epoch: usize,
        /// Step in the epoch, from 1.
        step: usize,
        /// The loss found.
        loss: f64,
    },
    /// A file that cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The tensor library failed.
    #[error("tensor operation: {source}")]
    Tensor {
        /// The cause.
        #[from]
        source: candle_core::Error,
    },
    /// A vocabulary value that cannot be, or a request to stop.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
}

impl Error {
    pub(crate) fn dataset(path: impl Into<PathBuf>, fault: DatasetFault) -> Self {
        Self::Dataset { path: path.into(), fault: Box::new(fault) }
    }

    pub(crate) fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, source }
    }
}

impl From<Error> for sabine_acoustics::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Acoustics(error) => error,
            Error::Io { path, source } => Self::Io { path, source },
            other => Self::implementation("estimator", other),
        }
    }
}

/// Why weights are refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsFault {
    /// The container is truncated or damaged.
    #[error("not a whole safetensors file: {source}")]
    Container {
        /// The cause.
        #[from]
        source: safetensors::SafeTensorError,
    },
    /// The file was damaged after it was written.
    #[error("damaged: SHA-256 of its contents is {found}; it was written with {expected}")]
    Checksum {
        /// As found.
        found: String,
        /// As the file has it.
        expected: String,
    },
    /// Nothing says whether the file is as it was written: older versions wrote none.
    #[error(
        "there is no checksum in it; `cargo run -p sabine-estimator --example add_checksum -- FILE` adds one to a file that is known to be good"
    )]
    NoChecksum,
    /// A tensor is missing.
    #[error("tensor `{tensor}` is missing")]
    Missing {
        /// Its name.
        tensor: String,
    },
    /// A tensor is of another shape or number type than the network needs.
    #[error("tensor `{tensor}` is {found_type} {found:?} where {expected:?} floats are needed")]
    Shape {
        /// Its name.
        tensor: String,
        /// Number type found.
        found_type: String,
        /// Shape found.
        found: Vec<usize>,
        /// Shape needed.
        expected: Vec<usize>,
    },
    /// A weight that is NaN or infinite.
    #[error("tensor `{tensor}` holds a number that is not finite, at {index}")]
    NotFinite {
        /// Its name.
        tensor: String,
        /// Index of the first.
        index: usize,
    },
    /// A field of the metadata is missing or cannot be read.
    #[error("metadata `{field}` is missing or cannot be read")]
    Metadata {
        /// The field.
        field: &'static str,
    },
    /// No extractor can give the features that the weights ask for.
    #[error("no such features: {source}")]
    Features {
        /// The cause.
        source: sabine_features::Error,
    },
    /// The weights were made for other features, bands or another format.
    #[error("`{field}` is {found}; this program needs {expected}")]
    Layout {
        /// What differs.
        field: &'static str,
        /// As the weights have it.
        found: String,
        /// As this program has it.
        expected: String,
    },
}

/// Why a data set is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetFault {
    /// The manifest is not JSON of the expected form.
    #[error("not a manifest of a data set: {source}")]
    Manifest {
        /// The cause.
        #[from]
        source: serde_json::Error,
    },
    /// A field differs from what the network needs.
    #[error("`{field}` is {found}; {expected} is needed")]
    Field {
        /// The field.
        field: &'static str,
        /// As found.
        found: String,
        /// As needed.
        expected: String,
    },
    /// A shard whose hash is not that of the manifest.
    #[error("SHA-256 is {found}; the manifest says {expected}")]
    Hash {
        /// As found.
        found: String,
        /// As the manifest has it.
        expected: String,
    },
    /// The container is truncated or damaged.
    #[error("not a whole safetensors file: {source}")]
    Container {
        /// The cause.
        #[from]
        source: safetensors::SafeTensorError,
    },
    /// A tensor is missing or of another shape.
    #[error("tensor `{tensor}` is {found}; {expected} is needed")]
    Tensor {
        /// Its name.
        tensor: &'static str,
        /// As found.
        found: String,
        /// As needed.
        expected: String,
    },
    /// A feature that is NaN or infinite.
    #[error("clip {clip}: a feature is not finite")]
    NotFinite {
        /// Index of the clip in the shard.
        clip: usize,
    },
    /// Too few rooms to hold some out.
    #[error("{found} room(s) in partition `{partition}`; at least {needed} are needed")]
    Rooms {
        /// The partition.
        partition: &'static str,
        /// Rooms found.
        found: usize,
        /// Rooms needed.
        needed: usize,
    },
    /// Rooms or speakers that occur in training and in another partition: the errors would flatter.
    #[error("{what} {index} is in partitions `{first}` and `{second}`")]
    Leak {
        /// `room` or `speaker`.
        what: &'static str,
        /// Its index.
        index: i64,
        /// One partition.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A band in which not one clip has a label.
    #[error("not one clip of partition `{partition}` has a label `{label}`")]
    NoLabels {
        /// The partition.
        partition: &'static str,
        /// The label.
        label: String,
    },
}
