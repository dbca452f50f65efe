//! The spectrum of a padded signal, filtered by gains at frequencies.

use crate::transforms::RealTransforms;
use realfft::num_complex::Complex;
use std::cell::RefCell;
use std::collections::HashMap;

/// Plans that a thread keeps, a megabyte or two each.
const MOST_PLANS: usize = 32;

thread_local! {
    /// Plans made so far: planning a length costs more than transforming it.
    static PLANS: RefCell<HashMap<usize, RealTransforms<f64>>> = RefCell::new(HashMap::new());
}

/// The plan of a length, the same on every thread.
fn plan(length: usize) -> RealTransforms<f64> {
    PLANS.with(|plans| {
        let mut plans = plans.borrow_mut();
        if plans.len() >= MOST_PLANS && !plans.contains_key(&length) {
            plans.clear();
        }
        plans.entry(length).or_insert_with(|| RealTransforms::<f64>::new(length)).clone()
    })
}

/// Spectrum of a real signal followed by silence.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    bins: Vec<Complex<f64>>,
    samples: usize,
    transform_len: usize,
    bin_hz: f64,
}

impl Spectrum {
    /// Transforms `samples` with at least `padding_s` of silence after them.
    pub(crate) fn new(samples: &[f64], sample_rate_hz: u32, padding_s: f64) -> Self {
        let padding = (padding_s * f64::from(sample_rate_hz)).ceil() as usize;
        Self::with_length(samples, sample_rate_hz, fast_len(samples.len() + padding))
    }

    /// Transforms `samples` with silence after them up to a length that [`fast_len`] gave, at least their own.
    pub(crate) fn with_length(samples: &[f64], sample_rate_hz: u32, transform_len: usize) -> Self {
        let rate = f64::from(sample_rate_hz);
        let forward = plan(transform_len).forward;
        let mut padded = samples.to_vec();
        padded.resize(transform_len, 0.0);
        let mut bins = forward.make_output_vec();
        // Fails only for buffers of the wrong length, and these were made for the plan.
        let done = forward.process(&mut padded, &mut bins);
        debug_assert!(done.is_ok());
        Self { bins, samples: samples.len(), transform_len, bin_hz: rate / transform_len as f64 }
    }

    /// The signal filtered by a real gain, which is evaluated (and taken as not zero) within `support_hz` only.
    pub(crate) fn filtered(&self, support_hz: (f64, f64), gain: impl Fn(f64) -> f64) -> Vec<f64> {
        let inverse = plan(self.transform_len).inverse;
        let mut product = inverse.make_input_vec();
        let scale = 1.0 / self.transform_len as f64;
        for i in self.range(support_hz) {
            product[i] = self.bins[i] * (scale * gain(i as f64 * self.bin_hz));
        }
        // A real signal has no imaginary part at zero and at half the sample rate.
        product[0].im = 0.0;
        if self.transform_len.is_multiple_of(2) {
            product[self.transform_len / 2].im = 0.0;
        }
        let mut output = inverse.make_output_vec();
        let done = inverse.process(&mut product, &mut output);
        debug_assert!(done.is_ok());
        output.truncate(self.samples);
        output
    }

    /// The whole transform back in time, after each bin and its frequency in Hz went through `change`: sounds of negative time
    /// stand at the end.
    pub(crate) fn changed(&self, change: impl Fn(usize, f64, Complex<f64>) -> Complex<f64>) -> Vec<f64> {
        let inverse = plan(self.transform_len).inverse;
        let mut product = inverse.make_input_vec();
        let scale = 1.0 / self.transform_len as f64;
        for (i, bin) in self.bins.iter().enumerate() {
            product[i] = change(i, i as f64 * self.bin_hz, *bin) * scale;
        }
        // A real signal has no imaginary part at zero and at half the sample rate.
        product[0].im = 0.0;
        product[self.transform_len / 2].im = 0.0;
        let mut output = inverse.make_output_vec();
        let done = inverse.process(&mut product, &mut output);
        debug_assert!(done.is_ok());
        output
    }

    /// The bins with their frequencies in Hz.
    pub(crate) fn bins(&self) -> impl Iterator<Item = (f64, Complex<f64>)> + '_ {
        self.bins.iter().enumerate().map(|(i, bin)| (i as f64 * self.bin_hz, *bin))
    }

    /// Sum of the products of the samples of two signals of one length, both filtered by a gain: with itself, the energy.
    pub(crate) fn product(&self, other: &Self, support_hz: (f64, f64), gain: impl Fn(f64) -> f64) -> f64 {
        debug_assert_eq!(self.transform_len, other.transform_len);
        let sum: f64 = self
            .range(support_hz)
            .map(|i| {
                // Every bin stands for itself and its mirror image, but for the two ends.
                let ends = i == 0 || 2 * i == self.transform_len;
                let (a, b) = (self.bins[i], other.bins[i]);
                let product = (a.re * b.re + a.im * b.im) * gain(i as f64 * self.bin_hz).powi(2);
                if ends { product } else { 2.0 * product }
            })
            .sum();
        sum / self.transform_len as f64
    }

    fn range(&self, support_hz: (f64, f64)) -> std::ops::Range<usize> {
        let last = self.bins.len() as f64;
        let low = (support_hz.0 / self.bin_hz).floor().clamp(0.0, last) as usize;
        let high = ((support_hz.1 / self.bin_hz).ceil() + 1.0).clamp(0.0, last) as usize;
        low..high
    }
}

/// The next even length whose only prime factors are 2, 3 and 5.
pub(crate) fn fast_len(least: usize) -> usize {
    let mut best = least.max(2).next_power_of_two();
    for threes_and_fives in [3, 5, 9, 15, 25, 27, 45, 75, 81, 125, 135, 225] {
        let mut candidate = 2 * threes_and_fives;
        while candidate < least {
            candidate *= 2;
        }
        best = best.min(candidate);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_that_of_the_filtered_samples() {
        let samples: Vec<f64> = (0..500).map(|i| (f64::from(i) * 0.7).sin() + 0.1).collect();
        let spectrum = Spectrum::new(&samples, 8000, 0.5);
        let all = (0.0, f64::INFINITY);
        let direct: f64 = samples.iter().map(|x| x * x).sum();
        assert!((spectrum.product(&spectrum, all, |_| 1.0) / direct - 1.0).abs() < 1e-12);
        for (x, y) in samples.iter().zip(spectrum.filtered(all, |_| 1.0)) {
            assert!((x - y).abs() < 1e-12);
        }
    }

    #[test]
    fn lengths_are_fast_and_long_enough() {
        for least in [1, 2, 3, 1000, 28001, 100_000] {
            let len = fast_len(least);
            assert!(len >= least && len.is_multiple_of(2) && len <= 2 * least + 2, "{least}: {len}");
        }
    }
}
