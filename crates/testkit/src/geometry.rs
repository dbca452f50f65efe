//! Vectors, and one ray against one triangle.

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
