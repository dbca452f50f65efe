//! Vectors, directions drawn at random, and one ray against one triangle or sphere.

use rand::Rng;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

pub(crate) type Vec3 = [f64; 3];

pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Vec3, s: f64) -> Vec3 {
    a.map(|c| c * s)
}

pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Distance at which a ray of unit direction meets a triangle, from either side, or `None`.
///
/// Signed volumes of the ray with the three edges: an edge shared by two triangles gives both the same number with the opposite
/// sign, bit for bit, so that no ray slips through between them.
pub(crate) fn hit(origin: Vec3, direction: Vec3, corners: [Vec3; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|corner| sub(corner, origin));
    let (u, v, w) = (dot(direction, cross(c, b)), dot(direction, cross(a, c)), dot(direction, cross(b, a)));
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let sum = u + v + w;
    if !inside || sum == 0.0 {
        return None;
    }
    let distance = (u * dot(a, direction) + v * dot(b, direction) + w * dot(c, direction)) / sum;
    Some(distance)
}

/// The nearest triangle that a ray meets beyond `nearest` and within `farthest`, with its distance.
pub(crate) fn first_hit(
    triangles: &[[Vec3; 3]],
    origin: Vec3,
    direction: Vec3,
    nearest: f64,
    farthest: f64,
) -> Option<(usize, f64)> {
    let mut best = None;
    let mut limit = farthest;
    for (i, &corners) in triangles.iter().enumerate() {
        if let Some(distance) = hit(origin, direction, corners)
            && distance > nearest
            && distance <= limit
        {
            limit = distance;
            best = Some((i, distance));
        }
    }
    best
}

/// A direction on the whole sphere.
pub(crate) fn anywhere(random: &mut Pcg64Mcg) -> Vec3 {
    let z = 2.0 * random.random::<f64>() - 1.0;
    let azimuth = TAU * random.random::<f64>();
    let r = (1.0 - z * z).sqrt();
    [r * azimuth.cos(), r * azimuth.sin(), z]
}

/// A direction about a normal, as often as its cosine: the tip of a random unit vector set upon the normal's.
pub(crate) fn lambert(random: &mut Pcg64Mcg, normal: Vec3) -> Vec3 {
    loop {
        let sum = add(normal, anywhere(random));
        let length = norm(sum);
        if length > 1e-6 {
            return scale(sum, 1.0 / length);
        }
    }
}

/// Where a flight over `distance` enters and leaves a sphere about the origin.
pub(crate) fn chord(start: Vec3, direction: Vec3, radius: f64, distance: f64) -> Option<(f64, f64)> {
    let middle = -dot(start, direction);
    let square = radius * radius - (dot(start, start) - middle * middle);
    if square <= 0.0 {
        return None;
    }
    let half = square.sqrt();
    let (near, far) = ((middle - half).max(0.0), (middle + half).min(distance));
    (far > near).then_some((near, far))
}
