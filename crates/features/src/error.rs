//! What can go wrong when a transform is planned or given slices of the wrong length.

/// Errors of this crate; each names the offending field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range, or not finite.
    #[error("{field} is {value}; it must be {range}")]
    OutOfRange {
        /// Name of the setting, with its unit.
        field: &'static str,
        /// The value given.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// A mel band so narrow that no bin of the transform falls into it.
    #[error(
        "mel band {band} of {mels} holds no bin of a transform of {n_fft} samples: use fewer bands or a longer transform"
    )]
    EmptyMelBand {
        /// Index of the first such band.
        band: usize,
        /// Number of bands asked for.
        mels: usize,
        /// Transform length in samples.
        n_fft: usize,
    },
    /// A buffer whose length is not what the transform writes or reads.
    #[error("{what} has {found} values; {expected} are needed")]
    BufferLength {
        /// Which buffer.
        what: &'static str,
        /// Length needed.
        expected: usize,
        /// Length given.
        found: usize,
    },
}

/// Checks that a setting is finite and within `low..=high`.
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
