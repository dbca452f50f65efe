//! Polygons of a mesh file, cut into triangles.

use crate::error::Error;

/// Triangles, as indices into `points`, that cover a polygon: convex, concave, with keyholes, or not quite flat.
///
/// Ears are clipped in the projection along the polygon's mean (Newell) normal, and every corner is used, so that faces that
/// met along an edge still do. A polygon without area gives none.
///
/// # Errors
/// [`Error::CrossedPolygon`] if the outline crosses itself.
pub(crate) fn triangulate(points: &[[f64; 3]]) -> Result<Vec<[usize; 3]>, Error> {
    let normal = newell_normal(points);
    let extent = extent(points);
    // Relative to the polygon's own size, so that neither a doll's house nor a cathedral is special.
    let flat = 1e-12 * extent * extent;
    let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length <= flat {
        return if points.len() <= 3 || is_line(points, extent) {
            Ok(Vec::new())
        } else {
            Err(Error::CrossedPolygon)
        };
    }
    let plane = project(points, normal);
    let mut outline: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len().saturating_sub(2));
    let mut at = 0;
    // Corners looked at since the last ear: once around without one means that none is left.
    let mut idle = 0;
    while outline.len() > 2 && idle < outline.len() {
        let n = outline.len();
        let corner = [outline[(at + n - 1) % n], outline[at % n], outline[(at + 1) % n]];
        if is_ear(&plane, &outline, corner, flat) {
            triangles.push(corner);
            outline.remove(at % n);
            at %= n;
            idle = 0;
        } else {
            at = (at + 1) % n;
            idle += 1;
        }
    }
    // What is left must be a line: corners in the middle of an edge whose neighbours were clipped.
    let rest: f64 = (0..outline.len())
        .map(|i| {
            let (a, b) = (plane[outline[i]], plane[outline[(i + 1) % outline.len()]]);
            a[0] * b[1] - a[1] * b[0]
        })
        .sum();
    if outline.len() > 2 && rest.abs() > 1e3 * flat { Err(Error::CrossedPolygon) } else { Ok(triangles) }
}

/// Twice the vector area (Newell's method): along the mean normal, whatever corners stand out of the plane.
fn newell_normal(points: &[[f64; 3]]) -> [f64; 3] {
    let mut normal = [0.0; 3];
    let origin = points.first().copied().unwrap_or_default();
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % points.len()];
        let (p, q) = ([0, 1, 2].map(|k| p[k] - origin[k]), [0, 1, 2].map(|k| q[k] - origin[k]));
        normal[0] += p[1] * q[2] - p[2] * q[1];
        normal[1] += p[2] * q[0] - p[0] * q[2];
        normal[2] += p[0] * q[1] - p[1] * q[0];
    }
    normal
}

/// Coordinates in the plane across a normal, seen so that the outline turns left.
fn project(points: &[[f64; 3]], normal: [f64; 3]) -> Vec<[f64; 2]> {
    let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
    let n = normal.map(|c| c / length);
    // Start from the axis that is farthest from the normal.
    let axis = (0..3).fold(0, |best, k| if n[k].abs() < n[best].abs() { k } else { best });
    let mut u = [0, 1, 2].map(|k| -n[axis] * n[k]);
    u[axis] += 1.0;
    let size = u.iter().map(|c| c * c).sum::<f64>().sqrt();
    let u = u.map(|c| c / size);
    let v = [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]];
    let along = |p: &[f64; 3], axis: [f64; 3]| (0..3).map(|k| (p[k] - points[0][k]) * axis[k]).sum::<f64>();
    points.iter().map(|p| [along(p, u), along(p, v)]).collect()
}

fn is_ear(plane: &[[f64; 2]], outline: &[usize], corner: [usize; 3], flat: f64) -> bool {
    let [a, b, c] = corner.map(|i| plane[i]);
    if turn(a, b, c) <= flat {
        return false;
    }
    outline.iter().all(|&i| {
        let p = plane[i];
        // Corners that coincide with one of the ear's (keyholes) do not stand in its way.
        let outside = turn(a, b, p) < -flat || turn(b, c, p) < -flat || turn(c, a, p) < -flat;
        p == a || p == b || p == c || outside
    })
}

/// Twice the area of a triangle, positive if it turns left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn extent(points: &[[f64; 3]]) -> f64 {
    (0..3)
        .map(|k| {
            let low = points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
            let high = points.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
            high - low
        })
        .fold(0.0, f64::max)
}

