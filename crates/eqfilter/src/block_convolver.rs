//! Convolution of a stream of any length with a whole response.

use crate::Error;
use crate::error::check_taps;
use crate::grid::fast_length;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};
use sabine_acoustics::RealTransforms;
use std::sync::Arc;

/// Shortest transform: shorter ones cost more a sample.
const SHORTEST: usize = 4096;

/// Convolves a stream with a response in portions of any size, offline: what comes out is, within rounding, what
/// [`convolve`](crate::convolve) makes of the whole, and memory is a few times that of the response however long the stream.
///
/// Overlap-add in double precision. Output lags behind the input by up to a block; [`BlockConvolver::finish`] gives the rest. For
/// live use there is [`PartitionedConvolver`](crate::PartitionedConvolver).
///
/// ```
/// use sabine_eqfilter::{BlockConvolver, convolve};
/// let response: Vec<f32> = (0..500).map(|n| (-(n as f32) / 90.0).exp() * (n as f32).sin()).collect();
/// let stream: Vec<f32> = (0..40_000).map(|n| (0.1 * n as f32).cos()).collect();
/// let mut convolver = BlockConvolver::new(&response)?;
/// let mut wet = Vec::new();
/// for portion in stream.chunks(1_234) {
///     convolver.push(portion, &mut wet);
/// }
/// convolver.finish(&mut wet);
/// let whole = convolve(&stream, &response);
/// assert_eq!(wet.len(), whole.len());
/// assert!(wet.iter().zip(&whole).all(|(a, b)| (a - b).abs() < 1e-5));
/// # Ok::<(), sabine_eqfilter::Error>(())
/// ```
pub struct BlockConvolver {
    taps: usize,
    /// Samples of input in a transform; the rest of it is room for the tail.
    block: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    backward: Arc<dyn ComplexToReal<f64>>,
    filter: Vec<Complex<f64>>,
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    time: Vec<f64>,
    /// Output from the first sample that was not yet given out.
    sum: Vec<f64>,
    waiting: Vec<f32>,
    taken: u64,
}

impl std::fmt::Debug for BlockConvolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BlockConvolver")
            .field("taps", &self.taps)
            .field("block", &self.block)
            .field("taken", &self.taken)
            .finish_non_exhaustive()
    }
}

impl BlockConvolver {
    /// Transforms the response.
    ///
    /// # Errors
    /// [`Error::ResponseLength`] for a response that is empty or longer than 2^28 samples, [`Error::NotFinite`].
    pub fn new(response: &[f32]) -> Result<Self, Error> {
        check_taps(response, 1 << 28)?;
        let size = fast_length((4 * response.len()).max(SHORTEST));
        let RealTransforms { forward, inverse: backward } = RealTransforms::<f64>::new(size);
        let empty = vec![Complex::default(); size / 2 + 1];
        let mut new = Self {
            taps: response.len(),
            block: size + 1 - response.len(),
            scratch: vec![Complex::default(); forward.get_scratch_len().max(backward.get_scratch_len())],
            forward,
            backward,
            filter: Vec::new(),
            spectrum: empty,
            time: vec![0.0; size],
            sum: vec![0.0; size],
            waiting: Vec::new(),
            taken: 0,
        };
        new.transform(response);
        new.filter = new.spectrum.iter().map(|bin| bin / size as f64).collect();
        Ok(new)
    }

    /// Takes samples and appends what they complete to `wet`.
    pub fn push(&mut self, samples: &[f32], wet: &mut Vec<f32>) {
        self.taken += samples.len() as u64;
        let mut rest = samples;
        while !rest.is_empty() {
            let (now, later) = rest.split_at((self.block - self.waiting.len()).min(rest.len()));
            self.waiting.extend_from_slice(now);
            rest = later;
            if self.waiting.len() == self.block {
                self.convolve_waiting();
                self.give(self.block, wet);
            }
        }
    }

    /// Appends what is left: all in all as many samples as were taken, and one less than the response has.
    pub fn finish(mut self, wet: &mut Vec<f32>) {
        if self.taken > 0 {
            let left = self.waiting.len() + self.taps - 1;
            self.convolve_waiting();
            self.give(left, wet);
        }
    }

    /// Adds the response to the samples that wait.
    fn convolve_waiting(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        self.transform(&waiting);
        self.waiting = waiting;
        self.waiting.clear();
        for (bin, filter) in self.spectrum.iter_mut().zip(&self.filter) {
            *bin *= filter;
        }
        // Rounding leaves traces in these, which are zero for real signals.
        self.spectrum[0].im = 0.0;
        if let (Some(last), 0) = (self.spectrum.last_mut(), self.time.len() % 2) {
            last.im = 0.0;
        }
        let scratch = &mut self.scratch[..self.backward.get_scratch_len()];
        let done = self.backward.process_with_scratch(&mut self.spectrum, &mut self.time, scratch);
        debug_assert!(done.is_ok(), "a real signal's spectrum");
        for (sum, &x) in self.sum.iter_mut().zip(&self.time) {
            *sum += x;
        }
    }

    fn transform(&mut self, samples: &[f32]) {
        for (to, &from) in self.time.iter_mut().zip(samples) {
            *to = f64::from(from);
        }
        self.time[samples.len()..].fill(0.0);
        let scratch = &mut self.scratch[..self.forward.get_scratch_len()];
        let done = self.forward.process_with_scratch(&mut self.time, &mut self.spectrum, scratch);
        debug_assert!(done.is_ok(), "lengths agree by construction");
    }

    fn give(&mut self, samples: usize, wet: &mut Vec<f32>) {
        wet.extend(self.sum[..samples].iter().map(|&x| x as f32));
        self.sum.copy_within(samples.., 0);
        let kept = self.sum.len() - samples;
        self.sum[kept..].fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact sums of small whole numbers, in portions that meet block ends in every way.
    #[test]
    fn it_is_the_plain_sum() {
        for (taps, length) in [(1, 1), (1, 9000), (7, 3), (40, 4056), (40, 4057), (1100, 15_000)] {
            let number = |n: usize, most: usize| (n * n * 7 % most) as f32 - (most / 2) as f32;
            let response: Vec<f32> = (0..taps).map(|n| number(n, 13)).collect();
            let stream: Vec<f32> = (0..length).map(|n| number(n, 17)).collect();
            for portion in [1, 997, length] {
                let mut convolver = BlockConvolver::new(&response).unwrap();
                let mut wet = Vec::new();
                stream.chunks(portion).for_each(|part| convolver.push(part, &mut wet));
                convolver.finish(&mut wet);
                assert_eq!(wet.len(), length + taps - 1);
                for n in (0..wet.len()).step_by(1 + wet.len() / 500) {
                    let from = (n + 1).saturating_sub(length);
                    let sum: f32 = (from..taps.min(n + 1)).map(|k| response[k] * stream[n - k]).sum();
                    assert!((wet[n] - sum).abs() < 1e-3, "{taps} taps, {length} samples, {n}: {}", wet[n]);
                }
            }
        }
    }

    #[test]
    fn nothing_in_is_nothing_out() {
        let mut wet = Vec::new();
        BlockConvolver::new(&[1.0, 2.0]).unwrap().finish(&mut wet);
        assert!(wet.is_empty());
        assert!(matches!(BlockConvolver::new(&[]), Err(Error::ResponseLength { .. })));
        assert!(matches!(BlockConvolver::new(&[1.0, f32::NAN]), Err(Error::NotFinite { index: 1 })));
    }
}
