//! The walls cut into patches, on which rays from both ends of a path meet.

use crate::surfaces::{Plane, Surfaces};
use crate::vector::{Vec3, cross, dot, unit};
use std::collections::HashMap;

/// At most about so many patches: large models get larger ones.
const MOST_PATCHES: f64 = 200_000.0;

/// A square grid on each plane. What counts of a patch is the area of wall within it: so an edge of a wall loses no energy.
pub(crate) struct Patches {
    frames: Vec<Frame>,
    side_m: f64,
    areas_m2: HashMap<Patch, f64>,
}

/// A square of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Patch {
    plane: u32,
    column: i32,
    row: i32,
    /// Which side of the plane a ray came from: rays on both sides of a screen do not meet.
    above: bool,
}

/// Axes of the grid on a plane.
struct Frame {
    right: Vec3,
    up: Vec3,
}

impl Frame {
    fn of(plane: &Plane) -> Self {
        let n = plane.normal;
        // The axis that is farthest from the normal.
        let axis = (0..3).min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs())).unwrap_or(0);
        let mut other = [0.0; 3];
        other[axis] = 1.0;
        let right = unit(cross(n, other));
        Self { right, up: cross(n, right) }
    }

    fn flat(&self, point: Vec3) -> [f64; 2] {
        [dot(self.right, point), dot(self.up, point)]
    }
}

impl Patches {
    /// Patches of about this side length.
    pub fn new(surfaces: &Surfaces, side_m: f64) -> Self {
        let total_m2: f64 = surfaces.triangles.iter().map(|t| t.area_m2).sum();
        let side_m = side_m.max((total_m2 / MOST_PATCHES).sqrt());
        let frames: Vec<Frame> = surfaces.planes.iter().map(Frame::of).collect();
        let mut areas_m2 = HashMap::new();
        for triangle in surfaces.triangles.iter().filter(|t| !t.is_degenerate()) {
            let corners =
                triangle.corners().map(|c| frames[triangle.plane as usize].flat(c).map(|x| x / side_m));
            let range = |axis: usize, part: &[[f64; 2]]| {
                let low = part.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
                let high = part.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
                low.floor() as i32..=high.floor() as i32
            };
            for column in range(0, &corners) {
                let strip = cut(&cut(&corners, 0, f64::from(column), 1.0), 0, f64::from(column + 1), -1.0);
                if strip.is_empty() {
                    continue;
                }
                for row in range(1, &strip) {
                    let square = cut(&cut(&strip, 1, f64::from(row), 1.0), 1, f64::from(row + 1), -1.0);
                    let area_m2 = area(&square) * side_m * side_m;
                    for above in [false, true] {
                        let patch = Patch { plane: triangle.plane, column, row, above };
                        *areas_m2.entry(patch).or_insert(0.0) += area_m2;
                    }
                }
            }
        }
        Self { frames, side_m, areas_m2 }
    }

    /// The patch of a point on a plane, met along `heading`.
    pub fn at(&self, plane_id: u32, plane: &Plane, point: Vec3, heading: Vec3) -> Patch {
        let [column, row] =
            self.frames[plane_id as usize].flat(point).map(|x| (x / self.side_m).floor() as i32);
        Patch { plane: plane_id, column, row, above: dot(heading, plane.normal) < 0.0 }
    }

    /// Area of wall within a patch in m2. Rounding may put a point at an edge of the wall into a square that has none of it:
    /// nobody meets there.
    pub fn area_m2(&self, patch: Patch) -> f64 {
        self.areas_m2.get(&patch).copied().unwrap_or(0.0)
    }

    /// Area of a full patch in m2.
    pub fn full_m2(&self) -> f64 {
        self.side_m * self.side_m
    }
}

/// The part of a convex polygon where `sign (coordinate - at)` is not negative (Sutherland and Hodgman 1974).
fn cut(polygon: &[[f64; 2]], axis: usize, at: f64, sign: f64) -> Vec<[f64; 2]> {
    let height = |p: &[f64; 2]| sign * (p[axis] - at);
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (from, to) = (height(p), height(q));
        if from >= 0.0 {
            kept.push(*p);
        }
        if (from >= 0.0) != (to >= 0.0) {
            let t = from / (from - to);
            kept.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
        }
    }
    kept
}

/// Area of a polygon (the shoelace formula).
fn area(polygon: &[[f64; 2]]) -> f64 {
    let crossed = |(i, p): (usize, &[f64; 2])| {
        let q = &polygon[(i + 1) % polygon.len()];
        p[0] * q[1] - p[1] * q[0]
    };
    0.5 * polygon.iter().enumerate().map(crossed).sum::<f64>().abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_scene::MeshScene;
    use sabine_acoustics::{Bands, Material};
    use sabine_scene::Scene;

    #[test]
    fn patches_hold_all_of_the_wall_and_no_more() {
        let m = Material::uniform(Bands::T60, 0.1, 0.5).unwrap();
        let scene = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| m.clone())).unwrap();
        let mesh = MeshScene::new(&scene).unwrap();
        let patches = Patches::new(&mesh.surfaces, 0.35);
        let sum: f64 = patches.areas_m2.values().sum();
        // Both sides of 242 m2.
        assert!((sum - 484.0).abs() < 1e-9, "{sum}");
        assert!(patches.areas_m2.values().all(|&a| a <= patches.full_m2() * (1.0 + 1e-12)));
        let floor = mesh.surfaces.triangles.iter().find(|t| t.material == 4).unwrap().plane;
        let plane = &mesh.surfaces.planes[floor as usize];
        let middle = patches.at(floor, plane, [5.0, 3.4, 0.0], [0.0, 0.0, -1.0]);
        assert!((patches.area_m2(middle) - 0.1225).abs() < 1e-9);
        assert_ne!(middle, patches.at(floor, plane, [5.0, 3.4, 0.0], [0.0, 0.0, 1.0]));
    }
}
