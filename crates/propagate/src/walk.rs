//! Walking from surface to surface.

use crate::random::lambert;
use crate::surfaces::Surface;
use crate::vector::{Vec3, along, dot, mirror, sub};
use rand::Rng;
use sabine_paths::{RayHit, RayScene, Reflection};

/// A ray leaves a surface this far before it (m), on the segment that it came along: a point that is certainly in the
/// room, even in a corner, where a step along the normal of one wall may end behind another.
const STEP_BACK_M: f64 = 1e-6;
/// How often a ray that meets nothing is tried again, turned a little.
const RETRIES: u32 = 3;
/// By how much it is turned (rad).
const JITTER_RAD: f64 = 1e-5;

/// The point from which a ray goes on after it met a surface at `distance`.
pub(crate) fn before_hit(origin: Vec3, direction: Vec3, distance: f64) -> Vec3 {
    along(origin, direction, distance - STEP_BACK_M.min(0.5 * distance))
}

/// The next surface. A miss may be a ray aimed exactly at a seam of the model (vertices in files are rounded), so it is
/// tried again with a small turn before it counts as an escape.
pub(crate) fn next_hit(
    scene: &impl RayScene,
    origin: Vec3,
    direction: &mut Vec3,
    random: &mut impl Rng,
) -> Option<RayHit> {
    let first = scene.closest_hit(origin, *direction, f64::INFINITY);
    if first.is_some() {
        return first;
    }
    for _ in 0..RETRIES {
        let turned = crate::vector::unit(along(*direction, crate::random::direction(random), JITTER_RAD));
        if let Some(hit) = scene.closest_hit(origin, turned, f64::INFINITY) {
            *direction = turned;
            return Some(hit);
        }
    }
    None
}

/// The direction after a reflection.
pub(crate) fn reflected(
    surface: &Surface,
    direction: Vec3,
    reflection: Reflection,
    random: &mut impl Rng,
) -> Vec3 {
    match reflection {
        Reflection::Specular => mirror(direction, surface.normal),
        Reflection::Scattered => lambert(random, surface.normal_against(direction)),
    }
}

/// Whether nothing stands between two points. Both must be off the surfaces.
pub(crate) fn visible(scene: &impl RayScene, from: Vec3, to: Vec3) -> bool {
    let line = sub(to, from);
    let distance = dot(line, line).sqrt();
    if distance < 2.0 * STEP_BACK_M {
        return true;
    }
    let direction = crate::vector::scale(line, 1.0 / distance);
    !scene.any_hit(from, direction, distance - STEP_BACK_M)
}

/// A sphere about one end of the paths that counts the rays from the other end: the mean energy density inside is the sum of
/// energy times chord over volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sphere {
    pub centre: Vec3,
    pub radius_m: f64,
}

impl Sphere {
    /// Distance along the ray to the middle of its chord, and the length of the chord, if the sphere lies on the leg.
    /// The legs of rays begin and end on surfaces, and no surface cuts the sphere.
    pub fn chord(&self, origin: Vec3, direction: Vec3, leg_m: f64) -> Option<(f64, f64)> {
        let to_centre = sub(self.centre, origin);
        let middle = dot(to_centre, direction);
        if middle <= 0.0 || middle >= leg_m {
            return None;
        }
        let half2 = self.radius_m * self.radius_m - (dot(to_centre, to_centre) - middle * middle);
        (half2 > 0.0).then(|| (middle, 2.0 * half2.sqrt()))
    }

    /// Volume in m3.
    pub fn volume_m3(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.radius_m.powi(3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_scene::MeshScene;
    use crate::random::{direction, generator};
    use crate::vector::unit;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::Scene;

    const SIZE_M: Vec3 = [10.0, 7.0, 3.0];

    fn the_box() -> MeshScene {
        let m = Material::uniform(Bands::T60, 0.1, 0.5).unwrap();
        MeshScene::new(&Scene::shoebox(SIZE_M, std::array::from_fn(|_| m.clone())).unwrap()).unwrap()
    }

    /// Follows a ray over `legs` surfaces and returns the length of each leg; panics if the ray is lost.
    fn follow(
        scene: &MeshScene,
        from: Vec3,
        towards: Vec3,
        scattering: f64,
        legs: usize,
        ray: u64,
    ) -> Vec<f64> {
        let mut random = generator(5, ray);
        let (mut origin, mut heading) = (from, unit(sub(towards, from)));
        (0..legs)
            .map(|leg| {
                let hit = next_hit(scene, origin, &mut heading, &mut random)
                    .unwrap_or_else(|| panic!("lost after {leg} legs from {origin:?} along {heading:?}"));
                let surface = &scene.surfaces.triangles[hit.triangle as usize];
                origin = before_hit(origin, heading, hit.distance);
                for axis in 0..3 {
                    assert!(origin[axis] > 0.0 && origin[axis] < SIZE_M[axis], "outside at {origin:?}");
                }
                let scattered = random.random::<f64>() < scattering;
                let reflection = if scattered { Reflection::Scattered } else { Reflection::Specular };
                heading = reflected(surface, heading, reflection, &mut random);
                hit.distance
            })
            .collect()
    }

    #[test]
    fn no_ray_is_lost_in_an_edge_or_a_corner() {
        let scene = the_box();
        let from = [2.0, 3.0, 1.5];
        for corner in 0..8usize {
            let at: Vec3 = std::array::from_fn(|i| SIZE_M[i] * (corner >> i & 1) as f64);
            follow(&scene, from, at, 0.0, 200, corner as u64);
            for axis in 0..3 {
                for step in 0..=50 {
                    let mut on_edge = at;
                    on_edge[axis] = SIZE_M[axis] * f64::from(step) / 50.0;
                    follow(&scene, from, on_edge, 0.0, 50, 0);
                    follow(&scene, from, on_edge, 0.5, 50, step as u64);
                }
            }
        }
        // Along the seams between the two triangles of a wall.
        for step in 0..=100 {
            let t = f64::from(step) / 100.0;
            follow(&scene, from, [t * SIZE_M[0], t * SIZE_M[1], 0.0], 0.0, 50, 0);
        }
    }

    #[test]
    fn the_mean_free_path_of_a_diffuse_room_is_4v_over_s() {
        let scene = the_box();
        let (rays, legs) = (400u64, 500);
        let means: Vec<f64> = (0..rays)
            .map(|ray| {
                let mut random = generator(17, ray);
                let towards = crate::vector::add([5.0, 3.5, 1.5], direction(&mut random));
                let lengths = follow(&scene, [5.0, 3.5, 1.5], towards, 1.0, legs + 5, ray);
                lengths[5..].iter().sum::<f64>() / legs as f64
            })
            .collect();
        let mean = means.iter().sum::<f64>() / rays as f64;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (rays - 1) as f64;
        let standard_error = (variance / rays as f64).sqrt();
        let expected = 4.0 * 210.0 / 242.0;
        assert!((mean - expected).abs() < 4.0 * standard_error, "{mean} +- {standard_error}, not {expected}");
        assert!(standard_error < 0.005 * expected);
    }
}
