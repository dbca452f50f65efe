//! One stage of partitioned convolution: blocks of one size, spectra of past blocks kept.

use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;

/// Transforms of one block size, shared by the stage and the responses prepared for it.
#[derive(Clone, Debug)]
pub(crate) struct BlockTransform {
    pub block: usize,
    transforms: RealTransforms<f32>,
}

impl BlockTransform {
    pub fn new(block: usize) -> Self {
        Self { block, transforms: RealTransforms::<f32>::new(2 * block) }
    }

    pub fn bins(&self) -> usize {
        self.block + 1
    }

    /// Spectra of a response cut into blocks, one after the other; scaled so that the inverse needs no scale.
    pub fn partition(&self, response: &[f32]) -> Vec<Complex<f32>> {
        let mut spectra = vec![Complex::default(); response.len().div_ceil(self.block) * self.bins()];
        let mut time = vec![0.0; 2 * self.block];
        let mut scratch = self.scratch();
        let scale = 0.5 / self.block as f32;
        for (piece, out) in response.chunks(self.block).zip(spectra.chunks_mut(self.bins())) {
            time.fill(0.0);
            for (to, &from) in time.iter_mut().zip(piece) {
                *to = from * scale;
            }
            self.forward(&mut time, out, &mut scratch);
        }
        spectra
    }

    pub fn scratch(&self) -> Vec<Complex<f32>> {
        vec![
            Complex::default();
            self.transforms.forward.get_scratch_len().max(self.transforms.inverse.get_scratch_len())
        ]
    }

    fn forward(&self, time: &mut [f32], spectrum: &mut [Complex<f32>], scratch: &mut [Complex<f32>]) {
        let scratch = &mut scratch[..self.transforms.forward.get_scratch_len()];
        let done = self.transforms.forward.process_with_scratch(time, spectrum, scratch);
        debug_assert!(done.is_ok(), "lengths agree by construction");
    }

    fn backward(&self, spectrum: &mut [Complex<f32>], time: &mut [f32], scratch: &mut [Complex<f32>]) {
        spectrum[0].im = 0.0;
        spectrum[self.block].im = 0.0;
        let scratch = &mut scratch[..self.transforms.inverse.get_scratch_len()];
        let done = self.transforms.inverse.process_with_scratch(spectrum, time, scratch);
        debug_assert!(done.is_ok(), "the spectrum of a real signal");
    }
}

/// The input side of a stage: the spectra of the last blocks, newest at `newest` and older ones behind it, in a ring.
#[derive(Clone, Debug)]
pub(crate) struct Stage {
    transform: BlockTransform,
    partitions: usize,
    spectra: Vec<Complex<f32>>,
    newest: usize,
    /// The block before the newest and the newest.
    pair: Vec<f32>,
    time: Vec<f32>,
    scratch: Vec<Complex<f32>>,
}

impl Stage {
    pub fn new(transform: BlockTransform, partitions: usize) -> Self {
        let (block, bins) = (transform.block, transform.bins());
        Self {
            partitions,
            spectra: vec![Complex::default(); partitions * bins],
            newest: 0,
            pair: vec![0.0; 2 * block],
            time: vec![0.0; 2 * block],
            scratch: transform.scratch(),
            transform,
        }
    }

    /// Takes one block of input.
    pub fn push(&mut self, input: &[f32]) {
        let (block, bins) = (self.transform.block, self.transform.bins());
        self.pair.copy_within(block.., 0);
        self.pair[block..].copy_from_slice(input);
        self.newest = if self.newest == 0 { self.partitions - 1 } else { self.newest - 1 };
        self.time.copy_from_slice(&self.pair);
        let slot = &mut self.spectra[self.newest * bins..][..bins];
        self.transform.forward(&mut self.time, slot, &mut self.scratch);
    }

    /// Adds to `sum` the products of the partitions `from..to` of a response, as far as it goes, with the blocks that they meet.
    pub fn accumulate(&self, response: &[Complex<f32>], from: usize, to: usize, sum: &mut [Complex<f32>]) {
        let bins = self.transform.bins();
        for partition in from..to.min(response.len() / bins) {
            let slot = (self.newest + partition) % self.partitions;
            let x = &self.spectra[slot * bins..][..bins];
            let h = &response[partition * bins..][..bins];
            for ((sum, x), h) in sum.iter_mut().zip(x).zip(h) {
                sum.re += x.re * h.re - x.im * h.im;
                sum.im += x.re * h.im + x.im * h.re;
            }
        }
    }

    /// Turns a sum of products into one block of output; the sum is left as garbage.
    pub fn finish(&mut self, sum: &mut [Complex<f32>], output: &mut [f32]) {
        self.transform.backward(sum, &mut self.time, &mut self.scratch);
        output.copy_from_slice(&self.time[self.transform.block..]);
    }

    pub fn clear(&mut self) {
        self.spectra.fill(Complex::default());
        self.pair.fill(0.0);
        self.newest = 0;
    }
}
