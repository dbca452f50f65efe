//! Settings of all renderers.

use crate::error::Error;
use sabine_acoustics::OutOfRange;

/// How the noise behaves whose course the sampled paths give.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Statistics {
    /// Gaussian noise: the fluctuations that a diffuse sound field has. In narrow bands they make every measured decay
    /// time a random number (Davy et al. 1979), several percent wide at 125 Hz.
    Gaussian,
    /// The same noise, its energy in each octave corrected over short windows (six independent values, at least 15 ms) to
    /// what the paths say, so that what is measured on the response is what was simulated.
    #[default]
    DecayMatched,
}

/// Settings of [`PressureRenderer`](crate::PressureRenderer).
#[derive(Clone, Debug, PartialEq)]
pub struct RenderConfig {
    /// Sample rate, 8 to 96 kHz. Octaves that lie above half of it are left out.
    pub sample_rate_hz: u32,
    /// Length of the response, 1 ms to 60 s from emission; `None` for as long as paths were looked for.
    pub duration_s: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// Behaviour of the noise.
    pub statistics: Statistics,
}

impl Default for RenderConfig {
    fn default() -> Self {
        Self { sample_rate_hz: 48_000, duration_s: None, seed: 0, statistics: Statistics::default() }
    }
}

impl RenderConfig {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let rate = f64::from(self.sample_rate_hz);
        OutOfRange::check("sample_rate_hz", rate, 8e3, 96e3, "between 8 and 96 kHz")?;
        self.duration_s.map_or(Ok(()), |duration_s| {
            Ok(OutOfRange::check("duration_s", duration_s, 1e-3, 60.0, "between 1 ms and 60 s")?)
        })
    }
}
