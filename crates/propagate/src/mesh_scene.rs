//! A triangle mesh behind a bounding volume hierarchy.

use crate::Error;
use crate::hierarchy::Hierarchy;
use crate::merged_faces::merged;
use crate::surfaces::{Surface, Surfaces, distance_to};
use crate::vector::{Vec3, along, norm, sub};
use crate::wide_node::LocalRay;
use sabine_paths::{RayHit, RayScene};
use sabine_scene::Scene;
use std::ops::ControlFlow;

/// The mesh of a [`Scene`], ready for rays: a bounding volume hierarchy chooses the candidates in single precision, a test
/// in double precision decides.
///
/// It answers as [`BruteForceScene`](crate::BruteForceScene) does, to the bit unless triangles are merged
/// ([`MeshScene::merged`]). Neighbouring triangles overlap by 1e-8 of
/// their sides, so that no ray slips through an edge by rounding.
///
/// ```
/// use sabine_acoustics::{Bands, Material};
/// use sabine_paths::RayScene;
/// use sabine_scene::Scene;
/// use sabine_propagate::MeshScene;
/// let plaster = Material::uniform(Bands::SIMULATION, 0.1, 0.1)?;
/// let room = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| plaster.clone()))?;
/// let mesh = MeshScene::new(&room)?;
/// let up = mesh.closest_hit([2.0, 3.0, 1.5], [0.0, 0.0, 1.0], f64::INFINITY).unwrap();
/// assert!((up.distance - 1.5).abs() < 1e-12);
/// assert_eq!(room.triangles()[up.triangle as usize].material, 5); // the ceiling
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct MeshScene {
    pub(crate) surfaces: Surfaces,
    /// What rays are tested against, if that is not every triangle of the scene.
    merged: Option<Vec<Surface>>,
    /// Over the merged faces, or over all triangles.
    hierarchy: Hierarchy,
    /// Triangles without area: nothing hits them, but a point can be near them.
    degenerate: Vec<u32>,
    /// Origin of coordinates in the hierarchy: a room far from the scene's origin loses nothing in single precision.
    centre_m: Vec3,
}

impl MeshScene {
    /// Builds the hierarchy over all triangles.
    ///
    /// # Errors
    /// [`Error::NoSurface`] if all triangles have zero area.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Ok(Self::over(Surfaces::new(scene)?, None))
    }

    /// Builds the hierarchy over flat patches: connected triangles of one plane and one material are merged and cut into as few
    /// triangles as their outline allows, so that a ray in a finely meshed box meets 12 of them.
    ///
    /// Rays meet the same points, but for rounding: triangles are merged where they lie in one plane to 1e-7 of the size of the
    /// scene, and patches keep their outline to as much. What cannot be merged without loss stays as it is; a scene without
    /// anything to merge answers as [`MeshScene::new`] does, to the bit. [`RayHit::triangle`] is the largest triangle of the
    /// patch that is hit, whose material, plane and side are those of the triangle at that point.
    ///
    /// ```
    /// # use sabine_acoustics::{Bands, Material};
    /// # use sabine_scene::{NamedMaterial, Scene, Triangle};
    /// # use sabine_propagate::MeshScene;
    /// // A square about its middle: four triangles, where two suffice.
    /// let vertices = vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0], [1.0, 1.0, 0.0]];
    /// let triangles = (0..4).map(|i| Triangle { vertices: [i, (i + 1) % 4, 4], material: 0 }).collect();
    /// let material = Material::uniform(Bands::SIMULATION, 0.1, 0.1)?;
    /// let scene = Scene::new(vertices, triangles, vec![NamedMaterial { name: "floor".into(), material }])?;
    /// assert_eq!(MeshScene::new(&scene)?.tested_triangles(), 4);
    /// assert_eq!(MeshScene::merged(&scene)?.tested_triangles(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NoSurface`] if all triangles have zero area.
    pub fn merged(scene: &Scene) -> Result<Self, Error> {
        let surfaces = Surfaces::new(scene)?;
        let merged = merged(scene, &surfaces);
        Ok(Self::over(surfaces, merged))
    }

    fn over(surfaces: Surfaces, merged: Option<Vec<Surface>>) -> Self {
        let centre_m = surfaces.centre_m;
        let faces = merged.as_ref().unwrap_or(&surfaces.triangles);
        let triangles: Vec<(u32, [Vec3; 3])> = (0..)
            .zip(faces)
            .filter(|(_, face)| !face.is_degenerate())
            .map(|(i, face)| (i, [sub(face.corner, centre_m), face.edge1, face.edge2]))
            .collect();
        let hierarchy = Hierarchy::new(&triangles, surfaces.size_m);
        let flat = |i: &u32| surfaces.triangles[*i as usize].is_degenerate();
        let degenerate = (0..surfaces.triangles.len() as u32).filter(flat).collect();
        Self { surfaces, merged, hierarchy, degenerate, centre_m }
    }

    /// Number of triangles that rays are tested against: those of the scene that have an area, or fewer if they were merged.
    pub fn tested_triangles(&self) -> usize {
        self.faces().iter().filter(|face| !face.is_degenerate()).count()
    }

    #[inline]
    fn faces(&self) -> &[Surface] {
        self.merged.as_ref().unwrap_or(&self.surfaces.triangles)
    }

    /// The triangle nearest to a point, and its distance in metres.
    pub(crate) fn nearest(&self, point: Vec3) -> (usize, f64) {
        let distance = |surface: &Surface| distance_to(surface, point);
        let flat = self.degenerate.iter().map(|&i| (i, distance(&self.surfaces.triangles[i as usize])));
        let flat = flat.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((u32::MAX, f64::INFINITY));
        let faces = self.faces();
        let (triangle, distance_m) = self.hierarchy.nearest(single(sub(point, self.centre_m)), flat, |i| {
            let face = &faces[i as usize];
            (face.triangle, distance(face))
        });
        (triangle as usize, distance_m)
    }

    /// The ray as the hierarchy sees it, and the distance along it at which that one begins: an origin far outside is
    /// moved up to the mesh, so that single precision suffices.
    #[inline]
    fn local(&self, origin: Vec3, direction: Vec3) -> (LocalRay, f64) {
        let from_centre = sub(origin, self.centre_m);
        let away = norm(from_centre);
        let size_m = self.surfaces.size_m;
        let skipped = if away > 2.0 * size_m { away - size_m } else { 0.0 };
        (LocalRay::new(single(along(from_centre, direction, skipped)), single(direction)), skipped)
    }

    /// Calls `test` with the candidates up to `max_distance`, and goes on up to the distance that it returns.
    #[inline]
    fn candidates(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f64,
        mut test: impl FnMut(u32) -> ControlFlow<(), f64>,
    ) {
        let (ray, skipped) = self.local(origin, direction);
        // No surface is further from the start of the local ray than three sizes of the mesh.
        let furthest = 4.0 * self.surfaces.size_m;
        let limit = |distance: f64| (distance - skipped).min(furthest) as f32;
        self.hierarchy.visit(&ray, limit(max_distance), |i| test(i).map_continue(limit));
    }
}

