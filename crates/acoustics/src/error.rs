//! What can go wrong with vocabulary values and measures.

use crate::OctaveBands;
use std::path::PathBuf;

/// Errors of this crate; each names the offending field, and the file where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A centre frequency that is not a nominal octave centre.
    #[error("{centre_hz} Hz is not a nominal octave centre (31.5, 62.5, 125, ... 16000)")]
    UnknownBand {
        /// The frequency asked for, in Hz.
        centre_hz: f64,
    },
    /// Band centres that do not rise octave by octave.
    #[error("octave bands from {first_hz} to {last_hz} Hz are not a contiguous rising run")]
    BandOrder {
        /// First centre, in Hz.
        first_hz: f64,
        /// Last centre, in Hz.
        last_hz: f64,
    },
    /// A list whose length is not the number of bands.
    #[error("{found} values for {expected} bands")]
    BandCount {
        /// Number of bands.
        expected: usize,
        /// Number of values.
        found: usize,
    },
    /// Quantities of different runs of bands were combined.
    #[error("cannot combine {} bands from {} Hz with {} bands from {} Hz", left.len(), left.nominal_hz(0), right.len(), right.nominal_hz(0))]
    BandMismatch {
        /// Bands of the left operand.
        left: OctaveBands,
        /// Bands of the right operand.
        right: OctaveBands,
    },
    /// A number outside its physical range, or not finite.
    #[error("{field} is {value}; it must be {range}")]
    OutOfRange {
        /// What the number stands for, with its unit.
        field: &'static str,
        /// The number.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// No samples, no vertices, no triangles, ...
    #[error("{what} is empty")]
    Empty {
        /// What is empty.
        what: &'static str,
    },
    /// A sample that is NaN or infinite.
    #[error("{what}: sample {index} is not finite")]
    NotFinite {
        /// Which signal.
        what: &'static str,
        /// Index of the first such sample.
        index: usize,
    },
    /// An index that points past the end of what it indexes.
    #[error("{what} {index} does not exist; there are {count}")]
    Index {
        /// What is indexed.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A list of materials that does not match the scene or the paths.
    #[error("{found} materials given where {expected} are needed")]
    MaterialCount {
        /// Number of materials of the scene.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// The caller's observer asked to stop.
    #[error("stopped on request during {stage}")]
    Cancelled {
        /// The stage that was under way.
        stage: String,
    },
    /// A file that cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// An implementation of one of the traits failed.
    #[error("{what}: {source}")]
    Implementation {
        /// Which stage failed.
        what: &'static str,
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl Error {
    /// Wraps the error of a trait's implementation.
    pub fn implementation(
        what: &'static str,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        Self::Implementation { what, source: source.into() }
    }
}

/// Checks that a number is finite and within `low..=high`.
pub(crate) fn check_range(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), Error> {
    // Written so that NaN fails.
    if value >= low && value <= high { Ok(()) } else { Err(Error::OutOfRange { field, value, range }) }
}
