//! A polygon with holes, cut into triangles.

use crate::vector::Vec3;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::HashMap;

/// The triangles cover what the outline encloses, to this share of its area.
const SAME_AREA: f64 = 1e-9;
/// spade refuses numbers nearer to zero than about 1e-43: these are zero.
const LEAST_COORDINATE: f64 = 1e-40;

/// Cuts what lies to the left of directed segments, seen against `normal`, into triangles without new vertices. `None` if
/// segments cross or anything is enclosed more than once: then no triangulation covers the same points once.
///
/// Seen along the axis that is nearest to the normal, vertices keep two of their coordinates as they are, and spade decides
/// by exact predicates: nothing is rounded.
pub(super) fn triangulated(points: &[Vec3], segments: &[[u32; 2]], normal: Vec3) -> Option<Vec<[u32; 3]>> {
    let axis = (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    let (right, up) = ((axis + 1) % 3, (axis + 2) % 3);
    let clean = |c: f64| if c.abs() < LEAST_COORDINATE { 0.0 } else { c };
    let mut place = HashMap::with_capacity(segments.len());
    let mut vertices: Vec<u32> = Vec::with_capacity(segments.len());
    let mut number = |vertex: u32| {
        *place.entry(vertex).or_insert_with(|| {
            vertices.push(vertex);
            vertices.len() - 1
        })
    };
    let lines: Vec<[usize; 2]> = segments.iter().map(|&[a, b]| [number(a), number(b)]).collect();
    let flat: Vec<Point2<f64>> = vertices
        .iter()
        .map(|&v| Point2::new(clean(points[v as usize][right]), clean(points[v as usize][up])))
        .collect();

    let mut crossing = false;
    let mesh = ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(
        flat.clone(),
        lines.clone(),
        |_| crossing = true,
    )
    .ok()?;
    if crossing || mesh.num_vertices() != vertices.len() {
        return None;
    }
    // Inside and outside change at each segment.
    let mut inside: Vec<Option<bool>> = vec![None; mesh.num_all_faces()];
    inside[mesh.outer_face().index()] = Some(false);
    let mut waiting = Vec::new();
    for edge in mesh.convex_hull() {
        let inner = edge.rev();
        if let (Some(face), false) = (inner.face().as_inner(), edge.face().as_inner().is_some()) {
            let within = inner.as_undirected().data().is_constraint_edge();
            if inside[face.index()].replace(within).is_none() {
                waiting.push(face);
            }
        }
    }
    while let Some(face) = waiting.pop() {
        let here = inside[face.index()]?;
        for edge in face.adjacent_edges() {
            if let Some(next) = edge.rev().face().as_inner()
                && inside[next.index()].is_none()
            {
                inside[next.index()] = Some(here != edge.as_undirected().data().is_constraint_edge());
                waiting.push(next);
            }
        }
    }
    // Areas are doubled. What segments enclose counts as often as they do so, the triangles count once.
    let twice_area = |[a, b, c]: [Point2<f64>; 3]| (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    let turn = normal[axis].signum();
    let about = *flat.first()?;
    let enclosed: f64 = lines.iter().map(|&[a, b]| turn * twice_area([about, flat[a], flat[b]])).sum();
    let mut covered = 0.0;
    let mut triangles = Vec::new();
    for face in mesh.inner_faces().filter(|face| inside[face.index()] == Some(true)) {
        let corners = face.vertices().map(|corner| corner.index());
        covered += twice_area(corners.map(|i| flat[i]));
        let [a, b, c] = corners.map(|i| vertices[i]);
        triangles.push(if turn > 0.0 { [a, b, c] } else { [a, c, b] });
    }
    ((covered - enclosed).abs() <= SAME_AREA * covered && !triangles.is_empty()).then_some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{cross, dot, sub};

    const UP: Vec3 = [0.0, 0.0, 1.0];

    fn ring(first: u32, count: u32) -> impl Iterator<Item = [u32; 2]> {
        (0..count).map(move |i| [first + i, first + (i + 1) % count])
    }

    fn area(points: &[Vec3], triangles: &[[u32; 3]], normal: Vec3) -> f64 {
        let one = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| points[v as usize]);
            0.5 * dot(cross(sub(b, a), sub(c, a)), normal)
        };
        assert!(triangles.iter().all(|t| one(t) > 0.0), "a triangle on its back");
        triangles.iter().map(one).sum()
    }

    /// A square of side 4 about one of side 2, whose vertices run the other way.
    fn frame(x: usize, y: usize) -> Vec<Vec3> {
        let corner = |a: f64, b: f64| {
            let mut p = [0.5; 3];
            (p[x], p[y]) = (a, b);
            p
        };
        let outer = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)];
        let inner = [(1.0, 1.0), (1.0, 3.0), (3.0, 3.0), (3.0, 1.0)];
        outer.into_iter().chain(inner).map(|(a, b)| corner(a, b)).collect()
    }

    #[test]
    fn a_frame_keeps_its_hole_whichever_way_it_faces() {
        for (x, y, normal) in [
            (0, 1, UP),
            (1, 0, [0.0, 0.0, -1.0]),
            (1, 2, [1.0, 0.0, 0.0]),
            (2, 1, [-1.0, 0.0, 0.0]),
            (2, 0, [0.0, 1.0, 0.0]),
        ] {
            let points = frame(x, y);
            let segments: Vec<[u32; 2]> = ring(0, 4).chain(ring(4, 4)).collect();
            let triangles = triangulated(&points, &segments, normal).unwrap();
            assert_eq!(triangles.len(), 8);
            assert!((area(&points, &triangles, normal) - 12.0).abs() < 1e-12);
        }
    }

    #[test]
    fn an_island_in_a_hole_is_inside_again() {
        let mut points = frame(0, 1);
        points.extend([[1.5, 1.5, 0.5], [2.5, 1.5, 0.5], [2.0, 2.5, 0.5]]);
        let segments: Vec<[u32; 2]> = ring(0, 4).chain(ring(4, 4)).chain(ring(8, 3)).collect();
        let triangles = triangulated(&points, &segments, UP).unwrap();
        assert!((area(&points, &triangles, UP) - 12.5).abs() < 1e-12);
    }

    #[test]
    fn outlines_that_cross_or_cover_twice_are_refused() {
        // A bow tie.
        let points = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let bow: Vec<[u32; 2]> = ring(0, 4).collect();
        assert_eq!(triangulated(&points, &bow, UP), None);
        // A square within a square, both counting.
        let mut points = frame(0, 1);
        points[4..].reverse();
        let both: Vec<[u32; 2]> = ring(0, 4).chain(ring(4, 4)).collect();
        assert_eq!(triangulated(&points, &both, UP), None);
        // Seen from behind.
        assert_eq!(triangulated(&frame(0, 1), &ring(0, 4).collect::<Vec<_>>(), [0.0, 0.0, -1.0]), None);
    }

    #[test]
    fn two_vertices_at_one_place_are_refused() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1e-9]];
        assert_eq!(triangulated(&points, &ring(0, 4).collect::<Vec<_>>(), UP), None);
    }
}