fn is_line(points: &[[f64; 3]], extent: f64) -> bool {
    // The far end as seen from the first corner gives the direction.
    let from = points[0];
    let offset = |p: &[f64; 3]| [0, 1, 2].map(|k| p[k] - from[k]);
    let square = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>();
    let Some(far) = points.iter().map(offset).max_by(|a, b| square(*a).total_cmp(&square(*b))) else {
        return true;
    };
    points.iter().map(offset).all(|p| {
        let cross =
            [far[1] * p[2] - far[2] * p[1], far[2] * p[0] - far[0] * p[2], far[0] * p[1] - far[1] * p[0]];
        square(cross).sqrt() <= 1e-9 * extent * extent
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(points: &[[f64; 3]], triangles: &[[usize; 3]]) -> f64 {
        let one = |t: &[usize; 3]| {
            newell_normal(&t.map(|i| points[i])).iter().map(|c| c * c).sum::<f64>().sqrt() / 2.0
        };
        triangles.iter().map(one).sum()
    }

    /// A plane that leans in all three axes.
    fn lean(p: [f64; 2]) -> [f64; 3] {
        let (u, v) = ([0.6, 0.8, 0.0], [-0.48, 0.36, 0.8]);
        [0, 1, 2].map(|k| 5.0 + p[0] * u[k] + p[1] * v[k])
    }

    #[test]
    fn an_l_is_covered_without_its_notch() {
        let l = [[0., 0.], [4., 0.], [4., 1.], [1., 1.], [1., 3.], [0., 3.]].map(lean);
        for turn in 0..l.len() {
            let mut points = l;
            points.rotate_left(turn);
            let triangles = triangulate(&points).unwrap();
            assert_eq!(triangles.len(), 4);
            assert!((area(&points, &triangles) - 6.0).abs() < 1e-9);
            points.reverse();
            assert!((area(&points, &triangulate(&points).unwrap()) - 6.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_corner_in_the_middle_of_an_edge_stays_a_corner() {
        let square = [[0., 0.], [1., 0.], [2., 0.], [2., 2.], [0., 2.]].map(lean);
        let triangles = triangulate(&square).unwrap();
        assert_eq!(triangles.len(), 3);
        assert!(triangles.iter().flatten().any(|&i| i == 1));
        assert!((area(&square, &triangles) - 4.0).abs() < 1e-9);
    }

    #[test]
    fn a_keyhole_leaves_the_hole_open() {
        let ring = [
            [0., 0.],
            [3., 0.],
            [3., 3.],
            [0., 3.],
            [0., 0.],
            [1., 1.],
            [1., 2.],
            [2., 2.],
            [2., 1.],
            [1., 1.],
        ];
        let points = ring.map(lean);
        assert!((area(&points, &triangulate(&points).unwrap()) - 8.0).abs() < 1e-9);
    }

    #[test]
    fn lines_vanish_and_crossed_outlines_are_refused() {
        assert!(triangulate(&[[0., 0.], [1., 0.], [3., 0.], [2., 0.]].map(lean)).unwrap().is_empty());
        assert!(triangulate(&[[1., 1.]; 4].map(lean)).unwrap().is_empty());
        let even = [[0., 0.], [1., 1.], [1., 0.], [0., 1.]].map(lean);
        assert!(matches!(triangulate(&even), Err(Error::CrossedPolygon)));
        let uneven = [[0., 0.], [2., 2.], [2., 0.], [0., 1.]].map(lean);
        assert!(matches!(triangulate(&uneven), Err(Error::CrossedPolygon)));
    }

    proptest! {
        /// Star-shaped outlines of random radii, not quite flat.
        #[test]
        fn stars_are_covered_once(radii in prop::collection::vec(0.2f64..1.0, 3..40), bump in 0.0f64..0.01) {
            let n = radii.len();
            let points: Vec<_> = radii.iter().enumerate().map(|(i, r)| {
                let angle = std::f64::consts::TAU * i as f64 / n as f64;
                let [x, y, z] = lean([r * angle.cos(), r * angle.sin()]);
                [x, y, z + if i % 2 == 0 { bump } else { 0.0 }]
            }).collect();
            let triangles = triangulate(&points).unwrap();
            prop_assert_eq!(triangles.len(), n - 2);
            // Seen along the mean normal, every triangle faces the viewer and their areas add up.
            let whole = newell_normal(&points);
            let seen = |t: &[usize; 3]| {
                let own = newell_normal(&t.map(|i| points[i]));
                own.iter().zip(whole).map(|(a, b)| a * b).sum::<f64>()
            };
            let square = whole.iter().map(|c| c * c).sum::<f64>();
            prop_assert!(triangles.iter().all(|t| seen(t) > 0.0));
            prop_assert!((triangles.iter().map(seen).sum::<f64>() / square - 1.0).abs() < 1e-9);
        }
    }
}
