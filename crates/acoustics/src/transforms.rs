//! Discrete Fourier transforms of real samples.

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// The discrete Fourier transform of so many real samples, forward and back, in `f32` or `f64`.
///
/// The transforms are those of `realfft`: a spectrum has `length / 2 + 1` lines, nothing is scaled, and going forward and back multiplies by
/// the length. They are planned anew for each length, so that the last bits do not depend on what was planned before. Compiling the
/// transforms takes most of a minute: they are compiled here, once, and not in every crate that transforms.
///
/// ```
/// let transforms = sabine_acoustics::RealTransforms::<f64>::new(8);
/// let mut samples: Vec<f64> = (0..8).map(|i| (std::f64::consts::TAU * 2.0 * f64::from(i) / 8.0).cos()).collect();
/// let mut lines = transforms.forward.make_output_vec();
/// transforms.forward.process(&mut samples, &mut lines)?;
/// assert!((lines[2].re - 4.0).abs() < 1e-12 && lines[1].norm() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct RealTransforms<T> {
    /// From samples to lines.
    pub forward: Arc<dyn RealToComplex<T>>,
    /// From lines to samples.
    pub inverse: Arc<dyn ComplexToReal<T>>,
}

impl RealTransforms<f64> {
    /// Plans transforms of `length` samples.
    pub fn new(length: usize) -> Self {
        let mut planner = RealFftPlanner::new();
        Self { forward: planner.plan_fft_forward(length), inverse: planner.plan_fft_inverse(length) }
    }
}

impl RealTransforms<f32> {
    /// Plans transforms of `length` samples.
    pub fn new(length: usize) -> Self {
        let mut planner = RealFftPlanner::new();
        Self { forward: planner.plan_fft_forward(length), inverse: planner.plan_fft_inverse(length) }
    }
}

impl<T> std::fmt::Debug for RealTransforms<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RealTransforms").field("length", &self.forward.len()).finish()
    }
}
