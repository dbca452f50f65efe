//! A triangle mesh behind a bounding volume hierarchy.

use crate::Error;
use crate::hierarchy::{Hierarchy, Query};
use crate::instructions::Instructions;
use crate::merged_faces::merged;
use crate::surfaces::{Surface, Surfaces, distance_to};
use crate::triangle_pack::ExactRay;
use crate::vector::{Vec3, along, dot, sub};
use crate::wide_node::LocalRay;
use sabine_paths::{RayHit, RayScene};
use sabine_scene::Scene;

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
        Self::by(surfaces, merged, Instructions::best())
    }

    fn by(surfaces: Surfaces, merged: Option<Vec<Surface>>, instructions: Instructions) -> Self {
        let centre_m = surfaces.centre_m;
        let faces = merged.as_ref().unwrap_or(&surfaces.triangles);
        let hierarchy = Hierarchy::new(faces, centre_m, surfaces.size_m, instructions);
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

    /// An origin far outside is moved up to the mesh for the boxes, so that single precision suffices.
    #[inline]
    fn query(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> Query {
        let from_centre = sub(origin, self.centre_m);
        let size_m = self.surfaces.size_m;
        let away2 = dot(from_centre, from_centre);
        let skipped_m = if away2 > 4.0 * size_m * size_m { away2.sqrt() - size_m } else { 0.0 };
        let local = LocalRay::new(single(along(from_centre, direction, skipped_m)), single(direction));
        let exact = ExactRay { origin, direction, agreement_m: self.surfaces.agreement_m };
        // No surface is further from the start of the local ray than three sizes of the mesh.
        Query { exact, local, skipped_m, furthest_m: 4.0 * size_m, max_distance }
    }
}

impl RayScene for MeshScene {
    #[inline]
    fn closest_hit(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> Option<RayHit> {
        self.hierarchy.closest(&self.query(origin, direction, max_distance))
    }

    #[inline]
    fn any_hit(&self, origin: Vec3, direction: Vec3, max_distance: f64) -> bool {
        self.hierarchy.any(&self.query(origin, direction, max_distance))
    }
}

fn single(v: Vec3) -> [f32; 3] {
    v.map(|c| c as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{direction, generator};
    use crate::vector::scale;
    use rand::Rng;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::{NamedMaterial, Triangle};

    #[test]
    fn the_nearest_triangle_is_that_of_a_plain_search() {
        let mut random = generator(11, 0);
        let mut point = |half: f64| scale(direction(&mut random), half * random.random::<f64>());
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

    /// Closed meshes around the origin of which every edge is shared: a finely meshed box whose vertices are moved in their planes, a ball, and
    /// a turned ring of thin walls.
    fn closed_meshes() -> [Scene; 3] {
        let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        let scene = |vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>| {
            let triangles = triangles.into_iter().map(|vertices| Triangle { vertices, material: 0 });
            let materials = vec![NamedMaterial { name: "any".into(), material: material.clone() }];
            Scene::new(vertices, triangles.collect(), materials).unwrap()
        };
        // Rows from pole to pole; the last row and the last column of a ring close on the first.
        let grid = |rows: u32, columns: u32, at: &dyn Fn(f64, f64) -> Vec3| {
            let vertices = (0..=rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
            let vertices =
                vertices.map(|(i, j)| at(f64::from(i) / f64::from(rows), f64::from(j) / f64::from(columns)));
            let index = |i: u32, j: u32| i * columns + j % columns;
            let cells = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
            let triangles = cells.flat_map(|(i, j)| {
                let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
                [[a, b, c], [a, c, d]]
            });
            scene(vertices.collect(), triangles.collect())
        };
        let ball = grid(9, 14, &|polar, azimuth| {
            let (p, a) = (std::f64::consts::PI * polar, std::f64::consts::TAU * azimuth);
            [3.0 * p.sin() * a.cos(), 2.0 * p.sin() * a.sin(), p.cos()]
        });
        // A cylinder whose ends are closed in rows of almost no height.
        let ring = grid(9, 14, &|along, azimuth| {
            let radius = [0.0, 0.7, 1.3, 2.0, 2.0, 2.0, 2.0, 1.1, 0.4, 0.0][(9.0 * along).round() as usize];
            let height =
                [-1.0, -1.0, -1.001, -1.0, -0.3, -0.29, 1.0, 1.0, 1.0, 1.0][(9.0 * along).round() as usize];
            let a = std::f64::consts::TAU * azimuth + 0.1;
            let [x, y, z] = [radius * a.cos(), radius * a.sin(), height];
            [0.6 * x + 0.8 * z, y, 0.6 * z - 0.8 * x]
        });
        [cube(5, &scene), ball, ring]
    }

    /// A cube of 12 x `cells`^2 triangles with welded vertices.
    fn cube(cells: u32, scene: &dyn Fn(Vec<Vec3>, Vec<[u32; 3]>) -> Scene) -> Scene {
        let mut random = generator(12, 0);
        let mut vertices: Vec<Vec3> = Vec::new();
        let mut known = std::collections::HashMap::new();
        let mut triangles = Vec::new();
        for face in 0..6 {
            let (axis, side) = (face % 3, if face < 3 { 0 } else { cells });
            let mut corner = |i: u32, j: u32| {
                let mut at = [side; 3];
                (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (i, j);
                *known.entry(at).or_insert_with(|| {
                    // Inner vertices move in their plane, by less than half a cell.
                    let moved = at.map(|c| match c {
                        0 => -1.5,
                        c if c == cells => 1.5,
                        c => 3.0 / f64::from(cells) * (f64::from(c) + random.random_range(-0.3..0.3)) - 1.5,
                    });
                    vertices.push(moved);
                    vertices.len() as u32 - 1
                })
            };
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        scene(vertices, triangles)
    }

    /// Rays from inside closed meshes into all directions, at edges, at vertices and along axes: all instructions and a plain search find the
    /// same triangle at the same distance, to the bit, and none is lost. Returns the number of rays that were lost.
    fn rays_lost(rays_for_each: u64) -> u64 {
        let mut lost = 0;
        for scene in closed_meshes() {
            let plain = crate::BruteForceScene::new(&scene).unwrap();
            let meshes: Vec<MeshScene> = Instructions::all()
                .into_iter()
                .map(|by| MeshScene::by(Surfaces::new(&scene).unwrap(), None, by))
                .collect();
            for ray in 0..rays_for_each {
                let mut random = generator(13, ray);
                let origin = scale(direction(&mut random), 0.2 * random.random::<f64>());
                let [a, b, c] = scene.corners_m(random.random_range(0..scene.triangles().len()));
                let (u, v) = match ray % 8 {
                    0 | 1 => (random.random::<f64>(), 0.0),
                    2 => (1.0, 0.0),
                    3 => (0.5, 0.5),
                    _ => (0.3, 0.3 * random.random::<f64>()),
                };
                let at = along(along(scale(a, 1.0 - u - v), b, u), c, v);
                let heading = match ray % 8 {
                    0..=3 => crate::vector::unit(sub(at, origin)),
                    4 => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]][(ray / 8 % 3) as usize],
                    _ => direction(&mut random),
                };
                let expected = plain.closest_hit(origin, heading, f64::INFINITY);
                lost += u64::from(expected.is_none());
                let reach = expected.map_or(1.0, |hit| hit.distance);
                for mesh in &meshes {
                    assert_eq!(
                        mesh.closest_hit(origin, heading, f64::INFINITY),
                        expected,
                        "{origin:?} {heading:?}"
                    );
                    assert_eq!(
                        mesh.any_hit(origin, heading, reach),
                        expected.is_some(),
                        "{origin:?} {heading:?}"
                    );
                    assert!(!mesh.any_hit(origin, heading, reach.next_down()), "{origin:?} {heading:?}");
                }
            }
        }
        lost
    }

    #[test]
    fn no_instructions_lose_a_ray_at_shared_edges() {
        assert_eq!(rays_lost(400_000), 0); // in each of three meshes
    }

    #[test]
    #[ignore = "nightly: 10^8 rays against a plain search take minutes"]
    fn no_instructions_lose_one_of_many_rays() {
        let rays = 33_400_000;
        let lost = rays_lost(rays);
        println!("{lost} of {} rays lost", 3 * rays);
        assert_eq!(lost, 0);
    }
}
