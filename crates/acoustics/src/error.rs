//! What can go wrong with vocabulary values, measures and sound files.
//!
//! Written out instead of derived: a derive would bring a parser of Rust into the build of every crate that needs no more than
//! bands and signals, and double the number of crates there.

#[cfg(feature = "audio")]
use crate::audio::kind::FileKind;
use crate::bands::Bands;
use crate::out_of_range::OutOfRange;
use crate::sweep_error::SweepError;
use std::fmt;
use std::path::PathBuf;

/// Errors of this crate; each names the offending field, and the file where there is one.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// Walls that absorb by the angle of incidence, and paths that do not know at which angle they meet them.
    AngleNotRecorded {
        /// Number of the material.
        material: usize,
    },
    /// A centre frequency that is not nominal.
    UnknownBand {
        /// The frequency asked for, in Hz.
        centre_hz: f64,
    },
    /// Band centres that do not rise octave by octave, or third by third.
    BandOrder {
        /// First centre, in Hz.
        first_hz: f64,
        /// Last centre, in Hz.
        last_hz: f64,
    },
    /// A list whose length is not the number of bands.
    BandCount {
        /// Number of bands.
        expected: usize,
        /// Number of values.
        found: usize,
    },
    /// Quantities of different runs of bands were combined.
    BandMismatch {
        /// Bands of the left operand.
        left: Bands,
        /// Bands of the right operand.
        right: Bands,
    },
    /// Sounds that belong together and have different sample rates.
    SampleRates {
        /// Sample rate of the first, in Hz.
        left_hz: u32,
        /// Sample rate of the other, in Hz.
        right_hz: u32,
    },
    /// A recording of a sweep that is no measurement.
    Sweep(SweepError),
    /// A number outside its physical range, or not finite.
    OutOfRange(OutOfRange),
    /// No samples, no vertices, no triangles, ...
    Empty {
        /// What is empty.
        what: &'static str,
    },
    /// A sample that is NaN or infinite.
    NotFinite {
        /// Which signal.
        what: &'static str,
        /// Index of the first such sample.
        index: usize,
    },
    /// An index that points past the end of what it indexes.
    Index {
        /// What is indexed.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A name that nothing has.
    UnknownId {
        /// The name.
        id: String,
    },
    /// A list of materials that does not match the scene or the paths.
    MaterialCount {
        /// Number of materials of the scene.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// The caller's observer asked to stop.
    Cancelled {
        /// The stage that was under way.
        stage: String,
    },
    /// A file that cannot be opened, read or written.
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// Something wrong in a field of a file: the cause says what.
    InFile {
        /// The file.
        path: PathBuf,
        /// The field, as a person would look for it: `materials.wall.absorption`, `line 12`, `samples`.
        field: String,
        /// What is wrong with it.
        source: Box<Error>,
    },
    /// A folder, a named pipe or a device where a file is needed.
    NotAFile {
        /// Its name.
        path: PathBuf,
        /// What it is, in words.
        found: &'static str,
    },
    /// A file that is no sound, or sound in a format that is not read.
    #[cfg(feature = "audio")]
    AudioKind {
        /// The file.
        path: PathBuf,
        /// What its first bytes, or its header, say that it is.
        found: FileKind,
    },
    /// An audio file that contradicts itself, breaks off or holds what cannot be decoded.
    #[cfg(feature = "audio")]
    AudioFormat {
        /// The file.
        path: PathBuf,
        /// The decoder's cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An audio file that ends before the samples that its header promises.
    #[cfg(feature = "audio")]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes of samples that the header promises.
        promised_bytes: u64,
        /// Length of the file.
        file_bytes: u64,
    },
    /// A file of several channels where one was expected.
    #[cfg(feature = "audio")]
    ManyChannels {
        /// The file.
        path: PathBuf,
        /// Number of channels in the file.
        channels: usize,
    },
    /// A list of the wrong length.
    Length {
        /// Number wanted.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// Speech, music or several measurements where one impulse response was expected.
    #[cfg(feature = "audio")]
    NotAResponse {
        /// Times that the level rises by 10 dB to within 20 dB of the loudest.
        bursts: usize,
        /// Length of the sound in seconds.
        duration_s: f64,
    },
    /// A material that the library does not hold.
    UnknownMaterial {
        /// The name asked for.
        name: String,
        /// The names of the library that are most like it, the nearest first.
        nearest: Vec<&'static str>,
    },
    /// An implementation of one of the traits failed.
    Implementation {
        /// Which stage failed.
        what: &'static str,
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownBand { centre_hz } => {
                write!(
                    f,
                    "{centre_hz} Hz is not a nominal centre of an octave (31.5, 63, 125, ... 16000) or third octave (25, 31.5, 40, ... 20000)"
                )
            }
            Self::BandOrder { first_hz, last_hz } => {
                write!(f, "bands from {first_hz} to {last_hz} Hz are not a contiguous rising run")
            }
            Self::BandCount { expected, found } => {
                write!(f, "{found} values for {expected} bands")
            }
            Self::BandMismatch { left, right } => {
                write!(
                    f,
                    "cannot combine {} bands from {} Hz with {} bands from {} Hz",
                    left.len(),
                    left.nominal_hz(0),
                    right.len(),
                    right.nominal_hz(0)
                )
            }
            Self::SampleRates { left_hz, right_hz } => {
                write!(f, "sample rates of {left_hz} Hz and {right_hz} Hz; they must be the same")
            }
            Self::Sweep(inner) => inner.fmt(f),
            Self::OutOfRange(inner) => inner.fmt(f),
            Self::Empty { what } => {
                write!(f, "{what} is empty")
            }
            Self::NotFinite { what, index } => {
                write!(f, "{what}: sample {index} is not finite")
            }
            Self::Index { what, index, count } => {
                write!(f, "{what} {index} does not exist; there are {count}")
            }
            Self::UnknownId { id } => write!(f, "there is no `{id}`"),
            Self::AngleNotRecorded { material } => write!(
                f,
                "absorption by angle is not known: the tracer did not record at which angle paths meet material {material}"
            ),
            Self::MaterialCount { expected, found } => {
                write!(f, "{found} materials given where {expected} are needed")
            }
            Self::Cancelled { stage } => {
                write!(f, "stopped on request during {stage}")
            }
            Self::Io { path, source } => {
                write!(f, "{}: {source}", path.display())
            }
            Self::InFile { path, field, source } => {
                write!(f, "{}: {field}: {source}", path.display())
            }
            Self::NotAFile { path, found } => {
                write!(f, "{}: is {found}; a file is needed", path.display())
            }
            #[cfg(feature = "audio")]
            Self::AudioKind { path, found } => {
                write!(
                    f,
                    "{}: this is {found}; sound is read from {}",
                    path.display(),
                    crate::audio::kind::READ_FORMATS
                )
            }
            #[cfg(feature = "audio")]
            Self::AudioFormat { path, source } => {
                write!(f, "{}: {source}", path.display())
            }
            #[cfg(feature = "audio")]
            Self::Truncated { path, promised_bytes, file_bytes } => {
                write!(
                    f,
                    "{}: truncated: the header promises {promised_bytes} bytes of samples, the file has {file_bytes} in all",
                    path.display()
                )
            }
            #[cfg(feature = "audio")]
            Self::ManyChannels { path, channels } => {
                write!(
                    f,
                    "{}: {channels} channels where one is needed: choose one, counted from 0, or their mean",
                    path.display()
                )
            }
            Self::Length { expected, found } => {
                write!(f, "{found} values; there must be {expected}")
            }
            #[cfg(feature = "audio")]
            Self::NotAResponse { bursts, duration_s } => {
                write!(
                    f,
                    "no impulse response: {bursts} bursts of sound in {duration_s:.1} s, where a response has one onset and a decay. Speech is for `sabine estimate`; several responses in one file must be cut apart"
                )
            }
            Self::UnknownMaterial { name, nearest } => {
                write!(
                    f,
                    "the material library has no `{name}`; the nearest names are {}",
                    nearest.join(", ")
                )
            }
            Self::Implementation { what, source } => {
                write!(f, "{what}: {source}")
            }
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            Self::InFile { source, .. } => Some(source.as_ref()),
            #[cfg(feature = "audio")]
            Self::AudioFormat { source, .. } => Some(source.as_ref()),
            Self::Implementation { source, .. } => Some(source.as_ref()),
            _ => None,
        }
    }
}

impl From<OutOfRange> for Error {
    fn from(error: OutOfRange) -> Self {
        Self::OutOfRange(error)
    }
}

impl From<SweepError> for Error {
    fn from(error: SweepError) -> Self {
        Self::Sweep(error)
    }
}

impl Error {
    /// Names the file and the field in which this error arose.
    #[must_use]
    pub fn in_file(self, path: impl Into<PathBuf>, field: impl Into<String>) -> Self {
        Self::InFile { path: path.into(), field: field.into(), source: Box::new(self) }
    }

    /// Wraps the error of a trait's implementation.
    pub fn implementation(
        what: &'static str,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        Self::Implementation { what, source: source.into() }
    }
}
