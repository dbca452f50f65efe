//! What can go wrong when a transform is planned or given slices of the wrong length.

use sabine_acoustics::OutOfRange;
use std::fmt;

/// Errors of this crate; each names the offending field.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range, or not finite.
    OutOfRange(OutOfRange),
    /// A mel band so narrow that no bin of the transform falls into it.
    EmptyMelBand {
        /// Index of the first such band.
        band: usize,
        /// Number of bands asked for.
        mels: usize,
        /// Transform length in samples.
        n_fft: usize,
    },
    /// A buffer whose length is not what the transform writes or reads.
    BufferLength {
        /// Which buffer.
        what: &'static str,
        /// Length needed.
        expected: usize,
        /// Length given.
        found: usize,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange(error) => error.fmt(f),
            Self::EmptyMelBand { band, mels, n_fft } => write!(
                f,
                "mel band {band} of {mels} holds no bin of a transform of {n_fft} samples: use fewer bands or a longer transform"
            ),
            Self::BufferLength { what, expected, found } => {
                write!(f, "{what} has {found} values; {expected} are needed")
            }
        }
    }
}

impl From<OutOfRange> for Error {
    fn from(error: OutOfRange) -> Self {
        Self::OutOfRange(error)
    }
}

impl std::error::Error for Error {}
