//! What can go wrong when a filter is designed or run.

/// Errors of this crate; each names the offending field.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range, or not finite.
    #[error("{field} is {}; it must be {range}", sabine_acoustics::Engineering(*value))]
    OutOfRange {
        /// Name of the setting, with its unit.
        field: &'static str,
        /// The value given.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// A gain that is not finite or beyond 120 dB.
    #[error("the gain at {band_hz} Hz is {} dB; it must be between -120 and 120 dB", sabine_acoustics::Engineering(*gain_db))]
    Gain {
        /// Nominal centre of the band in Hz.
        band_hz: f64,
        /// The gain given, in dB.
        gain_db: f64,
    },
    /// Gains for other bands than the designer was planned for.
    #[error(
        "the designer was planned for {planned} bands from {planned_first_hz} Hz; the gains are for {given} bands from {given_first_hz} Hz"
    )]
    Bands {
        /// Number of bands planned for.
        planned: usize,
        /// Lowest band planned for, in Hz.
        planned_first_hz: f64,
        /// Number of bands given.
        given: usize,
        /// Lowest band given, in Hz.
        given_first_hz: f64,
    },
    /// The level "above" was asked for from a band on that has a gain of its own.
    #[error(
        "one level is asked for from {from_hz} Hz on, yet the band at {band_hz} Hz has a gain of its own"
    )]
    AboveOverlaps {
        /// Lowest band of the common level, in Hz.
        from_hz: f64,
        /// Highest band with a gain of its own, in Hz.
        band_hz: f64,
    },
    /// Every band's centre lies beyond half the sample rate.
    #[error(
        "the centre of the lowest band, {band_hz} Hz, lies beyond half the sample rate of {sample_rate_hz} Hz"
    )]
    NothingBelowNyquist {
        /// The lowest band in Hz.
        band_hz: f64,
        /// The sample rate in Hz.
        sample_rate_hz: u32,
    },
    /// A signal at another sample rate than the filter.
    #[error("the filter is for {filter_hz} Hz, the signal is at {signal_hz} Hz")]
    SampleRate {
        /// Sample rate of the filter in Hz.
        filter_hz: u32,
        /// Sample rate of the signal in Hz.
        signal_hz: u32,
    },
    /// A response without samples, or one longer than the convolver was made for.
    #[error("the response has {found} samples; it must have between 1 and {most}")]
    ResponseLength {
        /// Longest response that fits.
        most: usize,
        /// Samples given.
        found: usize,
    },
    /// A response with a sample that is NaN or infinite.
    #[error("sample {index} of the response is not finite")]
    NotFinite {
        /// Index of the first such sample.
        index: usize,
    },
    /// A value of the vocabulary that cannot be built: a signal that overflowed, an unknown band.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
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

/// Checks that a response has between 1 and `most` samples, all of them finite.
pub(crate) fn check_taps(response: &[f32], most: usize) -> Result<(), Error> {
    if response.is_empty() || response.len() > most {
        return Err(Error::ResponseLength { most, found: response.len() });
    }
    match response.iter().position(|tap| !tap.is_finite()) {
        Some(index) => Err(Error::NotFinite { index }),
        None => Ok(()),
    }
}
