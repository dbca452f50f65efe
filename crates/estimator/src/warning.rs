//! What a listener should know about an estimate.

use crate::detectors::Sound;
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
    /// There is noise and no speech in it.
    NoiseAlone,
    /// It sounds like music.
    Music,
    /// A telephone, a codec or a low sample rate has left nothing of the treble.
    BandLimited,
    /// More than one person seems to speak at a time.
    SeveralTalkers,
    /// The room seems to be more reverberant than those that were trained on: estimates stay below what is true.
    LongDecay {
        /// Longest reverberation time at 1 kHz that was trained on, in seconds.
        high_s: f64,
    },
    /// The speech seems to have no room around it.
    Dry,
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
            Self::NoiseAlone => f.write_str(
                "noise without speech: record somebody who speaks, nearer to the microphone than now",
            ),
            Self::Music => f.write_str("music rather than speech: the network knows speech alone; record somebody who speaks"),
            Self::BandLimited => f.write_str(
                "hardly anything above 4 to 5.5 kHz: a telephone, a codec or a low sample rate; octaves there are guessed, and the others suffer: record at 16 kHz or more without compression",
            ),
            Self::SeveralTalkers => f.write_str(
                "several people seem to speak at once: record one after another, and combine the recordings",
            ),
            Self::LongDecay { high_s } => write!(
                f,
                "the room seems to be more reverberant than the {high_s:.1} s that were trained on: reverberation times are too short; measure an impulse response"
            ),
            Self::Dry => f.write_str(
                "the speech seems to have no room around it: a booth, or a microphone close to the mouth; move it away",
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

/// Warnings of what was heard. Noise and music say all: what else seems to be there is not to be relied on; a clipped voice sounds
/// like several, and so does one without high octaves.
pub(crate) fn of_sounds(heard: &[Sound], clipped: bool, high_s: f64) -> Vec<Warning> {
    let warning = |sound: &Sound| match sound {
        Sound::Noise => Warning::NoiseAlone,
        Sound::Music => Warning::Music,
        Sound::Telephone | Sound::BandLimited => Warning::BandLimited,
        Sound::SeveralTalkers => Warning::SeveralTalkers,
        Sound::LongDecay => Warning::LongDecay { high_s },
        Sound::Dry => Warning::Dry,
    };
    if let Some(sound) = [Sound::Noise, Sound::Music].iter().find(|sound| heard.contains(sound)) {
        return vec![warning(sound)];
    }
    let distorted =
        clipped || [Sound::Telephone, Sound::BandLimited].iter().any(|sound| heard.contains(sound));
    let relied_on = heard.iter().filter(|sound| !(distorted && **sound == Sound::SeveralTalkers));
    let mut warnings: Vec<Warning> = relied_on.map(warning).collect();
    warnings.dedup();
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_and_music_say_all_and_a_telephone_is_said_once() {
        let said = |heard: &[Sound], clipped| of_sounds(heard, clipped, 2.5);
        assert_eq!(said(&[Sound::Music, Sound::SeveralTalkers, Sound::LongDecay], false), [Warning::Music]);
        assert_eq!(said(&[Sound::Telephone, Sound::BandLimited], false), [Warning::BandLimited]);
        assert_eq!(said(&[Sound::Telephone, Sound::SeveralTalkers], false), [Warning::BandLimited]);
        let both = [Sound::SeveralTalkers, Sound::LongDecay];
        assert_eq!(said(&both, true), [Warning::LongDecay { high_s: 2.5 }]);
        assert_eq!(said(&both, false).len(), 2);
    }
}
