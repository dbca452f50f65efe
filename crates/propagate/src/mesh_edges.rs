//! Edges of a mesh that do not join two triangles, and whether something closes them all the same.

use crate::box_tree::{Bounds, BoxTree};
use crate::vector::{Vec3, cross, dot, norm, scale, sub, unit};
use sabine_scene::Scene;
use std::collections::HashSet;

/// Closer than this, an edge lies on a face (m): as far as two vertices may be apart that are meant to be one.
const CONTACT_M: f64 = Scene::WELD_TOLERANCE_M;
/// Pairs of edge and triangle that are looked at; in a heap of triangles without order every edge is near every triangle.
const MOST_PAIRS: u64 = 50_000_000;

/// An edge of a mesh that does not join two triangles.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MeshEdge {
    /// Its ends, in metres.
    pub ends_m: [[f64; 3]; 2],
    /// The triangles that have it, by index.
    pub triangles: Vec<usize>,
    /// The names of their materials, each once.
    pub materials: Vec<String>,
}

impl MeshEdge {
    /// Length in metres.
    pub fn length_m(&self) -> f64 {
        norm(sub(self.ends_m[1], self.ends_m[0]))
    }
}

impl std::fmt::Display for MeshEdge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [[a, b, c], [x, y, z]] = self.ends_m;
        let (length_m, materials) = (self.length_m(), self.materials.join(", "));
        write!(f, "{length_m:.3} m from ({a:.3}, {b:.3}, {c:.3}) to ({x:.3}, {y:.3}, {z:.3}), {materials}")
    }
}

/// Edges by what is odd about them, each kind longest first.
#[derive(Default)]
pub(crate) struct OddEdges {
    /// One triangle, and nothing that closes them.
    pub open: Vec<MeshEdge>,
    /// One triangle, and other faces along the whole length.
    pub resting: Vec<MeshEdge>,
    /// Three triangles or more.
    pub crowded: Vec<MeshEdge>,
    /// Number of edges whose two triangles are turned against each other.
    pub flipped: usize,
    /// Triangles on the same corners as an earlier one.
    pub duplicates: Vec<usize>,
}

/// Looks at every edge. `twins` tells which vertices are one; triangles for which `skip` holds are none.
pub(crate) fn odd_edges(scene: &Scene, twins: &[usize], skip: impl Fn(usize) -> bool) -> OddEdges {
    let mut odd = OddEdges::default();
    let mut seen = HashSet::new();
    let mut whole = Vec::new();
    // (end, end, triangle, whether it runs from the first end to the second)
    let mut edges: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(3 * scene.triangles().len());
    for (i, triangle) in scene.triangles().iter().enumerate() {
        let corners = triangle.vertices.map(|v| twins[v as usize] as u32);
        let [a, b, c] = corners;
        if skip(i) || a == b || b == c || c == a {
            continue;
        }
        let mut key = corners;
        key.sort_unstable();
        if !seen.insert(key) {
            odd.duplicates.push(i);
            continue;
        }
        whole.push(i);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            edges.push((p.min(q), p.max(q), i as u32, p < q));
        }
    }
    edges.sort_unstable();
    let mut single = Vec::new();
    for uses in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        match uses {
            [one] => single.push(described(scene, std::slice::from_ref(one))),
            [first, second] => odd.flipped += usize::from(first.3 == second.3),
            many => odd.crowded.push(described(scene, many)),
        }
    }
    let closed = closed_by_faces(scene, &single, &whole);
    for (edge, closed) in single.into_iter().zip(closed) {
        if closed { &mut odd.resting } else { &mut odd.open }.push(edge);
    }
    for list in [&mut odd.open, &mut odd.resting, &mut odd.crowded] {
        list.sort_by(|a, b| b.length_m().total_cmp(&a.length_m()));
    }
    odd
}

fn described(scene: &Scene, uses: &[(u32, u32, u32, bool)]) -> MeshEdge {
    let ends_m = [uses[0].0, uses[0].1].map(|v| scene.vertices()[v as usize]);
    let triangles: Vec<usize> = uses.iter().map(|u| u.2 as usize).collect();
    let mut materials = Vec::new();
    for &t in &triangles {
        let name = &scene.materials()[scene.triangles()[t].material as usize].name;
        if !materials.contains(name) {
            materials.push(name.clone());
        }
    }
    MeshEdge { ends_m, triangles, materials }
}

