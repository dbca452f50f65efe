//! A response taken apart into octaves that add up to it again.

use crate::Error;
use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealToComplex};
use sabine_acoustics::{Bands, RealTransforms};
use std::sync::Arc;

/// Half the width of the cross-over between two bands, in octaves.
const HALF_CROSSOVER_OCTAVES: f64 = 0.25;

/// Splits into octaves without phase, by weights on the spectrum that sum to one at every frequency: the bands add up to
/// the input exactly (to rounding). The lowest band reaches down to 0 Hz, the highest up to half the sample rate.
///
/// The cross-overs are raised cosines half an octave wide, so the bands are **not** the filters of IEC 61260-1: measure
/// with [`sabine_acoustics::FilterBank`], change with this.
pub(crate) struct BandSplit {
    weights: Vec<Vec<f32>>,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    length: usize,
}

impl BandSplit {
    /// For signals of up to `samples` samples, padded so that what a band filter smears does not wrap around.
    pub(crate) fn new(bands: Bands, samples: usize, sample_rate_hz: u32) -> Self {
        let length = (samples + samples / 16 + 64).next_power_of_two();
        let RealTransforms { forward, inverse } = RealTransforms::<f32>::new(length);
        let bins = length / 2 + 1;
        let hz = |bin: usize| bin as f64 * f64::from(sample_rate_hz) / length as f64;
        let weights = (0..bands.len())
            .map(|band| {
                let (low_hz, high_hz) = bands.edges_hz(band);
                (0..bins)
                    .map(|bin| {
                        let rise = if band == 0 { 1.0 } else { step(hz(bin), low_hz) };
                        let fall = if band + 1 == bands.len() { 0.0 } else { step(hz(bin), high_hz) };
                        (rise - fall) as f32
                    })
                    .collect()
            })
            .collect();
        Self { weights, forward, inverse, length }
    }

    /// Number of bands.
    pub(crate) fn bands(&self) -> usize {
        self.weights.len()
    }

    /// Weights of a band on the bins of the spectrum.
    pub(crate) fn weights(&self, band: usize) -> &[f32] {
        &self.weights[band]
    }

    /// Number of points of the transform.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    /// Unnormalised spectrum of `samples`, padded with zeros.
    pub(crate) fn spectrum(&self, samples: &[f32]) -> Result<Vec<Complex32>, Error> {
        let mut padded = vec![0.0; self.length];
        padded[..samples.len()].copy_from_slice(samples);
        let mut spectrum = self.forward.make_output_vec();
        self.forward.process(&mut padded, &mut spectrum)?;
        Ok(spectrum)
    }

    /// The first `samples` samples of the signal with this spectrum.
    pub(crate) fn signal(&self, mut spectrum: Vec<Complex32>, samples: usize) -> Result<Vec<f32>, Error> {
        let mut signal = self.inverse.make_output_vec();
        // The imaginary parts at 0 Hz and half the rate are zero for a real signal; rounding may leave a trace.
        if let Some(first) = spectrum.first_mut() {
            first.im = 0.0;
        }
        if let Some(last) = spectrum.last_mut() {
            last.im = 0.0;
        }
        self.inverse.process(&mut spectrum, &mut signal)?;
        signal.truncate(samples);
        let scale = 1.0 / self.length as f32;
        signal.iter_mut().for_each(|s| *s *= scale);
        Ok(signal)
    }
}

/// 0 below a cross-over, 1 above it, a raised cosine in log frequency between.
fn step(hz: f64, edge_hz: f64) -> f64 {
    if hz <= 0.0 {
        return 0.0;
    }
    let position = ((hz / edge_hz).log2() / HALF_CROSSOVER_OCTAVES).clamp(-1.0, 1.0);
    0.5 * (1.0 + (std::f64::consts::FRAC_PI_2 * position).sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bands_of(split: &BandSplit, samples: &[f32]) -> Vec<Vec<f32>> {
        let spectrum = split.spectrum(samples).unwrap();
        (0..split.bands())
            .map(|band| {
                let weighted = spectrum.iter().zip(split.weights(band)).map(|(s, w)| s * w).collect();
                split.signal(weighted, samples.len()).unwrap()
            })
            .collect()
    }

    #[test]
    fn the_bands_add_up_to_the_input() {
        let samples: Vec<f32> =
            (0..5000).map(|i| ((i * i) as f32 * 0.37).sin() * (-(i as f32) / 900.0).exp()).collect();
        let split = BandSplit::new(Bands::SIMULATION, samples.len(), 16_000);
        let bands = bands_of(&split, &samples);
        assert_eq!(bands.len(), 8);
        for (i, &s) in samples.iter().enumerate() {
            let sum: f32 = bands.iter().map(|b| b[i]).sum();
            assert!((sum - s).abs() < 2e-6, "sample {i}: {sum} != {s}");
        }
    }

    #[test]
    fn a_tone_lands_in_its_octave() {
        let samples: Vec<f32> =
            (0..8000).map(|i| (i as f32 * 1000.0 * std::f32::consts::TAU / 16e3).sin()).collect();
        let split = BandSplit::new(Bands::SIMULATION, samples.len(), 16_000);
        let bands = bands_of(&split, &samples);
        let energy = |b: &[f32]| b[1000..7000].iter().map(|s| s * s).sum::<f32>();
        let total: f32 = bands.iter().map(|b| energy(b)).sum();
        assert!(energy(&bands[4]) > 0.999 * total);
    }
}
