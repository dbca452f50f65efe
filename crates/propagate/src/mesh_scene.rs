//! A triangle mesh behind a bounding volume hierarchy.

use crate::Error;
use crate::surfaces::{Surface, Surfaces, distance_to};
use crate::vector::{Vec3, norm, sub};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::Ray;
use sabine_acoustics::{RayHit, RayScene, Scene};

/// The mesh of a [`Scene`], ready for rays: parry's bounding volume hierarchy chooses the candidates in single precision,
/// this crate's own test decides in double precision.
///
/// Neighbouring triangles overlap by 1e-8 of their sides, so that no ray slips through an edge by rounding.
///
/// ```
/// use sabine_acoustics::{Material, OctaveBands, RayScene, Scene};
/// use sabine_propagate::MeshScene;
/// let plaster = Material::uniform(OctaveBands::SIMULATION, 0.1, 0.1)?;
/// let room = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| plaster.clone()))?;
/// let mesh = MeshScene::new(&room)?;
/// let up = mesh.closest_hit([2.0, 3.0, 1.5], [0.0, 0.0, 1.0], f64::INFINITY).unwrap();
/// assert!((up.distance - 1.5).abs() < 1e-12);
/// assert_eq!(room.triangles()[up.triangle as usize].material, 5); // the ceiling
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct MeshScene {
    pub(crate) surfaces: Surfaces,
    hierarchy: Bvh,
    /// Triangle of each leaf: degenerate triangles have none.
    leaves: Vec<u32>,
    /// Subtracted before rounding to single precision, so that a room far from the origin loses nothing.
    centre_m: Vec3,
}

impl MeshScene {
    /// Builds the hierarchy.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if all triangles have zero area.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        let surfaces = Surfaces::new(scene)?;
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in surfaces.triangles.iter().flat_map(Surface::corners) {
            for axis in 0..3 {
                low[axis] = low[axis].min(corner[axis]);
                high[axis] = high[axis].max(corner[axis]);
            }
        }
        let centre_m: Vec3 = std::array::from_fn(|i| 0.5 * (low[i] + high[i]));
        // More than what the single-precision box test can be wrong by.
        let margin = 1e-5 * norm(sub(high, low));
        let leaves: Vec<u32> = (0..surfaces.triangles.len() as u32)
            .filter(|&i| !surfaces.triangles[i as usize].is_degenerate())
            .collect();
        let boxes: Vec<Aabb> = leaves
            .iter()
            .map(|&i| {
                let corners = surfaces.triangles[i as usize].corners();
                let bound = |axis: usize, pick: fn(f64, f64) -> f64| {
                    corners.iter().map(|c| c[axis] - centre_m[axis]).reduce(pick).unwrap_or(0.0)
                };
                let least: Vec3 = std::array::from_fn(|axis| bound(axis, f64::min) - margin);
                let most: Vec3 = std::array::from_fn(|axis| bound(axis, f64::max) + margin);
                Aabb::new(single(least), single(most))
            })
            .collect();
        let hierarchy = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Ok(Self { surfaces, hierarchy, leaves, centre_m })
    }

    /// The triangle nearest to a point, and its distance in metres.
    pub(crate) fn nearest(&self, point: Vec3) -> (usize, f64) {
        let distances = self.surfaces.triangles.iter().map(|s| distance_to(s, point)).enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::INFINITY))
    }
}

impl RayScene for MeshScene {
    fn closest_hit(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> Option<RayHit> {
        let ray = Ray::new(single(sub(origin, self.centre_m)), single(direction));
        let surface = |leaf: u32| &self.surfaces.triangles[self.leaves[leaf as usize] as usize];
        let test = |leaf: u32, _| surface(leaf).intersect(origin, direction).map(|t| t as f32);
        let (leaf, _) = self.hierarchy.cast_ray(&ray, max_distance as f32, test)?;
        let distance = surface(leaf).intersect(origin, direction).filter(|&t| t <= max_distance)?;
        Some(RayHit { distance, triangle: self.leaves[leaf as usize] })
    }
}

fn single(v: Vec3) -> Vector {
    Vector::new(v[0] as f32, v[1] as f32, v[2] as f32)
}
