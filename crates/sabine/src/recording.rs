//! Sound that somebody recorded: checked before anything is concluded from it.

use crate::Error;
use sabine_acoustics::Signal;

/// Below this peak a recording is silence: the least significant bit of 16-bit audio is 3e-5.
const SILENCE: f32 = 1e-4;
/// Shortest recording that is judged, in seconds.
const SHORTEST_S: f64 = 1.0;
/// Share of samples within flat tops from which a recording is refused: its decays are no longer those of the room.
const MOST_CLIPPED: f64 = 0.01;
/// Equal extreme samples in a row that make a flat top; two occur in clean low-frequency sound by chance.
const FLAT_TOP: usize = 3;

/// A recording with the name under which errors speak of it: usually its path.
#[derive(Clone, Copy, Debug)]
pub struct Recording<'a> {
    /// Name for messages.
    pub name: &'a str,
    /// The sound.
    pub signal: &'a Signal,
}

impl Recording<'_> {
    /// Share of samples that lie in flat tops at the recording's own extremes, if it can be used at all.
    ///
    /// # Errors
    /// [`Error::TooShort`] below one second, [`Error::Silent`], [`Error::Clipped`] where more than 1 % of the samples are cut off.
    pub fn check(&self) -> Result<f64, Error> {
        let recording = || self.name.to_owned();
        let duration_s = self.signal.duration_s();
        if duration_s < SHORTEST_S {
            return Err(Error::TooShort { recording: recording(), duration_s, needed_s: SHORTEST_S });
        }
        self.check_not_silent()?;
        let share = self.clipped_share();
        if share > MOST_CLIPPED {
            return Err(Error::Clipped { recording: recording(), percent: 100.0 * share });
        }
        Ok(share)
    }

    /// That there is any sound.
    ///
    /// # Errors
    /// [`Error::Silent`].
    pub fn check_not_silent(&self) -> Result<(), Error> {
        let peak = self.signal.peak();
        if peak < SILENCE { Err(Error::Silent { recording: self.name.to_owned(), peak }) } else { Ok(()) }
    }

    fn clipped_share(&self) -> f64 {
        // Converters and conversions cut just below full scale, too: what counts is a flat top at the extreme.
        let limit = 0.999 * self.signal.peak();
        let samples = self.signal.samples();
        let mut clipped = 0;
        let mut run = 0;
        for (i, &s) in samples.iter().enumerate() {
            let same_side = i > 0 && s.signum() == samples[i - 1].signum();
            run = if s.abs() < limit {
                0
            } else if same_side {
                run + 1
            } else {
                1
            };
            clipped += match run {
                0..FLAT_TOP => 0,
                FLAT_TOP => FLAT_TOP,
                _ => 1,
            };
        }
        clipped as f64 / samples.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tone(gain: f32, seconds: f32) -> Signal {
        let samples = (0..(seconds * 16e3) as usize)
            .map(|i| (gain * (i as f32 * 0.05).sin()).clamp(-1.0, 1.0))
            .collect();
        Signal::new(samples, 16_000).unwrap()
    }

    fn check(signal: &Signal) -> Result<f64, Error> {
        Recording { name: "test.wav", signal }.check()
    }

    #[test]
    fn a_clean_tone_passes_and_a_clipped_one_does_not() {
        assert_eq!(check(&tone(0.9, 2.0)).unwrap(), 0.0);
        assert!(matches!(check(&tone(3.0, 2.0)), Err(Error::Clipped { .. })));
    }

    #[test]
    fn short_and_silent_recordings_are_named() {
        assert!(
            matches!(check(&tone(0.5, 0.9)), Err(Error::TooShort { recording, .. }) if recording == "test.wav")
        );
        assert!(matches!(check(&tone(1e-5, 2.0)), Err(Error::Silent { .. })));
    }
}
