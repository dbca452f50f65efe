//! Noise that nobody recorded.

use crate::Error;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealToComplex};
use std::sync::Arc;

/// Stationary Gaussian noise whose power falls as 1 / f^s, s uniform in 0 to 2 (white to brown), flat below 40 Hz of 16 kHz.
///
/// Drawn in the frequency domain: independent complex Gaussians are the spectrum of Gaussian noise.
pub(crate) fn coloured_noise(
    rng: &mut Pcg64,
    samples: usize,
    forward: &Arc<dyn RealToComplex<f32>>,
    inverse: &Arc<dyn ComplexToReal<f32>>,
) -> Result<Vec<f32>, Error> {
    let slope: f32 = rng.random_range(0.0..2.0);
    let mut spectrum: Vec<Complex32> = forward.make_output_vec();
    let corner = 40.0 / 16_000.0 * inverse.len() as f32;
    for (bin, s) in spectrum.iter_mut().enumerate() {
        let gain = (bin as f32 / corner).max(1.0).powf(-0.5 * slope);
        *s = Complex32::new(StandardNormal.sample(rng), StandardNormal.sample(rng)) * gain;
    }
    let last = spectrum.len() - 1;
    spectrum[0] = Complex32::new(0.0, 0.0);
    spectrum[last].im = 0.0;
    let mut noise = inverse.make_output_vec();
    inverse.process(&mut spectrum, &mut noise)?;
    noise.truncate(samples);
    Ok(noise)
}
