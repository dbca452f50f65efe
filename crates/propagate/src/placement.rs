//! Whether source and receiver stand where sound can travel.

use crate::Error;
use crate::mesh_scene::MeshScene;
use crate::random::{direction, generator};
use crate::vector::{Vec3, along, norm, sub};
use sabine_acoustics::{RayScene, Receiver, Source};

/// Rays that probe the surroundings of a point.
const PROBES: u64 = 400;
/// Nearer than this to a surface, a point is on it; nearer to each other, two points are one (m).
const CONTACT_M: f64 = 1e-3;
/// A point of which more probes than this escape may be outside; of a closed room none do, from just outside half do.
const OUTSIDE: f64 = 0.05;
/// Share of probes that must cross an odd (even) number of surfaces for a point to be certainly in the room (in a body).
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

/// Checks source and receiver, and returns the distance of the receiver from the nearest surface in metres.
///
/// Single sheets (screens) and double walls change how many surfaces rays cross, so a count alone condemns no point: it
/// takes escaping rays to be outside, and a certain difference between source and receiver to be inside a body.
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
        if around[inner].odd < 1.0 - CERTAIN && around[outer].odd > CERTAIN {
            let (what, id, position_m) = points[inner];
            let even = 1.0 - around[inner].odd;
            return Err(Error::InsideBody { what, id: id.clone(), position_m, even });
        }
    }
    Ok(clearance_m)
}
