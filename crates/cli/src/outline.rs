//! A mesh as lines, for plans.

use sabine::scene::Scene;
use std::collections::BTreeMap;

/// Edges between triangles whose normals agree so far belong to one face and are not drawn (cosine).
const FLAT: f64 = 0.9999;

/// A place in metres.
pub type Point = [f64; 3];

/// A side that triangles share, and their normals.
struct Edge {
    ends: [Point; 2],
    normals: Vec<Point>,
}

/// What tells a line from others, to a tenth of a millimetre and in either direction.
pub fn key(line: [Point; 2]) -> [[i64; 3]; 2] {
    let mut ends = line.map(|p| p.map(|c| (c * 1e4).round() as i64));
    ends.sort_unstable();
    ends
}

/// Edges of the mesh at which it bends or ends, by position: neighbouring triangles need not share vertices.
pub fn outlines(scene: &Scene) -> Vec<[Point; 2]> {
    let mut edges: BTreeMap<[[i64; 3]; 2], Edge> = BTreeMap::new();
    for i in 0..scene.triangles().len() {
        let corners = scene.corners_m(i);
        let side = |a: Point, b: Point| -> Point { std::array::from_fn(|k| b[k] - a[k]) };
        let (u, v) = (side(corners[0], corners[1]), side(corners[0], corners[2]));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length < 1e-12 {
            continue;
        }
        let normal = n.map(|c| c / length);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            edges
                .entry(key([a, b]))
                .or_insert_with(|| Edge { ends: [a, b], normals: Vec::new() })
                .normals
                .push(normal);
        }
    }
    let bends = |normals: &[Point]| {
        let cosine = |n: &Point| (0..3).map(|k| n[k] * normals[0][k]).sum::<f64>().abs();
        normals.len() == 1 || normals.iter().any(|n| cosine(n) < FLAT)
    };
    edges.into_values().filter(|edge| bends(&edge.normals)).map(|edge| edge.ends).collect()
}
