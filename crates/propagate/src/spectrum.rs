//! Filtering by a real frequency response: zero phase, whole signals at once.

use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;

/// A transform of one length, planned once.
pub(crate) struct Spectrum {
    transforms: RealTransforms<f64>,
    length: usize,
    hz_per_line: f64,
}

impl Spectrum {
    /// At least `least` samples.
    pub fn new(least: usize, sample_rate_hz: u32) -> Self {
        let length = smooth_even(least.max(16));
        Self {
            transforms: RealTransforms::<f64>::new(length),
            length,
            hz_per_line: f64::from(sample_rate_hz) / length as f64,
        }
    }

    pub fn length(&self) -> usize {
        self.length
    }

    pub fn frequency_hz(&self, line: usize) -> f64 {
        line as f64 * self.hz_per_line
    }

    /// Lines of a signal of [`Spectrum::length`] samples.
    pub fn lines(&self, mut samples: Vec<f64>) -> Vec<Complex<f64>> {
        samples.resize(self.length, 0.0);
        let mut lines = self.transforms.forward.make_output_vec();
        // Lengths match by construction, the only thing that can fail.
        let done = self.transforms.forward.process(&mut samples, &mut lines);
        debug_assert!(done.is_ok());
        lines
    }

    /// The signal with these lines.
    pub fn signal(&self, mut lines: Vec<Complex<f64>>) -> Vec<f64> {
        // A real signal has real lines at both ends.
        lines[0].im = 0.0;
        lines[self.length / 2].im = 0.0;
        let mut samples = self.transforms.inverse.make_output_vec();
        let done = self.transforms.inverse.process(&mut lines, &mut samples);
        debug_assert!(done.is_ok());
        let scale = 1.0 / self.length as f64;
        samples.iter_mut().for_each(|s| *s *= scale);
        samples
    }

    /// The signal with these lines, each times `gain(frequency in Hz)`.
    pub fn filtered(&self, lines: &[Complex<f64>], gain: impl Fn(f64) -> f64) -> Vec<f64> {
        let scaled = lines.iter().enumerate().map(|(i, &line)| line * gain(self.frequency_hz(i)));
        self.signal(scaled.collect())
    }
}

/// The next even number that has no prime factor above 5.
fn smooth_even(least: usize) -> usize {
    let is_smooth = |mut n: usize| {
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    let mut length = least.next_multiple_of(2);
    while !is_smooth(length) {
        length += 2;
    }
    length
}
