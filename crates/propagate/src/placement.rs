//! Whether source and receiver stand where sound can travel.

use crate::Error;
use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator};
use crate::surfaces::Surface;
use crate::vector::{Vec3, along, cross, dot, norm, sub};
use sabine_paths::RayScene;
use sabine_scene::{Receiver, Source};
use std::f64::consts::PI;

/// Rays that probe the surroundings of a point.
const PROBES: u64 = 400;
/// Nearer than this to a surface, a point is on it; nearer to each other, two points are one (m).
const CONTACT_M: f64 = 1e-3;
/// A point of which more probes than this escape may be outside; of a closed room none do, from just outside half do.
const OUTSIDE: f64 = 0.05;
/// Share of probes that must cross an odd (even) number of surfaces for a point to be certainly in the room (in a body);
/// its winding number must be as near to a whole number.
const CERTAIN: f64 = 0.9;
/// Crossings counted before a probe gives up: two bodies back to back may trap it.
const MAX_CROSSINGS: u64 = 10_000;

/// What rays from a point say about where it is, whichever way the triangles are turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surroundings {
    /// Share of rays that meet nothing.
    pub escaping: f64,
    /// Share of the rays that meet something and cross an odd number of surfaces.
    pub odd: f64,
}

impl Surroundings {
    pub fn of(scene: &MeshScene, point: Vec3) -> Self {
        let mut random = generator(0x5EED, 1);
        let (mut escaping, mut odd) = (0u64, 0u64);
        for _ in 0..PROBES {
            let heading = direction(&mut random);
            let mut crossings = 0u64;
            let mut origin = point;
            while let Some(hit) = scene.closest_hit(origin, heading, f64::INFINITY) {
                crossings += 1;
                if crossings == MAX_CROSSINGS {
                    break;
                }
                // Past coincident triangles as well.
                origin = along(origin, heading, hit.distance + 1e-6);
            }
            match crossings {
                0 => escaping += 1,
                n => odd += n % 2,
            }
        }
        let meeting = (PROBES - escaping).max(1);
        Self { escaping: escaping as f64 / PROBES as f64, odd: odd as f64 / meeting as f64 }
    }
}

/// How often the triangles surround a point, by their solid angles (van Oosterom and Strackee 1983; as a test of inside and
/// outside Jacobson et al. 2013). It changes by one from one side of a closed surface to the other: usually it is +1 or -1 in
/// a room, 0 in a body in it and outside. Near sheets, and where a surface is not turned alike, it is no whole number.
fn winding(scene: &MeshScene, point: Vec3) -> f64 {
    let solid_angle = |surface: &Surface| {
        let [a, b, c] = surface.corners().map(|corner| sub(corner, point));
        let [la, lb, lc] = [a, b, c].map(norm);
        let adjacent = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross(b, c)).atan2(adjacent)
    };
    scene.surfaces.triangles.iter().map(solid_angle).sum::<f64>() / (4.0 * PI)
}

/// Whether two winding numbers tell, without doubt, that something closed lies between two points.
fn differ(one: f64, other: f64) -> bool {
    let whole = |turns: f64| (turns - turns.round()).abs() < 1.0 - CERTAIN;
    whole(one) && whole(other) && one.round() != other.round()
}

/// Checks whether sound can leave a source and reach a receiver as far as their places tell, and returns the distance of the
/// receiver from the nearest surface in metres. [`PathTracer`](crate::PathTracer) asks the same.
///
/// Rays from both count the surfaces that they cross, whichever way these are turned. Single sheets (screens) and double
/// walls change how many there are, so a count alone condemns no point: it takes escaping rays to be outside, and a
/// certain difference between source and receiver to be inside a body. Where the count is in doubt (a body on the floor
/// shares a face with it), solid angles decide, if the triangles are turned alike.
///
/// # Errors
/// [`Error::Coincident`] and [`Error::OnSurface`] for less than 1 mm between the two or to a surface, [`Error::Outside`],
/// [`Error::InsideBody`].
pub fn check_placement(scene: &MeshScene, source: &Source, receiver: &Receiver) -> Result<f64, Error> {
    let distance_m = norm(sub(source.position_m, receiver.position_m));
    if distance_m < CONTACT_M {
        let (source_id, receiver_id) = (source.id.clone(), receiver.id.clone());
        return Err(Error::Coincident { source_id, receiver_id, distance_m });
    }
    let points = [("source", &source.id, source.position_m), ("receiver", &receiver.id, receiver.position_m)];
    let mut clearance_m = f64::INFINITY;
    for (what, id, position_m) in points {
        let (triangle, distance_m) = scene.nearest(position_m);
        if distance_m < CONTACT_M {
            return Err(Error::OnSurface { what, id: id.clone(), position_m, triangle, distance_m });
        }
        clearance_m = distance_m;
    }
    let around = points.map(|(_, _, position_m)| Surroundings::of(scene, position_m));
    for ((what, id, position_m), s) in points.into_iter().zip(around) {
        if s.escaping > OUTSIDE && s.odd < 0.5 {
            return Err(Error::Outside { what, id: id.clone(), position_m, escaping: s.escaping });
        }
    }
    for (inner, outer) in [(0, 1), (1, 0)] {
        let (what, id, position_m) = points[inner];
        let odd = around[inner].odd;
        let opposed = odd < 1.0 - CERTAIN && around[outer].odd > CERTAIN;
        // Of the two the one that is less surely in the room.
        let doubtful = odd <= CERTAIN && odd <= around[outer].odd;
        if opposed || doubtful && differ(winding(scene, position_m), winding(scene, points[outer].2)) {
            return Err(Error::InsideBody { what, id: id.clone(), position_m, even: 1.0 - odd });
        }
    }
    Ok(clearance_m)
}
