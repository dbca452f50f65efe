//! What a laboratory is asked for.

use sabine_acoustics::{Bands, Error, OutOfRange};
use sabine_scene::{Levels, TimeZero};

/// The room to draw and how it is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct LabConfig {
    /// Seed of everything random, below 2^63.
    pub seed: u64,
    /// Number of sources, 1 to 8.
    pub sources: usize,
    /// Number of receivers, 1 to 40.
    pub receivers: usize,
    /// Number of sessions, 1 to 4, each in air of its own, which is declared; receivers belong to them in turn.
    pub sessions: usize,
    /// Whether every source is measured again from the same place, turned to its left by a right angle: twice as many sources.
    pub turned: bool,
    /// Sample rate of the responses in Hz; the highest octave must lie below half of it.
    pub sample_rate_hz: u32,
    /// Octaves of the material tables and of the responses.
    pub bands: Bands,
    /// What is declared about the first sample. Unless it is the emission, latencies of 1 to 20 ms are at work.
    pub time_zero: TimeZero,
    /// What is declared about levels. Unless they are absolute, gains of -10 to 10 dB are at work.
    pub levels: Levels,
    /// Whether the sources' axes are declared.
    pub orientation: bool,
    /// Whether the microphones' axes are declared.
    pub microphone_axes: bool,
    /// Whether it is declared in which order the responses were recorded; each has a random place in it.
    pub recording_order: bool,
    /// Whether reflections keep the sign of the sound, as in most programs of image sources: they add in phase, and standing waves arise.
    /// Every image is summed then, which takes longer.
    pub positive_reflections: bool,
}

impl Default for LabConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            sources: 1,
            receivers: 12,
            sessions: 1,
            turned: false,
            sample_rate_hz: 48_000,
            bands: Bands::T60,
            time_zero: TimeZero::Emission,
            levels: Levels::Common,
            orientation: true,
            microphone_axes: false,
            recording_order: false,
            positive_reflections: false,
        }
    }
}

impl LabConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let rate = f64::from(self.sample_rate_hz);
        let highest = self.bands.edges_hz(self.bands.len() - 1).1;
        let checks = [
            ("seed", self.seed as f64, 0.0, i64::MAX as f64, "below 2^63"),
            ("sources", self.sources as f64, 1.0, 8.0, "between 1 and 8"),
            ("receivers", self.receivers as f64, 1.0, 40.0, "between 1 and 40"),
            ("sessions", self.sessions as f64, 1.0, 4.0, "between 1 and 4"),
            (
                "sample rate (Hz)",
                rate,
                2.0 * highest,
                192e3,
                "at least twice the highest band edge, at most 192 kHz",
            ),
        ];
        for (field, value, low, high, range) in checks {
            OutOfRange::check(field, value, low, high, range)?;
        }
        Ok(())
    }
}
