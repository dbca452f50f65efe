//! Walking from surface to surface.

use crate::random::lambert;
use crate::surfaces::Surface;
use crate::vector::{Vec3, along, dot, mirror, sub};
use rand::Rng;
use sabine_acoustics::{RayHit, RayScene, Reflection};

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
    scene.closest_hit(from, direction, distance - STEP_BACK_M).is_none()
}

/// A sphere about the receiver that counts the rays passing through: the mean energy density inside is the sum of energy
/// times chord over volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReceiverSphere {
    pub centre: Vec3,
    pub radius_m: f64,
}

impl ReceiverSphere {
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
