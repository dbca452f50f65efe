//! What a listener should know about an estimate.

use std::fmt;

/// A reason to trust an estimate less. `Display` says it in words.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The recording was brought to the sample rate of the network.
    Resampled {
        /// Its sample rate in Hz.
        from_hz: u32,
        /// That of the network in Hz.
        to_hz: u32,
    },
    /// The recording is shorter than a window; it was repeated to fill one.
    Short {
        /// Its length in seconds.
        duration_s: f64,
        /// Length of a window in seconds.
        window_s: f64,
    },
    /// Windows without speech, which do not count.
    Inactive {
        /// How many.
        windows: usize,
        /// Of how many.
        of: usize,
    },
    /// The tops of the waveform are cut off.
    Clipped {
        /// Share of the samples that lie on a flat top, 0..=1.
        share: f64,
    },
    /// The level hardly varies: more noise than speech.
    Noisy {
        /// Difference between loud and quiet frames in dB (95th and 5th percentile).
        range_db: f64,
    },
    /// A reverberation time at or beyond the edge of what was trained on: it may be cut off there.
    EdgeOfRange {
        /// Nominal centre of the octave in Hz.
        band_hz: f64,
        /// The estimate in seconds.
        t60_s: f64,
        /// Lower end of the range in seconds.
        low_s: f64,
        /// Upper end of the range in seconds.
        high_s: f64,
    },
    /// The sound is unlike the speech that was trained on.
    Unfamiliar {
        /// How far from it: root-mean-square of the standardised long-term statistics.
        novelty: f64,
        /// What one window in two hundred of the validation rooms exceeds.
        limit: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Resampled { from_hz, to_hz } => write!(f, "resampled from {from_hz} to {to_hz} Hz"),
            Self::Short { duration_s, window_s } => {
                write!(
                    f,
                    "the recording lasts {duration_s:.1} s; it was repeated to fill a window of {window_s:.1} s"
                )
            }
            Self::Inactive { windows, of } => write!(f, "{windows} of {of} windows hold no speech"),
            Self::Clipped { share } => {
                write!(f, "clipped: {:.2} % of the samples lie on flat tops", 100.0 * share)
            }
            Self::Noisy { range_db } => {
                write!(f, "noisy: loud and quiet moments differ by {range_db:.0} dB only")
            }
            Self::EdgeOfRange { band_hz, t60_s, low_s, high_s } => write!(
                f,
                "{band_hz} Hz: T60 of {t60_s:.2} s is at the edge of the {low_s:.2} to {high_s:.2} s that were trained on"
            ),
            Self::Unfamiliar { novelty, limit } => {
                write!(
                    f,
                    "unlike the speech that the network was trained on: its statistics are {novelty:.1} standard deviations away on average, those of 99.5 % of known recordings less than {limit:.1}"
                )
            }
        }
    }
}
