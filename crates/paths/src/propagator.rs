//! The seam between a scene and its paths.

use crate::path_set::PathSet;
use sabine_acoustics::{Air, Error, Observer};
use sabine_scene::{Receiver, Scene, Source};

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
