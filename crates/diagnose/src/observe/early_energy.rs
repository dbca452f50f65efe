//! Early energy of the bands in which single reflections can be told apart.

use sabine_acoustics::Bands;

/// Narrower bands are too slow for single reflections, in Hz: octaves from 2 kHz on are not, nor third octaves from 5 kHz on.
const MIN_WIDTH_HZ: f64 = 1000.0;

/// Squared samples of the octaves in which single reflections can be told apart, added up.
#[derive(Clone, Debug, Default)]
pub(crate) struct EarlySamples {
    /// Energy before each sample in each band, 1 for a pulse of amplitude 1; empty in a band that is not used.
    before: Vec<Vec<f64>>,
    /// The first sample, in seconds of the file.
    start_s: f64,
    rate_hz: f64,
}

impl EarlySamples {
    /// No samples at all.
    pub fn new(bands: usize, start_s: f64, rate_hz: f64) -> Self {
        Self { before: vec![Vec::new(); bands], start_s, rate_hz }
    }

    /// Adds the filtered samples of a band; `unit` is the energy of a filtered unit pulse.
    pub fn fill(&mut self, band: usize, filtered: &[f32], length_s: f64, unit: f64) {
        let first = (self.start_s * self.rate_hz).round().max(0.0) as usize;
        let count = (length_s * self.rate_hz) as usize;
        self.start_s = first as f64 / self.rate_hz;
        let mut sum = 0.0;
        self.before[band] = filtered
            .iter()
            .skip(first)
            .take(count)
            .map(|&x| {
                sum += f64::from(x).powi(2) / unit;
                sum
            })
            .collect();
    }

    /// Energy within so long before and after an instant of the file; none where there are no samples.
    pub fn gate(&self, band: usize, at_s: f64, half_s: f64) -> Option<f64> {
        let until = |time_s: f64| {
            let at = (time_s - self.start_s) * self.rate_hz - 0.5;
            let index = at.floor();
            if index < 0.0 {
                return None;
            }
            let (low, high) =
                (self.before[band].get(index as usize)?, self.before[band].get(index as usize + 1)?);
            Some(low + (high - low) * (at - index))
        };
        Some(until(at_s + half_s)? - until(at_s - half_s)?)
    }
}

/// Whether a band lets single reflections be told apart.
pub(crate) fn is_fast(bands: Bands, band: usize) -> bool {
    let (low_hz, high_hz) = bands.edges_hz(band);
    high_hz - low_hz >= MIN_WIDTH_HZ
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_holds_the_energy_of_its_samples() {
        let mut early = EarlySamples::new(1, 0.01, 1000.0);
        early.fill(0, &[1.0; 100], 0.05, 2.0);
        // Ten samples of one half.
        assert!(early.gate(0, 0.03, 0.005).is_some_and(|e| (e - 5.0).abs() < 1e-9));
        assert!(early.gate(0, 0.01, 0.005).is_none());
    }
}
