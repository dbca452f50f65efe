//! The flat surfaces of a mesh.

use sabine_scene::Scene;
use std::collections::HashMap;

/// Triangles whose normals differ by less (one less their cosine), and whose planes by less than this in metres, lie in one plane.
pub(crate) const TILT: f64 = 1e-4;
pub(crate) const STEP_M: f64 = 5e-3;
/// Surfaces smaller than this are left out, in square metres.
const MIN_M2: f64 = 1.0;
/// Surfaces at most, the largest.
const MAX_PLANES: usize = 24;

/// A flat surface of one material.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Plane {
    /// Unit normal and, in the plane, two unit vectors.
    pub axes: [[f64; 3]; 3],
    /// Distance of the plane from the origin along its normal, in metres.
    pub offset_m: f64,
    /// Index of its material.
    pub material: usize,
    /// Its area in square metres.
    pub area_m2: f64,
    /// Least and greatest coordinate along the two vectors in the plane, in metres.
    pub extent_m: [[f64; 2]; 2],
}

impl Plane {
    /// Coordinates in the plane, in metres.
    pub fn within(&self, place: [f64; 3]) -> [f64; 2] {
        [dot(self.axes[1], place), dot(self.axes[2], place)]
    }

    /// The place with these coordinates.
    pub fn place_m(&self, [u, v]: [f64; 2]) -> [f64; 3] {
        std::array::from_fn(|k| self.offset_m * self.axes[0][k] + u * self.axes[1][k] + v * self.axes[2][k])
    }

    /// Distance of a place from the plane, in metres.
    pub fn distance_m(&self, place: [f64; 3]) -> f64 {
        (dot(self.axes[0], place) - self.offset_m).abs()
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// The distance of two places.
pub(crate) fn apart_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Planes by the direction of their normals, so that a mesh of a million faces is not held against every plane found before.
#[derive(Default)]
pub(crate) struct ByNormal {
    cells: HashMap<[i32; 3], Vec<usize>>,
}

impl ByNormal {
    /// Side of a cell: normals that [`TILT`] takes for one are in the same cell or the next.
    const CELL: f64 = 0.015;

    fn cell(normal: [f64; 3]) -> [i32; 3] {
        normal.map(|c| (c / Self::CELL).floor() as i32)
    }

    pub fn insert(&mut self, normal: [f64; 3], index: usize) {
        self.cells.entry(Self::cell(normal)).or_default().push(index);
    }

    /// The least index that fits, of planes whose normals are nearly this one or its opposite.
    pub fn first(&self, normal: [f64; 3], fits: impl Fn(usize) -> bool) -> Option<usize> {
        let around = |centre: [i32; 3]| {
            (0..27).map(move |n| [centre[0] + n % 3 - 1, centre[1] + n / 3 % 3 - 1, centre[2] + n / 9 - 1])
        };
        let both = [normal, normal.map(|c| -c)];
        let near = both.into_iter().flat_map(|n| around(Self::cell(n)));
        near.filter_map(|cell| self.cells.get(&cell)?.iter().copied().find(|&i| fits(i))).min()
    }
}

/// The largest flat surfaces, and the area of each material in square metres.
pub(crate) fn planes(scene: &Scene) -> (Vec<Plane>, Vec<f64>) {
    let mut found: Vec<Plane> = Vec::new();
    let mut by_normal = ByNormal::default();
    let mut areas = vec![0.0; scene.materials().len()];
    for triangle in scene.triangles() {
        let [a, b, c] = triangle.vertices.map(|v| scene.vertices()[v as usize]);
        let edge = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| p[k] - a[k]) };
        let normal = cross(edge(b), edge(c));
        let length = dot(normal, normal).sqrt();
        let material = triangle.material as usize;
        areas[material] += 0.5 * length;
        if length < 1e-9 {
            continue;
        }
        let normal = normal.map(|n| n / length);
        let known = by_normal.first(normal, |index| {
            let p = &found[index];
            p.material == material
                && dot(p.axes[0], normal).abs() > 1.0 - TILT
                && [a, b, c].iter().all(|&corner| p.distance_m(corner) < STEP_M)
        });
        let index = known.unwrap_or_else(|| {
            // Along the axis of the room that lies most nearly in the plane.
            let least = (0..3).min_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs())).unwrap_or(0);
            let along: [f64; 3] =
                std::array::from_fn(|k| f64::from(u8::from(k == least)) - normal[least] * normal[k]);
            let size = dot(along, along).sqrt();
            let along = along.map(|x| x / size);
            by_normal.insert(normal, found.len());
            found.push(Plane {
                axes: [normal, along, cross(normal, along)],
                offset_m: dot(normal, a),
                material,
                area_m2: 0.0,
                extent_m: [[f64::INFINITY, f64::NEG_INFINITY]; 2],
            });
            found.len() - 1
        });
        let plane = &mut found[index];
        plane.area_m2 += 0.5 * length;
        for corner in [a, b, c] {
            let own = plane.within(corner);
            for (extent, x) in plane.extent_m.iter_mut().zip(own) {
                *extent = [extent[0].min(x), extent[1].max(x)];
            }
        }
    }
    found.retain(|p| p.area_m2 >= MIN_M2);
    found.sort_by(|a, b| b.area_m2.total_cmp(&a.area_m2));
    found.truncate(MAX_PLANES);
    (found, areas)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_acoustics::{Bands, Material};

    #[test]
    fn planes_are_found_by_their_normals_as_by_looking_at_all() {
        // Directions over the whole sphere, by the golden angle, and others a little off, of either sign.
        let direction = |i: usize| -> [f64; 3] {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / 2000.0;
            let (sin, cos) = (2.399_963 * i as f64).sin_cos();
            let r = (1.0 - z * z).sqrt();
            [r * cos, r * sin, z]
        };
        let mut by_normal = ByNormal::default();
        (0..2000).for_each(|i| by_normal.insert(direction(i), i));
        for i in 0..2000 {
            let other = direction((7 * i + 3) % 2000);
            let off: [f64; 3] = std::array::from_fn(|k| direction(i)[k] + 0.02 * other[k]);
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            let normal = off.map(|c| sign * c / dot(off, off).sqrt());
            let fits = |k: usize| dot(direction(k), normal).abs() > 1.0 - TILT;
            assert_eq!(by_normal.first(normal, fits), (0..2000).find(|&k| fits(k)), "{i}");
        }
    }

    #[test]
    fn a_box_has_six_planes_of_the_right_size() {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| hard.clone())).unwrap();
        let (planes, areas) = planes(&scene);
        let found: Vec<f64> = planes.iter().map(|p| p.area_m2).collect();
        assert_eq!(found, [20.0, 20.0, 15.0, 15.0, 12.0, 12.0]);
        assert!((areas.iter().sum::<f64>() - 94.0).abs() < 1e-9);
        for plane in &planes {
            let [[a, b], [c, d]] = plane.extent_m;
            assert!(((b - a) * (d - c) - plane.area_m2).abs() < 1e-9);
            let middle = plane.place_m([0.5 * (a + b), 0.5 * (c + d)]);
            assert!(plane.distance_m(middle) < 1e-9 && plane.distance_m([2.5, 2.0, 1.5]) > 1.0);
        }
    }
}