impl RayScene for MeshScene {
    fn closest_hit(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> Option<RayHit> {
        let mut nearest: Option<RayHit> = None;
        let mut limit = max_distance;
        let faces = self.faces();
        self.candidates(origin, direction, max_distance, |face| {
            let face = &faces[face as usize];
            if let Some(distance) = face.intersect(origin, direction)
                && distance <= limit
                && nearest.is_none_or(|hit| distance < hit.distance || face.triangle < hit.triangle)
            {
                nearest = Some(RayHit { distance, triangle: face.triangle });
                limit = distance;
            }
            ControlFlow::Continue(limit)
        });
        nearest
    }

    fn any_hit(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> bool {
        let mut hit = false;
        let faces = self.faces();
        self.candidates(origin, direction, max_distance, |face| {
            hit = faces[face as usize]
                .intersect(origin, direction)
                .is_some_and(|distance| distance <= max_distance);
            if hit { ControlFlow::Break(()) } else { ControlFlow::Continue(max_distance) }
        });
        hit
    }
}

fn single(v: Vec3) -> [f32; 3] {
    v.map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{direction, generator};
    use rand::Rng;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::{NamedMaterial, Triangle};

    #[test]
    fn the_nearest_triangle_is_that_of_a_plain_search() {
        let mut random = generator(11, 0);
        let mut point =
            |half: f64| crate::vector::scale(direction(&mut random), half * random.random::<f64>());
        let mut vertices = Vec::new();
        for i in 0..400 {
            let at = point(5.0);
            // Every tenth has no area.
            let corners = if i % 10 == 0 {
                [at; 3]
            } else {
                [at, along(at, point(1.0), 1.0), along(at, point(1.0), 1.0)]
            };
            vertices.extend(corners);
        }
        let triangles = (0..400).map(|i| Triangle { vertices: [3 * i, 3 * i + 1, 3 * i + 2], material: 0 });
        let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        let materials = vec![NamedMaterial { name: "any".into(), material }];
        let mesh = MeshScene::new(&Scene::new(vertices, triangles.collect(), materials).unwrap()).unwrap();
        let mut flat = 0;
        for _ in 0..2_000 {
            let from = point(10.0);
            let all = mesh.surfaces.triangles.iter().map(|s| distance_to(s, from)).enumerate();
            let expected = all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            assert_eq!(mesh.nearest(from), expected);
            flat += usize::from(expected.0 % 10 == 0);
        }
        assert!(flat > 20, "{flat}");
    }
}
