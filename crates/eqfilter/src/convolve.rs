//! Convolution of whole signals.

use crate::grid::fast_length;
use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;

/// Below this length of the shorter operand the plain sum is at least as fast as transforms.
const DIRECT: usize = 32;

/// The full linear convolution of two signals, `a.len() + b.len() - 1` samples; empty if either is.
///
/// The longer operand is cut into blocks that are transformed, multiplied and overlapped (overlap-add), in double precision; the
/// order of the operands does not matter.
///
/// ```
/// use sabine_eqfilter::convolve;
/// assert_eq!(convolve(&[1.0, 2.0], &[1.0, 0.0, -1.0]), [1.0, 2.0, -1.0, -2.0]);
/// ```
pub fn convolve(a: &[f32], b: &[f32]) -> Vec<f32> {
    let (long, short) = if a.len() >= b.len() { (a, b) } else { (b, a) };
    if short.is_empty() {
        return Vec::new();
    }
    let length = long.len() + short.len() - 1;
    if short.len() <= DIRECT {
        let mut out = vec![0.0_f64; length];
        for (i, &x) in long.iter().enumerate() {
            for (sum, &y) in out[i..].iter_mut().zip(short) {
                *sum += f64::from(x) * f64::from(y);
            }
        }
        return out.iter().map(|&x| x as f32).collect();
    }
    // Four times the shorter operand is near the best block; the whole in one transform if it fits.
    let size = fast_length(length.min(4 * short.len()));
    let block = size + 1 - short.len();
    let RealTransforms { forward, inverse: backward } = RealTransforms::<f64>::new(size);
    let mut time = vec![0.0; size];
    let mut spectrum = vec![Complex::default(); size / 2 + 1];
    let mut filter = spectrum.clone();
    let mut scratch = vec![Complex::default(); forward.get_scratch_len().max(backward.get_scratch_len())];
    fill(&mut time, short);
    let done =
        forward.process_with_scratch(&mut time, &mut filter, &mut scratch[..forward.get_scratch_len()]);
    debug_assert!(done.is_ok(), "lengths agree by construction");
    let scale = 1.0 / size as f64;
    let mut out = vec![0.0_f64; length];
    for (i, piece) in long.chunks(block).enumerate() {
        fill(&mut time, piece);
        let done =
            forward.process_with_scratch(&mut time, &mut spectrum, &mut scratch[..forward.get_scratch_len()]);
        debug_assert!(done.is_ok(), "lengths agree by construction");
        for (x, h) in spectrum.iter_mut().zip(&filter) {
            *x *= h * scale;
        }
        // Rounding leaves traces in these, which are zero for real signals.
        spectrum[0].im = 0.0;
        spectrum[size / 2].im = 0.0;
        let done = backward.process_with_scratch(
            &mut spectrum,
            &mut time,
            &mut scratch[..backward.get_scratch_len()],
        );
        debug_assert!(done.is_ok(), "a real signal's spectrum");
        for (sum, &x) in out[i * block..].iter_mut().zip(&time) {
            *sum += x;
        }
    }
    out.iter().map(|&x| x as f32).collect()
}

/// Copies samples and fills the rest with zeros.
fn fill(time: &mut [f64], samples: &[f32]) {
    for (to, &from) in time.iter_mut().zip(samples) {
        *to = f64::from(from);
    }
    time[samples.len()..].fill(0.0);
}
