//! Every triangle, one after the other: the oracle of the hierarchy.

use crate::Error;
use crate::surfaces::Surfaces;
use sabine_acoustics::{RayHit, RayScene, Scene};

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
        for (i, surface) in self.surfaces.triangles.iter().enumerate() {
            let limit = nearest.map_or(max_distance, |hit| hit.distance);
            match surface.intersect(origin, direction) {
                Some(distance) if distance <= limit => {
                    nearest = Some(RayHit { distance, triangle: i as u32 });
                }
                _ => {}
            }
        }
        nearest
    }
}
