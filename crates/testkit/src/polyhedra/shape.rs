//! Rooms that are no box: prisms over a polygon under a level or sloping ceiling, and boxes that stand in them.

use crate::geometry::{Vec3, cross, dot, first_hit, norm, scale, sub};
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use sabine_acoustics::Error;
use sabine_scene::{NamedMaterial, Scene, Triangle};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Places are so far from every surface, and from each other, in metres.
const FROM_SURFACES_M: f64 = 0.65;
const APART_M: f64 = 0.8;
/// Directions in which the distance to a surface is looked for.
const DIRECTIONS: usize = 400;
/// Obstacles stand on feet of this height, so that the mesh is closed everywhere, in metres.
const FEET_M: f64 = 0.1;
/// Faces by material: walls take turns.
pub(super) const WALLS: [usize; 2] = [0, 1];
pub(super) const FLOOR: usize = 2;
pub(super) const CEILING: usize = 3;
pub(super) const FURNITURE: usize = 4;

/// Kind of a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Polyhedron {
    /// An L under a level ceiling.
    L,
    /// A rectangle under a ceiling that rises from 2.3-2.7 m to 3.2-4.2 m.
    SlopedCeiling,
    /// Four walls of which no two are parallel, under a ceiling that slopes a little.
    Wedge,
    /// A rectangle with two pieces of furniture, which the mesh has.
    Furnished,
}

impl Polyhedron {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::L, Self::SlopedCeiling, Self::Wedge, Self::Furnished];
}

/// A room by its measures, from which meshes follow.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// Floor plan, counter-clockwise; every corner is seen from the first.
    plan: Vec<[f64; 2]>,
    /// Height of the ceiling: at the origin, and its rise per metre along x and y.
    ceiling: [f64; 3],
    /// Lowest and highest corner of each obstacle.
    obstacles: Vec<[Vec3; 2]>,
}

