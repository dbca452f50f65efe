//! Frequency responses that share the spectrum out among bands.

use sabine_acoustics::Bands;
use std::f64::consts::PI;

/// Decades in an octave of base ten (IEC 61260-1, 5.2).
const DECADES_PER_OCTAVE: f64 = 0.3;
/// Width of the steep transition, in widths of a band.
const STEEP: f64 = 1.0 / 6.0;
/// Order of the measuring filters: as Butterworth band passes of this order in each flank.
const MEASURING_ORDER: i32 = 6;

/// How the gain goes from one band's value to the next one's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Transition {
    /// All the way from centre to centre, along a raised cosine over the logarithm of frequency: a reflection rings as
    /// little as its spectrum permits.
    Gliding,
    /// Within a sixth of a band's width about its edge: the noise of a band hardly enters its neighbour.
    Steep,
}

/// The bands that reach below half the sample rate. Shares add up to one at every frequency; the lowest band extends down
/// to 0 Hz, the highest up to half the sample rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BandMasks {
    bands: Bands,
    used: usize,
    nyquist_hz: f64,
}

impl BandMasks {
    pub fn new(bands: Bands, sample_rate_hz: u32) -> Self {
        let nyquist_hz = 0.5 * f64::from(sample_rate_hz);
        let used = (0..bands.len()).filter(|&i| bands.edges_hz(i).0 < nyquist_hz).count();
        Self { bands, used, nyquist_hz }
    }

    /// Number of bands below half the sample rate.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Width of a band in Hz, as far as it lies below half the sample rate.
    pub fn width_hz(&self, band: usize) -> f64 {
        let (low, high) = self.bands.edges_hz(band);
        high.min(self.nyquist_hz) - low
    }

    /// Share of band `band` at a frequency.
    pub fn share(&self, band: usize, frequency_hz: f64, transition: Transition) -> f64 {
        let last = self.used - 1;
        let octaves = (frequency_hz.max(1e-3) / self.bands.exact_hz(0)).log10() / DECADES_PER_OCTAVE;
        let place = (octaves * self.bands.per_octave() as f64).clamp(0.0, last as f64);
        let lower = (place.floor() as usize).min(last);
        if band != lower && band != lower + 1 {
            return 0.0;
        }
        let width = match transition {
            Transition::Gliding => 1.0,
            Transition::Steep => STEEP,
        };
        let turn = ((place - lower as f64 - 0.5) / width + 0.5).clamp(0.0, 1.0);
        let upper_share = 0.5 - 0.5 * (PI * turn).cos();
        if band == lower { 1.0 - upper_share } else { upper_share }
    }

    /// Magnitude of a measuring filter (-3 dB at the band edges, IEC 61260-1, 5.4), without phase.
    pub fn measuring(&self, band: usize, frequency_hz: f64) -> f64 {
        let (low, high) = self.bands.edges_hz(band);
        let frequency = frequency_hz.max(1e-3);
        let detuning = (frequency * frequency - low * high) / (frequency * (high - low));
        1.0 / (1.0 + detuning.powi(2 * MEASURING_ORDER)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_to_one_and_stand_alone_at_the_centres() {
        for bands in [Bands::SIMULATION, Bands::third_octaves(50.0, 10_000.0).unwrap()] {
            for rate in [8_000, 11_025, 48_000, 96_000] {
                let masks = BandMasks::new(bands, rate);
                for transition in [Transition::Gliding, Transition::Steep] {
                    for step in 0..2000 {
                        let hz = f64::from(step) * f64::from(rate) / 4000.0;
                        let sum: f64 = (0..masks.len()).map(|b| masks.share(b, hz, transition)).sum();
                        assert!((sum - 1.0).abs() < 1e-12, "{rate} Hz, {hz} Hz");
                    }
                    for band in 0..masks.len() {
                        assert!((masks.share(band, bands.exact_hz(band), transition) - 1.0).abs() < 1e-12);
                    }
                }
            }
        }
    }

    #[test]
    fn bands_above_half_the_rate_are_dropped() {
        assert_eq!(BandMasks::new(Bands::SIMULATION, 8_000).len(), 7);
        assert_eq!(BandMasks::new(Bands::SIMULATION, 16_000).len(), 8);
        let high = Bands::octaves(8000.0, 16000.0).unwrap();
        assert_eq!(BandMasks::new(high, 8_000).len(), 0);
    }
}