/// For each edge whether triangles other than its own touch it along its whole length.
fn closed_by_faces(scene: &Scene, edges: &[MeshEdge], triangles: &[usize]) -> Vec<bool> {
    let tree = BoxTree::new(edges.iter().map(|e| Bounds::around(&e.ends_m, CONTACT_M)).collect());
    let mut touched: Vec<Vec<(f64, f64)>> = vec![Vec::new(); edges.len()];
    let mut pairs = 0;
    if !edges.is_empty() {
        for &t in triangles {
            let corners = scene.corners_m(t);
            tree.overlapping(&Bounds::around(&corners, CONTACT_M), |e| {
                pairs += 1;
                if edges[e].triangles[0] != t {
                    touched[e].extend(contact_m(edges[e].ends_m, corners));
                }
            });
            // What is not looked at counts as open.
            if pairs > MOST_PAIRS {
                break;
            }
        }
    }
    let covered = |(edge, mut spans): (&MeshEdge, Vec<(f64, f64)>)| {
        spans.sort_by(|a, b| a.0.total_cmp(&b.0));
        let reached =
            spans.iter().fold(
                0.0,
                |reached: f64, &(from, to)| {
                    if from <= reached + CONTACT_M { reached.max(to) } else { reached }
                },
            );
        reached >= edge.length_m() - CONTACT_M
    };
    edges.iter().zip(touched).map(covered).collect()
}

/// The part of a segment that touches a triangle, as distances from the segment's first end in metres.
fn contact_m([from, to]: [Vec3; 2], corners: [Vec3; 3]) -> Option<(f64, f64)> {
    let length_m = norm(sub(to, from));
    let heading = scale(sub(to, from), 1.0 / length_m);
    let [a, b, c] = corners;
    let normal = unit(cross(sub(b, a), sub(c, a)));
    // Not past the triangle's own reach, where a sharp corner of the widened triangle would stand out.
    let reach = corners.map(|p| dot(sub(p, from), heading));
    let mut span_m = (
        reach.iter().copied().fold(f64::INFINITY, f64::min).max(0.0) - CONTACT_M,
        reach.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(length_m) + CONTACT_M,
    );
    // Within the contact distance of the plane, and of the inner side of each edge: `offset + t slope <= CONTACT_M`.
    let inward = |p: Vec3, q: Vec3| unit(cross(sub(q, p), normal));
    let walls =
        [(normal, a), (scale(normal, -1.0), a), (inward(a, b), a), (inward(b, c), b), (inward(c, a), c)];
    for (outward, on) in walls {
        let (offset, slope) = (dot(sub(from, on), outward) - CONTACT_M, dot(heading, outward));
        if slope.abs() < 1e-12 {
            if offset > 0.0 {
                return None;
            }
        } else if slope > 0.0 {
            span_m.1 = span_m.1.min(-offset / slope);
        } else {
            span_m.0 = span_m.0.max(-offset / slope);
        }
    }
    (span_m.0 < span_m.1).then_some(span_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOOR: [Vec3; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];

    fn contact(from: Vec3, to: Vec3) -> Option<(f64, f64)> {
        contact_m([from, to], FLOOR)
    }

    #[test]
    fn a_segment_touches_where_it_is_near() {
        let near = |found: Option<(f64, f64)>, from: f64, to: f64| {
            let (a, b) = found.unwrap();
            assert!((a - from).abs() < 3.0 * CONTACT_M && (b - to).abs() < 3.0 * CONTACT_M, "{a} {b}");
        };
        near(contact([0.5, 1.0, 0.0], [2.5, 1.0, 0.0]), 0.0, 2.0); // within
        near(contact([1.0, -1.0, 0.0], [1.0, 9.0, 0.0]), 1.0, 4.0); // across
        near(contact([0.0, 0.0, 5e-5], [4.0, 0.0, -5e-5]), 0.0, 4.0); // along an edge
        near(contact([-2.0, 1.0, 0.0], [2.0, 1.0, 0.0]), 2.0, 4.0); // from outside
        near(contact([1.0, 1.0, -1.0], [1.0, 1.0, 1.0]), 1.0, 1.0); // through
        assert_eq!(contact([0.5, 1.0, 2e-4], [2.5, 1.0, 2e-4]), None); // above
        assert_eq!(contact([3.0, 2.0, 0.0], [9.0, 2.0, 0.0]), None); // beside
        assert_eq!(contact([0.0, -2e-4, 0.0], [4.0, -2e-4, 0.0]), None);
    }

    #[test]
    fn a_needle_reaches_no_farther_than_its_tip() {
        let needle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1e-4, 0.0]];
        let (from, to) = contact_m([[0.5, 0.0, 0.0], [9.0, 0.0, 0.0]], needle).unwrap();
        assert!(from < 1e-3 && (to - 0.5).abs() < 1e-3, "{from} {to}");
    }
}
