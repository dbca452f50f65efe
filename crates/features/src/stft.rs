//! Short-time Fourier transform and its inverse.

use crate::Error;
use ndarray::{Array2, ArrayView2};
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealToComplex};
use sabine_acoustics::{OutOfRange, RealTransforms};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Longest transform that is planned, in samples.
const MAX_N_FFT: usize = 1 << 20;

/// Least sum of squared windows, relative to the window's peak, at which [`Stft::inverse`] divides: below it a sample is not
/// recoverable in single precision.
const LEAST_WINDOW_SUM: f64 = 1e-6;

/// A short-time Fourier transform with a periodic Hann window and no centre padding, planned once.
///
/// Frame `t` covers the samples `t * hop .. t * hop + n_fft`; samples after the last whole frame are left over. The transform
/// is unnormalised (a full-scale cosine at a bin has magnitude `n_fft / 4` there) and the inverse divides by `n_fft`.
/// Arithmetic is in double precision, so that weak bins beside strong ones are right; results are single precision.
///
/// ```
/// use sabine_features::Stft;
/// let stft = Stft::new(256, 128)?;
/// // A cosine of amplitude 1 at bin 16, 1 kHz at 16 kHz sampling.
/// let tone: Vec<f32> = (0..1024).map(|n| (std::f32::consts::TAU * n as f32 / 16.0).cos()).collect();
/// let spectrum = stft.forward(&tone);
/// assert_eq!(spectrum.dim(), (129, 7));
/// assert!((spectrum[[16, 3]].norm() - 64.0).abs() < 1e-3);
/// # Ok::<(), sabine_features::Error>(())
/// ```
#[derive(Clone)]
pub struct Stft {
    window: Vec<f64>,
    hop: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    backward: Arc<dyn ComplexToReal<f64>>,
}

impl std::fmt::Debug for Stft {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stft").field("n_fft", &self.n_fft()).field("hop", &self.hop).finish()
    }
}

/// Working memory of one frame, so that repeated transforms allocate nothing.
#[derive(Clone, Debug)]
pub struct StftScratch {
    pub(crate) frame: Vec<f64>,
    pub(crate) spectrum: Vec<Complex<f64>>,
    fft: Vec<Complex<f64>>,
}

impl StftScratch {
    /// Checks that it was made for this transform.
    pub(crate) fn check(&self, stft: &Stft) -> Result<(), Error> {
        check_length("scratch", stft.n_fft(), self.frame.len())
    }
}

impl Stft {
    /// Plans transforms of `n_fft` samples (2 to 2^20) every `hop` samples (1 to `n_fft`).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] outside these ranges.
    pub fn new(n_fft: usize, hop: usize) -> Result<Self, Error> {
        OutOfRange::check("n_fft", n_fft as f64, 2.0, MAX_N_FFT as f64, "between 2 and 2^20")?;
        OutOfRange::check("hop", hop as f64, 1.0, n_fft as f64, "between 1 and n_fft")?;
        let transforms = RealTransforms::<f64>::new(n_fft);
        Ok(Self {
            window: hann_periodic(n_fft),
            hop,
            forward: transforms.forward,
            backward: transforms.inverse,
        })
    }

    /// Samples in a frame.
    pub fn n_fft(&self) -> usize {
        self.window.len()
    }

    /// Samples from one frame to the next.
    pub fn hop(&self) -> usize {
        self.hop
    }

    /// Frequency bins, from 0 Hz to half the sample rate: `n_fft / 2 + 1`.
    pub fn bins(&self) -> usize {
        self.n_fft() / 2 + 1
    }

    /// The periodic Hann window that weighs each frame.
    pub fn window(&self) -> &[f64] {
        &self.window
    }

    /// Number of whole frames in this many samples.
    pub fn frames(&self, samples: usize) -> usize {
        if samples < self.n_fft() { 0 } else { 1 + (samples - self.n_fft()) / self.hop }
    }

    /// Working memory for [`Stft::forward_into`].
    pub fn scratch(&self) -> StftScratch {
        StftScratch {
            frame: vec![0.0; self.n_fft()],
            spectrum: vec![Complex::default(); self.bins()],
            fft: vec![
                Complex::default();
                self.forward.get_scratch_len().max(self.backward.get_scratch_len())
            ],
        }
    }

