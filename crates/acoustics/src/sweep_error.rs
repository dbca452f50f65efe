//! Why a recording of a sweep is no measurement.

use std::fmt;

/// A recording that cannot be made into a response, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SweepError {
    /// Crests of the recording are cut off.
    Clipped {
        /// The channel, from 0.
        channel: usize,
        /// Magnitude at which they are cut off; full scale is 1.
        level: f64,
        /// Samples that stand there.
        samples: usize,
    },
    /// The recording ends before the last sweep and 0.1 s of reverberation have passed.
    TooShort {
        /// Length needed, in seconds.
        needed_s: f64,
        /// Length of the recording, in seconds.
        available_s: f64,
    },
    /// The recording begins after the sweep did.
    StartsLate {
        /// By how much, in seconds.
        late_s: f64,
    },
    /// The recording is silent.
    Silent,
    /// The recording is not one of this sweep: its octaves do not arrive together.
    Mismatch {
        /// Time from the first octave's arrival to the last one's, in seconds.
        spread_s: f64,
    },
    /// No sound stands out of the noise once the sweep is taken out.
    NoOnset,
    /// The clocks of playback and recording differ.
    ClockDrift {
        /// By how much the recording is longer than the playback, in parts per million.
        ppm: f64,
    },
    /// One repetition is not like the others.
    RepetitionDiffers {
        /// Which, from 0.
        repetition: usize,
        /// How far its difference from the others lies above theirs from each other, in dB; with two repetitions, above -26 dB
        /// of the response's energy.
        excess_db: f64,
    },
}

impl fmt::Display for SweepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clipped { channel, level, samples } => write!(
                f,
                "channel {channel} of the recording is clipped: {samples} samples stand at {level:.4} of full scale. Record at a lower level"
            ),
            Self::TooShort { needed_s, available_s } => write!(
                f,
                "the recording lasts {available_s:.2} s; the sweeps and 0.1 s of reverberation need {needed_s:.2} s"
            ),
            Self::StartsLate { late_s } => {
                write!(f, "the recording begins {late_s:.3} s after the sweep: start recording before playing")
            }
            Self::NoOnset => f.write_str(
                "no sound stands out of the noise once the sweep is taken out: not a recording of this sweep, or far too quiet",
            ),
            Self::Silent => f.write_str("the recording is silent"),
            Self::Mismatch { spread_s } => write!(
                f,
                "the recording is not one of this sweep: its octaves arrive over {spread_s:.3} s instead of together. Frequencies, length and sample rate must be those of the sweep that was played"
            ),
            Self::ClockDrift { ppm } => write!(
                f,
                "the clocks of playback and recording differ by {ppm:.1} parts per million. Play and record with one device, or synchronise their clocks"
            ),
            Self::RepetitionDiffers { repetition, excess_db } => write!(
                f,
                "repetition {} differs from the others, {excess_db:.1} dB above what is usual: a noise, or something moved",
                repetition + 1
            ),
        }
    }
}

impl std::error::Error for SweepError {}
