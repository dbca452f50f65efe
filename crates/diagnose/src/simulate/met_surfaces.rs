//! Which surfaces a specular path meets, and in which order.

use crate::error::Error;
use crate::survey::planes::dot;
use crate::survey::surfaces::{Corners, corners};
use crate::survey::surfaces::{Surfaces, minus, mirrored_in, normal_of, unit};
use sabine_paths::RayScene;
use sabine_propagate::MeshScene;
use sabine_scene::Scene;

/// Reflections that are followed at most.
const MAX_ORDER: usize = 64;
/// A path is followed from this far before where it met a surface, in metres.
const BEFORE_M: f64 = 1e-6;
/// How far the image of the source may be from where the path comes from, in metres for the path, and more for each reflection: faces lie in
/// their planes to a few millimetres, and directions are kept to 0.005 degrees.
const IMAGE_M: f64 = 0.01;
const MORE_M: f64 = 0.005;
/// Directions are kept to this, in radians, with a margin.
const DIRECTION: f64 = 3e-4;

/// Follows specular paths through a mesh. That of a [`PathSet`](sabine_paths::PathSet) knows materials alone.
pub(crate) struct MetSurfaces {
    mesh: MeshScene,
    corners: Vec<Corners>,
    of_triangle: Vec<Option<usize>>,
    /// Unit normal and a point of each surface, as it stands.
    planes: Vec<([f64; 3], [f64; 3])>,
}

impl MetSurfaces {
    /// The surfaces `stated` of the mesh as the room file has it, in a mesh that begins with the same triangles.
    pub fn new(scene: &Scene, stated: &Surfaces) -> Result<Self, Error> {
        Ok(Self {
            mesh: MeshScene::new(scene)?,
            corners: (0..scene.triangles().len()).map(|t| corners(scene, t)).collect(),
            of_triangle: stated.of_triangle.clone(),
            planes: (0..stated.planes.len()).map(|s| stated.plane(scene, s)).collect(),
        })
    }

    /// Surfaces (indices) that the path of a length in metres meets, from the source on. It leaves in the direction `departure` and reaches
    /// the receiver out of the direction `arrival`. None if it cannot be followed: an edge is too near to say.
    pub fn of(
        &self,
        [source, receiver]: [[f64; 3]; 2],
        length_m: f64,
        [departure, arrival]: [[f64; 3]; 2],
    ) -> Option<Vec<usize>> {
        let forth = || self.along(source, departure, length_m);
        let back = || {
            let mut met = self.along(receiver, arrival, length_m)?;
            met.reverse();
            Some(met)
        };
        let image = |k: usize| receiver[k] + length_m * arrival[k];
        let fits = |met: &Vec<usize>| {
            let found =
                met.iter().fold(source, |place, &s| mirrored_in(place, self.planes[s].0, self.planes[s].1));
            let off = minus(found, std::array::from_fn(image));
            dot(off, off).sqrt() < IMAGE_M + MORE_M * met.len() as f64 + DIRECTION * length_m
        };
        forth().filter(fits).or_else(|| back().filter(fits))
    }

    /// Surfaces that a ray meets within a length.
    fn along(&self, from: [f64; 3], towards: [f64; 3], length_m: f64) -> Option<Vec<usize>> {
        let (mut place, mut direction, mut left_m) = (from, unit(towards), length_m);
        let mut met = Vec::new();
        while let Some(hit) = self.mesh.closest_hit(place, direction, left_m) {
            if met.len() == MAX_ORDER {
                return None;
            }
            // An object that stands in the room is none of the surfaces.
            met.push((*self.of_triangle.get(hit.triangle as usize)?)?);
            let way = hit.distance - BEFORE_M;
            place = std::array::from_fn(|k| place[k] + way * direction[k]);
            left_m -= way;
            let normal = unit(normal_of(self.corners[hit.triangle as usize]));
            let towards = dot(normal, direction);
            direction = unit(std::array::from_fn(|k| direction[k] - 2.0 * towards * normal[k]));
        }
        Some(met)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_acoustics::{Bands, Material};

    #[test]
    fn a_path_is_followed_over_the_mirrors_of_its_image() {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| hard.clone())).unwrap();
        let surfaces = Surfaces::of(&scene);
        let met = MetSurfaces::new(&scene, &surfaces).unwrap();
        let wall = |axis: usize, at: f64| {
            let is = |(normal, point): &([f64; 3], [f64; 3])| {
                normal[axis].abs() > 0.9 && (point[axis] - at).abs() < 1e-9
            };
            surfaces.planes.iter().position(is).unwrap()
        };
        let (source, receiver) = ([1.0, 1.2, 1.1], [3.7, 2.9, 1.8]);
        let found = |image: [f64; 3], signs: [f64; 3]| {
            let way = minus(image, receiver);
            let length_m = dot(way, way).sqrt();
            let arrival = unit(way);
            // Seen from the source, each mirror turns a component.
            let departure = std::array::from_fn(|k| -signs[k] * arrival[k]);
            met.of([source, receiver], length_m, [departure, arrival]).unwrap()
        };
        assert!(found(source, [1.0; 3]).is_empty());
        assert_eq!(found([9.0, 1.2, 1.1], [-1.0, 1.0, 1.0]), [wall(0, 5.0)]);
        // Over x = 0 and then x = 5.
        assert_eq!(found([11.0, 1.2, 1.1], [1.0; 3]), [wall(0, 0.0), wall(0, 5.0)]);
        // Over the floor and the wall y = 4, in whichever order.
        let mut both = found([1.0, 6.8, -1.1], [1.0, -1.0, -1.0]);
        both.sort_unstable();
        let mut expected = [wall(1, 4.0), wall(2, 0.0)];
        expected.sort_unstable();
        assert_eq!(both, expected);
        // A path that is none.
        assert!(met.of([source, receiver], 4.0, [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]).is_none());
    }
}
