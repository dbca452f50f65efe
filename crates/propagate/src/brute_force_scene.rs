//! Every triangle, one after the other: the oracle of the hierarchy.

use crate::Error;
use crate::surfaces::Surfaces;
use sabine_paths::{RayHit, RayScene};
use sabine_scene::Scene;

/// The mesh of a [`Scene`] without any acceleration, in double precision: slow, and right. It checks [`MeshScene`] and
/// carries [`ReferenceTracer`].
///
/// [`MeshScene`]: crate::MeshScene
/// [`ReferenceTracer`]: crate::ReferenceTracer
pub struct BruteForceScene {
    pub(crate) surfaces: Surfaces,
}

impl BruteForceScene {
    /// Takes the triangles.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if all triangles have zero area.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Ok(Self { surfaces: Surfaces::new(scene)? })
    }
}

impl RayScene for BruteForceScene {
    fn closest_hit(&self, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> Option<RayHit> {
        let mut nearest: Option<RayHit> = None;
        for (surface, triangle) in self.surfaces.triangles.iter().zip(0..) {
            if let Some(distance) = surface.intersect(origin, direction)
                && distance <= max_distance
                && nearest.is_none_or(|hit| distance < hit.distance)
            {
                nearest = Some(RayHit { distance, triangle });
            }
        }
        nearest
    }
}