impl Shape {
    pub fn draw(kind: Polyhedron, random: &mut Pcg64Mcg) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let rectangle = |x: f64, y: f64| vec![[0.0, 0.0], [x, 0.0], [x, y], [0.0, y]];
        match kind {
            Polyhedron::L => {
                let (x, y) = (between(6.0, 9.0), between(5.0, 8.0));
                let (inner_x, inner_y) = (x * between(0.4, 0.6), y * between(0.4, 0.6));
                // The corner that stands out into the room sees all others.
                let plan =
                    [[inner_x, inner_y], [inner_x, y], [0.0, y], [0.0, 0.0], [x, 0.0], [x, inner_y]].into();
                Self { plan, ceiling: [between(2.6, 3.4), 0.0, 0.0], obstacles: Vec::new() }
            }
            Polyhedron::SlopedCeiling => {
                let (x, y) = (between(4.0, 7.0), between(3.5, 6.0));
                let (low, high) = (between(2.3, 2.7), between(3.2, 4.2));
                Self { plan: rectangle(x, y), ceiling: [low, 0.0, (high - low) / y], obstacles: Vec::new() }
            }
            Polyhedron::Wedge => {
                let (x, y) = (between(5.0, 8.0), between(4.0, 6.0));
                let plan = vec![
                    [0.0, 0.0],
                    [x, between(0.2, 0.7)],
                    [x - between(0.3, 0.9), y],
                    [between(0.3, 0.9), y - between(0.3, 0.9)],
                ];
                let rise = between(-0.08, 0.08);
                Self { plan, ceiling: [between(2.8, 3.4), rise, between(0.02, 0.06)], obstacles: Vec::new() }
            }
            Polyhedron::Furnished => {
                let (x, y) = (between(5.0, 8.0), between(4.0, 6.5));
                let mut shape = Self {
                    plan: rectangle(x, y),
                    ceiling: [between(2.5, 3.2), 0.0, 0.0],
                    obstacles: Vec::new(),
                };
                let cupboard = [between(1.4, 2.0), between(0.5, 0.7), between(1.6, 2.0)];
                let table = [between(1.4, 2.0), between(0.7, 0.9), between(0.7, 0.8)];
                let along = between(0.3, x - 2.3);
                shape.stand([along, y - 0.05 - cupboard[1]], cupboard);
                let place = [between(1.0, x - 3.0), between(0.8, 0.5 * y - 0.9)];
                shape.stand(place, table);
                shape
            }
        }
    }

    /// Puts a box of these sides with its lowest corner over a place of the floor.
    pub fn stand(&mut self, [x, y]: [f64; 2], sides: Vec3) {
        self.obstacles.push([[x, y, FEET_M], [x + sides[0], y + sides[1], FEET_M + sides[2]]]);
    }

    /// The number of walls.
    pub fn walls(&self) -> usize {
        self.plan.len()
    }

    /// Volume in cubic metres, without that of obstacles.
    pub fn volume_m3(&self) -> f64 {
        let n = self.plan.len();
        // A prism under a plane holds its area times the height over its centroid; three corners at a time.
        (1..n - 1)
            .map(|i| {
                let [a, b, c] = [self.plan[0], self.plan[i], self.plan[i + 1]];
                let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
                area * self.height([(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0])
            })
            .sum()
    }

    /// A wall (from a corner of the plan to the next): its outward normal and a point of it.
    pub fn wall(&self, wall: usize) -> (Vec3, Vec3) {
        let (from, to) = (self.plan[wall], self.plan[(wall + 1) % self.plan.len()]);
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        ([along[1] / length, -along[0] / length, 0.0], [from[0], from[1], 0.0])
    }

    /// Size of the box about it.
    pub fn extent(&self) -> Vec3 {
        let largest = |k: usize| self.plan.iter().map(|p| p[k]).fold(0.0, f64::max);
        let heights = self.plan.iter().map(|p| self.height(*p));
        [largest(0), largest(1), heights.fold(0.0, f64::max)]
    }

    fn height(&self, [x, y]: [f64; 2]) -> f64 {
        self.ceiling[0] + self.ceiling[1] * x + self.ceiling[2] * y
    }

    /// The same with a wall, from a corner of the plan to the next, farther out; the walls beside it go on straight.
    pub fn with_wall_moved(&self, wall: usize, offset_m: f64) -> Self {
        let n = self.plan.len();
        let line = |i: usize| {
            let (normal, point) = self.wall(i % n);
            (normal, dot(normal, point) + if i % n == wall { offset_m } else { 0.0 })
        };
        let mut plan = self.plan.clone();
        for (end, beside) in [(wall, wall + n - 1), (wall + 1, wall + 1)] {
            let ((a, p), (b, q)) = (line(wall), line(beside % n));
            let determinant = a[0] * b[1] - a[1] * b[0];
            plan[end % n] = [(p * b[1] - q * a[1]) / determinant, (a[0] * q - b[0] * p) / determinant];
        }
        Self { plan, ..self.clone() }
    }

    /// The mesh. Materials are those of [`WALLS`] in turn, [`FLOOR`], [`CEILING`] and [`FURNITURE`], as far as they occur.
    pub fn scene(&self, materials: Vec<NamedMaterial>) -> Result<Scene, Error> {
        let n = self.plan.len() as u32;
        let mut vertices: Vec<Vec3> = self.plan.iter().map(|p| [p[0], p[1], 0.0]).collect();
        vertices.extend(self.plan.iter().map(|p| [p[0], p[1], self.height(*p)]));
        let mut triangles = Vec::new();
        let mut add = |corners: [u32; 3], material: usize| {
            triangles.push(Triangle { vertices: corners, material: material as u32 });
        };
        for i in 0..n {
            let (next, material) = ((i + 1) % n, WALLS[i as usize % WALLS.len()]);
            add([i, next, n + next], material);
            add([i, n + next, n + i], material);
        }
        for i in 1..n - 1 {
            add([0, i + 1, i], FLOOR);
            add([n, n + i, n + i + 1], CEILING);
        }
        for [low, high] in &self.obstacles {
            let first = vertices.len() as u32;
            vertices.extend((0..8).map(|i: usize| -> Vec3 {
                std::array::from_fn(|k| if i >> k & 1 == 0 { low[k] } else { high[k] })
            }));
            for [a, b, c, d] in
                [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
            {
                add([first + a, first + b, first + c], FURNITURE);
                add([first + a, first + c, first + d], FURNITURE);
            }
        }
        Scene::new(vertices, triangles, materials)
    }
}

/// Whether a place is in the room, in no obstacle, and so far from all surfaces.
pub(super) fn is_free(triangles: &[[Vec3; 3]], place: Vec3, from_surfaces_m: f64) -> bool {
    // Along a line that meets no edge, a place in the open meets surfaces an odd number of times.
    let up = [0.0137, 0.0071, 1.0];
    let up = scale(up, 1.0 / norm(up));
    let crossings =
        triangles.iter().filter(|t| crate::geometry::hit(place, up, **t).is_some_and(|d| d > 0.0)).count();
    let direction = |i: usize| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / DIRECTIONS as f64;
        let (azimuth, r) = (TAU * i as f64 * 0.618_033_988_75, (1.0 - z * z).sqrt());
        [r * azimuth.cos(), r * azimuth.sin(), z]
    };
    crossings % 2 == 1
        && (0..DIRECTIONS).all(|i| first_hit(triangles, place, direction(i), 0.0, from_surfaces_m).is_none())
}

/// Draws places, the first for the source. At least half of the others see it. `None` where none are found.
pub(super) fn places(
    triangles: &[[Vec3; 3]],
    extent: Vec3,
    count: usize,
    random: &mut Pcg64Mcg,
) -> Option<Vec<Vec3>> {
    const TRIES: usize = 5000;
    let mut found: Vec<Vec3> = Vec::new();
    let mut hidden = 0;
    for _ in 0..TRIES {
        if found.len() > count {
            return Some(found);
        }
        let mut place = extent.map(|side| side * random.random::<f64>());
        place[2] = 0.9 + 1.1 * random.random::<f64>();
        let apart = found.iter().all(|other| norm(sub(place, *other)) > APART_M);
        if !apart || !is_free(triangles, place, FROM_SURFACES_M) {
            continue;
        }
        if let Some(&source) = found.first()
            && !sees(triangles, source, place)
        {
            if 2 * (hidden + 1) > count {
                continue;
            }
            hidden += 1;
        }
        found.push(place);
    }
    None
}

