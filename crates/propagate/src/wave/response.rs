//! What the wave solver found at a receiver.

use crate::Error;
use sabine_acoustics::ImpulseResponse;

/// Pressure at a receiver up to a frequency, with what its filter rings before time zero: near the source the direct sound is
/// wider than the time it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct WaveResponse {
    pub(crate) samples: Vec<f64>,
    /// Samples before time zero.
    pub(crate) lead: usize,
    pub(crate) sample_rate_hz: u32,
    pub(crate) limit_hz: f64,
}

impl WaveResponse {
    /// The response from time zero (the emission) on; 1 = direct sound at 1 m.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for samples that are not finite.
    pub fn response(&self) -> Result<ImpulseResponse, Error> {
        let samples = self.samples[self.lead..].iter().map(|&s| s as f32).collect();
        Ok(ImpulseResponse::new(samples, self.sample_rate_hz)?)
    }

    /// All samples, [`WaveResponse::lead`] of them before time zero.
    pub fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// Number of samples before time zero.
    pub fn lead(&self) -> usize {
        self.lead
    }

    /// Sample rate in Hz.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Up to where it is right, in Hz.
    pub fn limit_hz(&self) -> f64 {
        self.limit_hz
    }
}
