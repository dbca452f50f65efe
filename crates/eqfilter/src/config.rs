//! Settings of a design.

use crate::Error;
use sabine_acoustics::{Bands, OutOfRange};

/// Settings of [`crate::EqFilter::design`] and its variants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EqFilterConfig {
    /// Delay of the linear-phase filter in seconds, 1 ms to 1 s; it has `2 round(delay_s * sample rate) + 1` taps and resolves
    /// about `1 / delay_s` Hz. The default is the paper's 32 ms.
    pub delay_s: f64,
    /// One level from some octave on. `None` lets the highest gain go on to half the sample rate.
    pub above: Option<AboveBand>,
}

/// A gain that all octaves from one on share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AboveBand {
    /// Nominal centre, in Hz, of the lowest of these octaves; it must lie above the highest band with a gain of its own.
    pub from_band_hz: f64,
    /// Their gain in dB, -120 to 120. It is not corrected for the slope of the filter at its lower edge.
    pub gain_db: f64,
}

impl Default for EqFilterConfig {
    fn default() -> Self {
        Self { delay_s: 0.032, above: None }
    }
}

impl EqFilterConfig {
    /// The setting of Tang et al. 2020, section 3.3: 32 ms, and -50 dB from the 8 kHz octave on.
    pub const PAPER: Self =
        Self { delay_s: 0.032, above: Some(AboveBand { from_band_hz: 8000.0, gain_db: -50.0 }) };

    /// Delay in samples, or why the settings do not go together.
    pub(crate) fn check(&self, bands: Bands, sample_rate_hz: u32) -> Result<usize, Error> {
        let rate = f64::from(sample_rate_hz);
        OutOfRange::check("sample_rate_hz", rate, 1e3, 768e3, "between 1 kHz and 768 kHz")?;
        OutOfRange::check("delay_s", self.delay_s, 1e-3, 1.0, "between 1 ms and 1 s")?;
        if let Some(above) = self.above {
            OutOfRange::check("above.gain_db", above.gain_db, -120.0, 120.0, "between -120 and 120 dB")?;
            let highest_hz = bands.nominal_hz(bands.len() - 1);
            let from = Bands::octaves(above.from_band_hz, above.from_band_hz)?;
            if from.nominal_hz(0) <= highest_hz {
                return Err(Error::AboveOverlaps { from_hz: above.from_band_hz, band_hz: highest_hz });
            }
        }
        if bands.exact_hz(0) >= rate / 2.0 {
            return Err(Error::NothingBelowNyquist { band_hz: bands.nominal_hz(0), sample_rate_hz });
        }
        Ok((self.delay_s * rate).round() as usize)
    }
}