/// Whether nothing is between two places.
pub(super) fn sees(triangles: &[[Vec3; 3]], from: Vec3, to: Vec3) -> bool {
    let way = sub(to, from);
    let length = norm(way);
    first_hit(triangles, from, scale(way, 1.0 / length), 1e-9, length).is_none()
}

/// A plane of the mesh: its unit normal, its distance from the origin along it, and its triangles.
pub(super) struct Plane {
    pub normal: Vec3,
    pub offset: f64,
    pub triangles: Vec<usize>,
}

/// The planes in which triangles lie.
pub(super) fn planes(triangles: &[[Vec3; 3]]) -> Vec<Plane> {
    let mut found: Vec<Plane> = Vec::new();
    for (index, [a, b, c]) in triangles.iter().enumerate() {
        let normal = cross(sub(*b, *a), sub(*c, *a));
        let normal = scale(normal, 1.0 / norm(normal));
        let offset = dot(normal, *a);
        let same = |p: &&mut Plane| {
            let side = dot(p.normal, normal).signum();
            norm(sub(p.normal, scale(normal, side))) < 1e-9 && (p.offset - side * offset).abs() < 1e-9
        };
        match found.iter_mut().find(same) {
            Some(plane) => plane.triangles.push(index),
            None => found.push(Plane { normal, offset, triangles: vec![index] }),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::laboratory::stream::{Purpose, stream};
    use sabine_acoustics::{Bands, Material};

    fn materials() -> Vec<NamedMaterial> {
        let material = Material::uniform(Bands::T60, 0.1, 0.1).unwrap();
        (0..5).map(|i| NamedMaterial { name: format!("m{i}"), material: material.clone() }).collect()
    }

    /// Volume by the divergence theorem over faces turned outward: known for prisms in closed form.
    fn area(plan: &[[f64; 2]]) -> f64 {
        let next = |i: usize| plan[(i + 1) % plan.len()];
        0.5 * (0..plan.len()).map(|i| plan[i][0] * next(i)[1] - next(i)[0] * plan[i][1]).sum::<f64>()
    }

    #[test]
    fn planes_and_walls_are_as_many_as_the_shape_has() {
        for (kind, count) in [
            (Polyhedron::L, 8),
            (Polyhedron::SlopedCeiling, 6),
            (Polyhedron::Wedge, 6),
            (Polyhedron::Furnished, 17),
        ] {
            let shape = Shape::draw(kind, &mut stream(3, Purpose::Room, 0));
            let triangles = crate::brute_force::corners(&shape.scene(materials()).unwrap());
            // Both pieces of furniture stand on feet of one height.
            assert_eq!(planes(&triangles).len(), count, "{kind:?}");
            assert!(area(&shape.plan) > 0.0, "{kind:?}: counter-clockwise");
        }
    }

    #[test]
    fn a_wall_moves_along_its_normal_alone() {
        for kind in Polyhedron::ALL {
            let shape = Shape::draw(kind, &mut stream(5, Purpose::Room, 0));
            for wall in 0..shape.walls() {
                let moved = shape.with_wall_moved(wall, 0.3);
                let before = planes(&crate::brute_force::corners(&shape.scene(materials()).unwrap()));
                let after = planes(&crate::brute_force::corners(&moved.scene(materials()).unwrap()));
                let changed: Vec<f64> = before
                    .iter()
                    .zip(&after)
                    .filter(|(a, b)| {
                        norm(sub(a.normal, b.normal)) > 1e-9 || (a.offset - b.offset).abs() > 1e-9
                    })
                    .map(|(a, b)| (b.offset - a.offset).abs())
                    .collect();
                assert_eq!(changed.len(), 1, "{kind:?} {wall}");
                assert!((changed[0] - 0.3).abs() < 1e-9, "{kind:?} {wall}: {changed:?}");
            }
        }
    }

    #[test]
    fn places_are_in_the_open() {
        let shape = Shape::draw(Polyhedron::Furnished, &mut stream(7, Purpose::Room, 0));
        let triangles = crate::brute_force::corners(&shape.scene(materials()).unwrap());
        let mut random = stream(7, Purpose::Places, 0);
        for place in places(&triangles, shape.extent(), 12, &mut random).unwrap() {
            for [low, high] in &shape.obstacles {
                let beside = |k: usize| (low[k] - place[k]).max(place[k] - high[k]).max(0.0);
                let away = beside(0).hypot(beside(1)).hypot(beside(2));
                assert!(away > FROM_SURFACES_M - 0.1, "{place:?}: {away}");
            }
            assert!(place[2] < shape.height([place[0], place[1]]) - 0.5);
        }
    }
}
