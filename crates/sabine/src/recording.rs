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
        let peak = self.signal.peak();
        judge(self.name, self.signal.duration_s(), peak, || {
            let mut counter = ClipCounter::new(peak);
            counter.push(self.signal.samples());
            Ok(counter.share())
        })
    }

    /// That there is any sound.
    ///
    /// # Errors
    /// [`Error::Silent`].
    pub fn check_not_silent(&self) -> Result<(), Error> {
        check_not_silent(self.name, self.signal.peak())
    }
}

/// The share of clipped samples, if a recording can be used at all.
pub(crate) fn judge(
    name: &str,
    duration_s: f64,
    peak: f32,
    clipped_share: impl FnOnce() -> Result<f64, Error>,
) -> Result<f64, Error> {
    if duration_s < SHORTEST_S {
        return Err(Error::TooShort { recording: name.to_owned(), duration_s, needed_s: SHORTEST_S });
    }
    check_not_silent(name, peak)?;
    let share = clipped_share()?;
    if share > MOST_CLIPPED {
        return Err(Error::Clipped { recording: name.to_owned(), percent: 100.0 * share });
    }
    Ok(share)
}

pub(crate) fn check_not_silent(name: &str, peak: f32) -> Result<(), Error> {
    if peak < SILENCE { Err(Error::Silent { recording: name.to_owned(), peak }) } else { Ok(()) }
}

/// Counts samples in flat tops as they come in; the peak of the whole must be known.
pub(crate) struct ClipCounter {
    /// Converters and conversions cut just below full scale, too: what counts is a flat top at the extreme.
    limit: f32,
    before: f32,
    run: usize,
    clipped: u64,
    samples: u64,
}

impl ClipCounter {
    pub(crate) fn new(peak: f32) -> Self {
        Self { limit: 0.999 * peak, before: 0.0, run: 0, clipped: 0, samples: 0 }
    }

    pub(crate) fn push(&mut self, samples: &[f32]) {
        for &s in samples {
            let same_side = self.samples > 0 && s.signum() == self.before.signum();
            self.run = if s.abs() < self.limit {
                0
            } else if same_side {
                self.run + 1
            } else {
                1
            };
            self.clipped += match self.run {
                0..FLAT_TOP => 0,
                FLAT_TOP => FLAT_TOP as u64,
                _ => 1,
            };
            self.before = s;
            self.samples += 1;
        }
    }

    pub(crate) fn share(&self) -> f64 {
        self.clipped as f64 / self.samples.max(1) as f64
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
