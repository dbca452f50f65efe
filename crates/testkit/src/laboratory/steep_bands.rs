//! Octaves with steep crossovers: what decays slowly in one octave does not show in its neighbours.

use realfft::num_complex::Complex;
use sabine_acoustics::Bands;
use sabine_acoustics::RealTransforms;
use std::f64::consts::FRAC_PI_2;

/// Width of a crossover in octaves.
const CROSSOVER_OCTAVES: f64 = 0.125;
/// Silence after the samples, in seconds: the ringing of the lowest crossover must not wrap around to the beginning.
const PADDING_S: f64 = 0.4;

/// Filters each band's samples by its octave and adds them up. Zero phase; amplitudes add up to one at every frequency, the
/// outer bands reaching to 0 Hz and to Nyquist: what is the same in all bands passes unchanged.
pub(crate) fn join_steeply(bands: Bands, columns: Vec<Vec<f64>>, sample_rate_hz: u32) -> Vec<f64> {
    let n = columns.first().map_or(0, Vec::len);
    let size = padded(n, sample_rate_hz);
    let forward = RealTransforms::<f64>::new(size).forward;
    let mut sum = forward.make_output_vec();
    let mut spectrum = forward.make_output_vec();
    let gains = Gains { bands, bin_hz: f64::from(sample_rate_hz) / size as f64, bins: sum.len() };
    for (band, mut column) in columns.into_iter().enumerate() {
        column.resize(size, 0.0);
        // The plan made all buffers: their lengths agree.
        let _ = forward.process(&mut column, &mut spectrum);
        gains.for_each(band, |i, gain| sum[i] += spectrum[i] * gain);
    }
    invert(sum, size, n)
}

/// The same samples with an amplitude for each octave.
pub(crate) fn colour(
    bands: Bands,
    mut samples: Vec<f64>,
    amplitudes: &[f64],
    sample_rate_hz: u32,
) -> Vec<f64> {
    let n = samples.len();
    let size = padded(n, sample_rate_hz);
    let forward = RealTransforms::<f64>::new(size).forward;
    let mut sum = forward.make_output_vec();
    let mut spectrum = forward.make_output_vec();
    samples.resize(size, 0.0);
    let _ = forward.process(&mut samples, &mut spectrum);
    let gains = Gains { bands, bin_hz: f64::from(sample_rate_hz) / size as f64, bins: sum.len() };
    for (band, amplitude) in amplitudes.iter().enumerate() {
        gains.for_each(band, |i, gain| sum[i] += spectrum[i] * (gain * amplitude));
    }
    invert(sum, size, n)
}

fn padded(n: usize, sample_rate_hz: u32) -> usize {
    (n + (PADDING_S * f64::from(sample_rate_hz)) as usize).next_power_of_two()
}

fn invert(mut spectrum: Vec<Complex<f64>>, size: usize, n: usize) -> Vec<f64> {
    let inverse = RealTransforms::<f64>::new(size).inverse;
    // Without imaginary parts at the ends, as the inverse demands.
    let end = spectrum.len() - 1;
    spectrum[0].im = 0.0;
    spectrum[end].im = 0.0;
    let mut output = inverse.make_output_vec();
    let _ = inverse.process(&mut spectrum, &mut output);
    output.truncate(n);
    output.iter_mut().for_each(|s| *s /= size as f64);
    output
}

struct Gains {
    bands: Bands,
    bin_hz: f64,
    bins: usize,
}

impl Gains {
    /// Visits the bins in which a band's gain is not zero.
    fn for_each(&self, band: usize, mut visit: impl FnMut(usize, f64)) {
        let half = (0.5 * CROSSOVER_OCTAVES).exp2();
        let (lower, upper) = self.bands.edges_hz(band);
        let (lowest, highest) = (band == 0, band + 1 == self.bands.len());
        let from = if lowest { 0 } else { (lower / half / self.bin_hz) as usize };
        let to = if highest { self.bins } else { self.bins.min((upper * half / self.bin_hz) as usize + 2) };
        for i in from..to {
            visit(i, share(self.bands, band, i as f64 * self.bin_hz));
        }
    }
}

/// Gain of a band at a frequency.
fn share(bands: Bands, band: usize, frequency_hz: f64) -> f64 {
    let half = (0.5 * CROSSOVER_OCTAVES).exp2();
    let (lower, upper) = bands.edges_hz(band);
    let (lowest, highest) = (band == 0, band + 1 == bands.len());
    let rise = if lowest || frequency_hz > lower * half { 1.0 } else { step(frequency_hz, lower) };
    let fall = if highest || frequency_hz < upper / half { 1.0 } else { 1.0 - step(frequency_hz, upper) };
    rise * fall
}

/// The amplitude that [`join_steeply`] gives to a frequency, from one for each octave.
pub(crate) fn amplitude_at(bands: Bands, amplitudes: &[f64], frequency_hz: f64) -> f64 {
    amplitudes.iter().enumerate().map(|(band, a)| a * share(bands, band, frequency_hz)).sum()
}

/// From 0 below a crossover to 1 above it.
fn step(frequency_hz: f64, edge_hz: f64) -> f64 {
    let x = ((frequency_hz / edge_hz).log2() / CROSSOVER_OCTAVES + 0.5).clamp(0.0, 1.0);
    (FRAC_PI_2 * x).sin().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_bands_share_passes_unchanged() {
        let bands = Bands::T60;
        let mut click = vec![0.0; 6000];
        click[2000] = 1.0;
        let joined = join_steeply(bands, vec![click.clone(); bands.len()], 48000);
        assert!(joined.iter().zip(&click).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_band_alone_holds_its_share_of_the_energy() {
        let bands = Bands::T60;
        let mut click = vec![0.0; 96000];
        click[48000] = 1.0;
        for band in 1..bands.len() - 1 {
            let mut columns = vec![vec![0.0; click.len()]; bands.len()];
            columns[band].clone_from(&click);
            let energy: f64 = join_steeply(bands, columns, 48000).iter().map(|s| s * s).sum();
            let (low, high) = bands.edges_hz(band);
            // Each crossover loses a quarter of its width in each of the two bands it parts.
            let expected = (high - low) / 24000.0;
            assert!((energy / expected - 1.0).abs() < 0.05, "band {band}: {energy} for {expected}");
        }
    }
}
