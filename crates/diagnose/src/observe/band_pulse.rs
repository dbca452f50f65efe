//! What an octave filter does to a pulse: over which times it spreads the energy, and how alike it leaves two of them.

use sabine_acoustics::{Bands, Error, FilterBank};

/// Width of the cells in which sampled paths are gathered, in seconds.
pub(crate) const CELL_S: f64 = 1e-3;
/// Ringing to either side that is kept, in units of one over the bandwidth: what is left out is below -50 dB.
const REACH_BANDWIDTH_TIMES: f64 = 6.0;

/// The pulse response of one octave filter of the measurement, squared.
#[derive(Clone, Debug)]
pub(crate) struct BandPulse {
    /// Energy before each sample, the pulse being in the middle; ends at 1.
    cumulative: Vec<f64>,
    half: usize,
    rate_hz: f64,
    /// Width of the octave.
    pub bandwidth_hz: f64,
    /// Squared samples of the filtered unit pulse, summed.
    pub energy: f64,
    /// Share of the energy of a flat spectrum that the filter takes from each octave, its own and its neighbours'; what lies beyond
    /// the outer octaves counts as theirs.
    pub shares: Vec<f64>,
    /// Squared correlation of two pulses so many samples apart.
    squared: Vec<f64>,
    /// Mean squared correlation of two pulses that lie in cells so far apart.
    pub cell_correlation: Vec<f64>,
}

impl BandPulse {
    /// The kernels of all bands; `cell_s` is the width of the cells of [`BandPulse::cell_correlation`].
    pub fn all(bands: Bands, rate_hz: u32, cell_s: f64) -> Result<Vec<Self>, Error> {
        let (low, high) = bands.edges_hz(0);
        let rate = f64::from(rate_hz);
        let half = (REACH_BANDWIDTH_TIMES / (high - low) * rate).ceil() as usize;
        let mut pulse = vec![0.0f32; 2 * half + 1];
        pulse[half] = 1.0;
        let bank = FilterBank::new(bands, rate_hz)?;
        let filtered = bank.analyse(&pulse);
        Ok(filtered
            .values()
            .iter()
            .enumerate()
            .map(|(band, h)| {
                let (low_hz, high_hz) = bands.edges_hz(band);
                Self::new(h, rate, cell_s, bank.shares(band).values().to_vec(), high_hz - low_hz)
            })
            .collect())
    }

    fn new(pulse: &[f32], rate_hz: f64, cell_s: f64, shares: Vec<f64>, bandwidth_hz: f64) -> Self {
        let h: Vec<f64> = pulse.iter().copied().map(f64::from).collect();
        let energy: f64 = h.iter().map(|x| x * x).sum();
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        cumulative.extend(h.iter().map(|x| {
            sum += x * x / energy;
            sum
        }));
        let cell = (cell_s * rate_hz).max(1.0);
        // Beyond the reach of the ringing nothing is alike.
        let reach = h.len() / 2;
        let squared: Vec<f64> = (0..reach)
            .map(|lag| {
                let product: f64 = h.iter().zip(&h[lag..]).map(|(a, b)| a * b).sum();
                (product / energy).powi(2)
            })
            .collect();
        let cells = (reach as f64 / cell).ceil() as usize + 2;
        // Two times, each anywhere in its cell: their distance is triangular about that of the cells.
        let cell_correlation = (0..cells)
            .map(|apart| {
                let centre = apart as f64 * cell;
                let from = (centre - cell).ceil() as i64;
                (from..=(centre + cell) as i64)
                    .map(|lag| {
                        let r = squared.get(lag.unsigned_abs() as usize).copied().unwrap_or(0.0);
                        r * (1.0 - (lag as f64 - centre).abs() / cell).max(0.0) / cell
                    })
                    .sum()
            })
            .collect();
        Self { cumulative, half: reach, rate_hz, bandwidth_hz, energy, shares, squared, cell_correlation }
    }

    /// Share of the energy of a pulse at time zero that comes before `time_s`.
    pub fn before(&self, time_s: f64) -> f64 {
        let at = time_s * self.rate_hz + self.half as f64 + 0.5;
        if at <= 0.0 {
            return 0.0;
        }
        let index = at as usize;
        match self.cumulative.get(index + 1) {
            Some(next) => {
                let low = self.cumulative[index];
                low + (next - low) * (at - index as f64)
            }
            None => 1.0,
        }
    }

    /// Squared correlation of two pulses so far apart in time.
    pub fn correlation_sq(&self, apart_s: f64) -> f64 {
        let at = apart_s.abs() * self.rate_hz;
        let index = at as usize;
        match (self.squared.get(index), self.squared.get(index + 1)) {
            (Some(low), Some(high)) => low + (high - low) * (at - index as f64),
            _ => 0.0,
        }
    }

    /// How far the ringing reaches to either side, in seconds.
    pub fn reach_s(&self) -> f64 {
        self.half as f64 / self.rate_hz
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn the_energy_of_a_pulse_lies_about_its_instant() {
        let bands = Bands::octaves(500.0, 1000.0).unwrap();
        for kernel in BandPulse::all(bands, 16000, 1e-3).unwrap() {
            assert!((kernel.before(0.0) - 0.5).abs() < 1e-6);
            assert!(kernel.before(-kernel.reach_s()) < 1e-4 && kernel.before(kernel.reach_s()) > 1.0 - 1e-4);
            assert!(kernel.before(0.002) > 0.8);
        }
    }

    #[test]
    fn likeness_adds_up_to_one_over_twice_the_bandwidth() {
        // Parseval: the squared autocorrelation of a flat band of width B integrates to 1 / (2 B).
        let bands = Bands::octaves(1000.0, 1000.0).unwrap();
        let kernel = &BandPulse::all(bands, 48000, 1e-3).unwrap()[0];
        let integral: f64 =
            1e-3 * (kernel.cell_correlation[0] + 2.0 * kernel.cell_correlation[1..].iter().sum::<f64>());
        let (low, high) = bands.edges_hz(0);
        assert!((integral * 2.0 * (high - low) - 1.0).abs() < 0.25, "{integral}");
    }

    #[test]
    fn most_of_an_octave_is_its_own() {
        let bands = Bands::T60;
        for (band, kernel) in BandPulse::all(bands, 48000, 1e-3).unwrap().iter().enumerate() {
            assert!(kernel.shares[band] > 0.85, "{:?}", kernel.shares);
            assert!((kernel.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(kernel.shares.iter().enumerate().all(|(b, s)| b.abs_diff(band) < 2 || *s < 1e-3));
        }
    }
}
