//! The middle of an octave, by a filter of zero phase that is no one else's.

use sabine_acoustics::Bands;
use sabine_acoustics::RealTransforms;

/// A sixteenth of an octave is missing at each end of the octave; then the gain rises over an eighth.
const MISSING: f64 = 0.0625;
const RISE: f64 = 0.125;

fn gain(bands: Bands, band: usize, frequency_hz: f64) -> f64 {
    let (low, high) = bands.edges_hz(band);
    let inside = (frequency_hz / low).log2().min((high / frequency_hz).log2()) - MISSING;
    0.5 - 0.5 * (std::f64::consts::PI * (inside / RISE).clamp(0.0, 1.0)).cos()
}

/// Samples with only the middle of an octave left.
pub fn middle_of_octave(samples: &[f64], sample_rate_hz: u32, bands: Bands, band: usize) -> Vec<f64> {
    let size = (2 * samples.len()).next_power_of_two();
    let RealTransforms { forward, inverse } = RealTransforms::<f64>::new(size);
    let mut padded = samples.to_vec();
    padded.resize(size, 0.0);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut padded, &mut spectrum).unwrap();
    for (i, value) in spectrum.iter_mut().enumerate() {
        *value *= gain(bands, band, i as f64 * f64::from(sample_rate_hz) / size as f64) / size as f64;
    }
    let mut output = inverse.make_output_vec();
    inverse.process(&mut spectrum, &mut output).unwrap();
    output.truncate(samples.len());
    output
}

#[allow(dead_code)] // not every test that filters asks how widely
/// Integrals of the gain's second and fourth power over frequency, in Hz.
pub fn widths_hz(bands: Bands, band: usize) -> (f64, f64) {
    let (low, high) = bands.edges_hz(band);
    let step = (high - low) / 4000.0;
    let squares = (0..4000).map(|i| gain(bands, band, low + (f64::from(i) + 0.5) * step).powi(2));
    squares.fold((0.0, 0.0), |(two, four), g| (two + g * step, four + g * g * step))
}
