//! The seam between sound and the features of a network.

use ndarray::Array2;

/// Turns sound into the features of an estimator.
pub trait FeatureExtractor: Send + Sync {
    /// Sample rate that the samples must have, in Hz.
    fn sample_rate_hz(&self) -> u32;

    /// Number of features in each frame.
    fn features(&self) -> usize;

    /// Number of frames that this many samples give; zero if they are too few for one.
    fn frames(&self, samples: usize) -> usize;

    /// Features, `[feature, frame]`.
    fn extract(&self, samples: &[f32]) -> Array2<f32>;
}
