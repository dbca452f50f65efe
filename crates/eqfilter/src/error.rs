//! What can go wrong when a filter is designed or run.

use sabine_acoustics::OutOfRange;
use std::fmt;

/// Errors of this crate; each names the offending field.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range, or not finite.
    OutOfRange(OutOfRange),
    /// A gain that is not finite or beyond 120 dB.
    Gain {
        /// Nominal centre of the band in Hz.
        band_hz: f64,
        /// The gain given, in dB.
        gain_db: f64,
    },
    /// Gains for other bands than the designer was planned for.
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
    AboveOverlaps {
        /// Lowest band of the common level, in Hz.
        from_hz: f64,
        /// Highest band with a gain of its own, in Hz.
        band_hz: f64,
    },
    /// Every band's centre lies beyond half the sample rate.
    NothingBelowNyquist {
        /// The lowest band in Hz.
        band_hz: f64,
        /// The sample rate in Hz.
        sample_rate_hz: u32,
    },
    /// A signal at another sample rate than the filter.
    SampleRate {
        /// Sample rate of the filter in Hz.
        filter_hz: u32,
        /// Sample rate of the signal in Hz.
        signal_hz: u32,
    },
    /// A response without samples, or one longer than the convolver was made for.
    ResponseLength {
        /// Longest response that fits.
        most: usize,
        /// Samples given.
        found: usize,
    },
    /// A response with a sample that is NaN or infinite.
    NotFinite {
        /// Index of the first such sample.
        index: usize,
    },
    /// Another number of responses than the pairs of input and output channels.
    Responses {
        /// Pairs of input and output channels.
        expected: usize,
        /// Responses given.
        found: usize,
    },
    /// A response at another sample rate than the reverb.
    ResponseRate {
        /// Sample rate of the reverb in Hz.
        reverb_hz: u32,
        /// Sample rate of the response in Hz.
        response_hz: u32,
    },
    /// Another number of channels than the reverb has.
    ChannelCount {
        /// "input" or "output".
        side: &'static str,
        /// Channels of the reverb.
        expected: usize,
        /// Channels given.
        found: usize,
    },
    /// Interleaved samples that do not make whole frames, or channels and buffers that differ in their number of frames.
    Frames {
        /// "input" or "output".
        side: &'static str,
        /// Samples that fit the first channel of the input.
        expected: usize,
        /// Samples given.
        found: usize,
    },
    /// A value of the vocabulary that cannot be built: a signal that overflowed, an unknown band.
    Acoustics(sabine_acoustics::Error),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange(error) => error.fmt(f),
            Self::Gain { band_hz, gain_db } => write!(
                f,
                "the gain at {band_hz} Hz is {} dB; it must be between -120 and 120 dB",
                sabine_acoustics::Engineering(*gain_db)
            ),
            Self::Bands { planned, planned_first_hz, given, given_first_hz } => write!(
                f,
                "the designer was planned for {planned} bands from {planned_first_hz} Hz; the gains are for {given} bands from {given_first_hz} Hz"
            ),
            Self::AboveOverlaps { from_hz, band_hz } => write!(
                f,
                "one level is asked for from {from_hz} Hz on, yet the band at {band_hz} Hz has a gain of its own"
            ),
            Self::NothingBelowNyquist { band_hz, sample_rate_hz } => write!(
                f,
                "the centre of the lowest band, {band_hz} Hz, lies beyond half the sample rate of {sample_rate_hz} Hz"
            ),
            Self::SampleRate { filter_hz, signal_hz } => {
                write!(f, "the filter is for {filter_hz} Hz, the signal is at {signal_hz} Hz")
            }
            Self::ResponseLength { most, found } => {
                write!(f, "the response has {found} samples; it must have between 1 and {most}")
            }
            Self::NotFinite { index } => write!(f, "sample {index} of the response is not finite"),
            Self::Responses { expected, found } => {
                write!(
                    f,
                    "{found} responses are given; there must be {expected}, one for each pair of input and output"
                )
            }
            Self::ResponseRate { reverb_hz, response_hz } => {
                write!(
                    f,
                    "the reverb runs at {reverb_hz} Hz, the response is at {response_hz} Hz; resample it first"
                )
            }
            Self::ChannelCount { side, expected, found } => {
                write!(f, "{found} {side} channels are given; the reverb has {expected}")
            }
            Self::Frames { side, expected, found } => {
                write!(f, "the {side} has {found} samples; it must have {expected}")
            }
            Self::Acoustics(error) => error.fmt(f),
        }
    }
}

impl From<OutOfRange> for Error {
    fn from(error: OutOfRange) -> Self {
        Self::OutOfRange(error)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Acoustics(error) => error.source(),
            _ => None,
        }
    }
}

impl From<sabine_acoustics::Error> for Error {
    fn from(error: sabine_acoustics::Error) -> Self {
        Self::Acoustics(error)
    }
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
