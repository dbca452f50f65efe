//! Octave bands of a response, by one long Fourier transform.

use sabine_acoustics::Bands;
use sabine_acoustics::RealTransforms;
use std::f64::consts::{FRAC_PI_2, PI};

/// What adds up to one across the bands.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Complement {
    /// Amplitudes: for the same arrivals in every band.
    Amplitude,
    /// Powers: for independent arrivals in each band.
    Power,
}

/// Filters each band's impulses by its octave and adds them up; zero phase, the outer bands reaching to 0 Hz and to Nyquist.
pub(crate) fn join_bands(
    bands: Bands,
    columns: Vec<Vec<f64>>,
    sample_rate_hz: u32,
    complement: Complement,
) -> Vec<f64> {
    let n = columns.first().map_or(0, Vec::len);
    // Half as long again: the filters' ringing must not wrap around to the beginning.
    let size = (n + n / 2 + 4096).next_power_of_two();
    let RealTransforms { forward, inverse } = RealTransforms::<f64>::new(size);
    let mut sum = forward.make_output_vec();
    for (band, mut column) in columns.into_iter().enumerate() {
        column.resize(size, 0.0);
        let mut spectrum = forward.make_output_vec();
        // The plan made both buffers: their lengths agree.
        let _ = forward.process(&mut column, &mut spectrum);
        for (i, (total, value)) in sum.iter_mut().zip(&spectrum).enumerate() {
            let frequency_hz = i as f64 * f64::from(sample_rate_hz) / size as f64;
            let amplitude = gain(bands, band, frequency_hz);
            *total += value * if complement == Complement::Amplitude { amplitude } else { amplitude.sqrt() };
        }
    }
    // Without imaginary parts at the ends, as the inverse demands.
    if let (Some(first), Some(last)) = (sum.first().copied(), sum.last().copied()) {
        let end = sum.len() - 1;
        sum[0] = first.re.into();
        sum[end] = last.re.into();
    }
    let mut output = inverse.make_output_vec();
    let _ = inverse.process(&mut sum, &mut output);
    output.truncate(n);
    output.iter_mut().for_each(|s| *s /= size as f64);
    output
}

/// Raised cosine over an octave to each side of the centre.
fn gain(bands: Bands, band: usize, frequency_hz: f64) -> f64 {
    let octaves = (frequency_hz / bands.exact_hz(band)).log2();
    let (lowest, highest) = (band == 0, band + 1 == bands.len());
    if (lowest && octaves < 0.0) || (highest && octaves > 0.0) {
        1.0
    } else if octaves.abs() >= 1.0 {
        0.0
    } else {
        (FRAC_PI_2 * octaves).cos().powi(2)
    }
}

/// Half the length of a pulse, in samples.
const HALF: usize = 32;

/// A pulse of amplitude 1 at any instant: the sample at which it begins (perhaps before the first), and a windowed sinc.
pub(crate) fn pulse(at: f64) -> (i64, [f64; 2 * HALF]) {
    let first = at.floor() as i64 - HALF as i64 + 1;
    let start = first as f64 - at;
    // From sample to sample the sine only changes its sign, and the window's angle goes on by the same step.
    let mut sine = (PI * start).sin() / PI;
    let (mut im, mut re) = (PI * start / HALF as f64).sin_cos();
    let (step_im, step_re) = (PI / HALF as f64).sin_cos();
    let value = |i: usize| {
        let x = start + i as f64;
        let sinc = if x.abs() < 1e-9 { 1.0 } else { sine / x };
        let window = 0.5 + 0.5 * re;
        sine = -sine;
        (re, im) = (re * step_re - im * step_im, re * step_im + im * step_re);
        sinc * window
    };
    (first, std::array::from_fn(value))
}

/// Adds a pulse of an amplitude at any instant, by a windowed sinc 64 samples long. What falls outside is left out.
pub(crate) fn add_pulse(samples: &mut [f64], at: f64, amplitude: f64) {
    let (first, values) = pulse(at);
    for (i, value) in (first..).zip(values) {
        if let Some(sample) = usize::try_from(i).ok().and_then(|i| samples.get_mut(i)) {
            *sample += amplitude * value;
        }
    }
}