    /// Spectra of all whole frames, `[bin, frame]`.
    pub fn forward(&self, samples: &[f32]) -> Array2<Complex<f32>> {
        let mut scratch = self.scratch();
        let mut out = Array2::zeros((self.bins(), self.frames(samples.len())));
        for (t, mut column) in out.columns_mut().into_iter().enumerate() {
            self.transform(&samples[t * self.hop..][..self.n_fft()], &mut scratch);
            for (to, from) in column.iter_mut().zip(&scratch.spectrum) {
                *to = Complex::new(from.re as f32, from.im as f32);
            }
        }
        out
    }

    /// Spectrum of one frame of `n_fft` samples, written to `bins` values, without allocating.
    ///
    /// # Errors
    /// [`Error::BufferLength`] if a slice has another length or the scratch is another transform's.
    pub fn forward_into(
        &self,
        frame: &[f32],
        scratch: &mut StftScratch,
        out: &mut [Complex<f32>],
    ) -> Result<(), Error> {
        check_length("frame", self.n_fft(), frame.len())?;
        check_length("spectrum", self.bins(), out.len())?;
        scratch.check(self)?;
        self.transform(frame, scratch);
        for (to, from) in out.iter_mut().zip(&scratch.spectrum) {
            *to = Complex::new(from.re as f32, from.im as f32);
        }
        Ok(())
    }

    /// The signal whose frames come nearest, in least squares, to these spectra `[bin, frame]` (Griffin and Lim 1984, eq. 6):
    /// windowed overlap-add divided by the sum of the squared windows.
    ///
    /// It has `n_fft + (frames - 1) * hop` samples. Where frames overlap fully the inverse of a transform is the signal
    /// itself; at both ends, where the Hann window falls to zero, samples that cannot be recovered are 0.
    ///
    /// # Errors
    /// [`Error::BufferLength`] if the number of rows is not [`Stft::bins`].
    pub fn inverse(&self, spectra: ArrayView2<'_, Complex<f32>>) -> Result<Vec<f32>, Error> {
        check_length("rows of the spectrogram", self.bins(), spectra.nrows())?;
        if spectra.ncols() == 0 {
            return Ok(Vec::new());
        }
        let length = self.n_fft() + (spectra.ncols() - 1) * self.hop;
        let (mut sum, mut weight) = (vec![0.0; length], vec![0.0; length]);
        let mut scratch = self.scratch();
        let scale = 1.0 / self.n_fft() as f64;
        for (t, column) in spectra.columns().into_iter().enumerate() {
            for (to, from) in scratch.spectrum.iter_mut().zip(column) {
                *to = Complex::new(f64::from(from.re), f64::from(from.im));
            }
            // The imaginary parts at 0 Hz and at half the sample rate say nothing about a real signal.
            scratch.spectrum[0].im = 0.0;
            if self.n_fft().is_multiple_of(2) {
                scratch.spectrum[self.bins() - 1].im = 0.0;
            }
            let fft = &mut scratch.fft[..self.backward.get_scratch_len()];
            let done = self.backward.process_with_scratch(&mut scratch.spectrum, &mut scratch.frame, fft);
            debug_assert!(done.is_ok(), "lengths agree by construction");
            let at = t * self.hop;
            for (i, (&w, &x)) in self.window.iter().zip(&scratch.frame).enumerate() {
                sum[at + i] += w * x * scale;
                weight[at + i] += w * w;
            }
        }
        let divide = |(s, w): (&f64, &f64)| if *w > LEAST_WINDOW_SUM { (s / w) as f32 } else { 0.0 };
        Ok(sum.iter().zip(&weight).map(divide).collect())
    }

    /// Windows one frame and leaves its spectrum in the scratch. The caller has checked the length.
    pub(crate) fn transform(&self, frame: &[f32], scratch: &mut StftScratch) {
        for ((to, &x), &w) in scratch.frame.iter_mut().zip(frame).zip(&self.window) {
            *to = f64::from(x) * w;
        }
        let fft = &mut scratch.fft[..self.forward.get_scratch_len()];
        let done = self.forward.process_with_scratch(&mut scratch.frame, &mut scratch.spectrum, fft);
        debug_assert!(done.is_ok(), "lengths agree by construction");
    }
}

/// `sin^2(pi n / length)`: one period of the raised cosine, as spectral analysis needs it.
fn hann_periodic(length: usize) -> Vec<f64> {
    (0..length).map(|n| 0.5 - 0.5 * (TAU * n as f64 / length as f64).cos()).collect()
}

pub(crate) fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), Error> {
    if expected == found { Ok(()) } else { Err(Error::BufferLength { what, expected, found }) }
}
