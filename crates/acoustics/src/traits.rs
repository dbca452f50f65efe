//! The seams: each small, object-safe, and implemented at least twice in the workspace.

use crate::{Air, Error, ImpulseResponse, Observer, PathSet, Receiver, RoomTargets, Scene, Signal, Source};
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

/// Tells from speech what the room sounds like.
pub trait RoomEstimator: Send + Sync {
    /// Reverberation time and equalisation of the room in which `speech` was recorded.
    ///
    /// # Errors
    /// Where the recording cannot be judged: too short, silent, ...
    fn estimate(&self, speech: &Signal) -> Result<RoomTargets, Error>;
}

/// Makes another plausible response out of a measured one.
pub trait Augment: Send + Sync {
    /// A changed response, the same for the same seed. Its labels are for the caller to measure.
    ///
    /// # Errors
    /// Where the response does not permit the change (too noisy, no direct sound, ...).
    fn augment(&self, response: &ImpulseResponse, seed: u64) -> Result<ImpulseResponse, Error>;
}

/// Where a ray meets the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance along the ray in units of its direction's length.
    pub distance: f64,
    /// Index of the triangle.
    pub triangle: u32,
}

/// Answers which surface a ray meets first.
pub trait RayScene: Send + Sync {
    /// The nearest triangle within `max_distance` along a unit `direction`, either side of it.
    fn closest_hit(&self, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> Option<RayHit>;

    /// Whether there is any triangle within `max_distance` along a unit `direction`: what a shadow ray asks, and cheaper
    /// than the nearest one where an implementor says so.
    fn any_hit(&self, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> bool {
        self.closest_hit(origin, direction, max_distance).is_some()
    }
}

/// Finds the paths between a source and a receiver.
pub trait Propagator: Send + Sync {
    /// Traces all paths up to the length that the propagator is set to. `air` sets the speed of sound, which turns its
    /// duration into a length; nothing else of it enters the paths.
    ///
    /// # Errors
    /// For a scene, source or receiver that cannot be traced, and [`Error::Cancelled`].
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, Error>;
}

/// A differentiable cost.
pub trait Objective {
    /// Number of variables.
    fn dimension(&self) -> usize;

    /// The value at `x`; its gradient is written to `gradient`, both of [`Objective::dimension`] numbers.
    fn value_and_gradient(&self, x: &[f64], gradient: &mut [f64]) -> f64;
}
