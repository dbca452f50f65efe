//! The flat surfaces of a mesh.

use sabine_scene::Scene;

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

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The largest flat surfaces, and the area of each material in square metres.
pub(crate) fn planes(scene: &Scene) -> (Vec<Plane>, Vec<f64>) {
    let mut found: Vec<Plane> = Vec::new();
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
        let known = found.iter().position(|p| {
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
