//! Every ray against every triangle.

use crate::geometry::{Vec3, first_hit};
use sabine_paths::{RayHit, RayScene};
use sabine_scene::Scene;

/// The plainest ray scene there is: time grows with the number of triangles, and nothing can be lost in a tree.
#[derive(Clone, Debug)]
pub struct BruteForceRays {
    triangles: Vec<[Vec3; 3]>,
}

impl BruteForceRays {
    /// Copies the triangles of a scene.
    pub fn new(scene: &Scene) -> Self {
        Self { triangles: corners(scene) }
    }
}

pub(crate) fn corners(scene: &Scene) -> Vec<[Vec3; 3]> {
    (0..scene.triangles().len()).map(|i| scene.corners_m(i)).collect()
}

impl RayScene for BruteForceRays {
    fn closest_hit(&self, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> Option<RayHit> {
        first_hit(&self.triangles, origin, direction, 0.0, max_distance)
            .map(|(triangle, distance)| RayHit { distance, triangle: triangle as u32 })
    }
}
