//! A box-shaped obstacle that the mesh does not have.

use crate::survey::planes::dot;
use crate::survey::surfaces::{minus, unit};
use sabine_acoustics::Error as Cause;
use sabine_scene::{Scene, Triangle};
use serde::{Deserialize, Serialize};

/// A way must go deeper into an object than this to be blocked, in metres.
const GRAZING_M: f64 = 0.01;

/// A box that stands level in the room and is not in the mesh: a cupboard, a desk, a sofa.
///
/// ```
/// use sabine_diagnose::BoxObject;
/// let desk = BoxObject::new([2.0, 1.5, 0.0], [1.6, 0.8, 0.75], 90.0, "wood");
/// // Turned by a right angle, its first side runs along y.
/// let [low, high] = desk.bounds_m();
/// assert!((high[1] - low[1] - 1.6).abs() < 1e-9 && (high[2] - 0.75).abs() < 1e-9);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BoxObject {
    /// Middle of the face on which it stands, in metres.
    pub foot_m: [f64; 3],
    /// Its sides along its own two axes, and its height, in metres, 0.05 to 20.
    pub size_m: [f64; 3],
    /// By how much its first axis is turned from x towards y, in degrees, -180 to 180.
    pub turn_deg: f64,
    /// The material of the room that it is made of, by name.
    pub material: String,
}

impl BoxObject {
    /// An object on a foot, in metres, with these sides and this height in metres, turned by an angle in degrees, made of a material of the
    /// room.
    pub fn new(foot_m: [f64; 3], size_m: [f64; 3], turn_deg: f64, material: impl Into<String>) -> Self {
        Self { foot_m, size_m, turn_deg, material: material.into() }
    }

    /// Least and greatest coordinates, in metres.
    pub fn bounds_m(&self) -> [[f64; 3]; 2] {
        let corners = self.shape().corners();
        let fold = |k: usize, from: f64, of: fn(f64, f64) -> f64| corners.iter().map(|c| c[k]).fold(from, of);
        [
            std::array::from_fn(|k| fold(k, f64::INFINITY, f64::min)),
            std::array::from_fn(|k| fold(k, f64::NEG_INFINITY, f64::max)),
        ]
    }

    pub(crate) fn shape(&self) -> BoxShape {
        BoxShape::new(self.foot_m, self.size_m, self.turn_deg)
    }

    /// The scene with the object in it, behind all that is there.
    pub(crate) fn added_to(&self, scene: &Scene) -> Result<Scene, Cause> {
        let unknown = || Cause::UnknownId { id: self.material.clone() };
        let material = scene.materials().iter().position(|m| m.name == self.material).ok_or_else(unknown)?;
        let (mut vertices, mut triangles) = (scene.vertices().to_vec(), scene.triangles().to_vec());
        let first = vertices.len() as u32;
        vertices.extend(self.shape().corners());
        for [a, b, c, d] in CORNERS_OF_FACES {
            for corners in [[a, b, c], [a, c, d]] {
                triangles.push(Triangle { vertices: corners.map(|k| first + k), material: material as u32 });
            }
        }
        Scene::new(vertices, triangles, scene.materials().to_vec())
    }
}

/// Corners of each face, seen from outside counter-clockwise; the last is the foot. Bit k of a corner's number says on which side of axis k
/// it lies.
const CORNERS_OF_FACES: [[u32; 4]; 6] =
    [[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]];

/// A box by its middle, its axes and half its sides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxShape {
    middle_m: [f64; 3],
    axes: [[f64; 3]; 3],
    half_m: [f64; 3],
}

/// How it reflects from a source to a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FaceReflection {
    pub length_m: f64,
    pub departure: [f64; 3],
    pub arrival: [f64; 3],
}

impl BoxShape {
    /// Reflections that it may make between two places: over the top, over each upright face, and over each of these and the floor.
    pub const WAYS: usize = 9;
    /// The first of those over the floor.
    pub const OVER_FLOOR: usize = 5;

    pub fn new(foot_m: [f64; 3], size_m: [f64; 3], turn_deg: f64) -> Self {
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let half_m = size_m.map(|s| 0.5 * s);
        Self {
            middle_m: [foot_m[0], foot_m[1], foot_m[2] + half_m[2]],
            axes: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]],
            half_m,
        }
    }

    fn corners(&self) -> [[f64; 3]; 8] {
        std::array::from_fn(|corner| {
            let along = |k: usize| if corner >> k & 1 == 1 { self.half_m[k] } else { -self.half_m[k] };
            std::array::from_fn(|k| {
                self.middle_m[k] + (0..3).map(|a| along(a) * self.axes[a][k]).sum::<f64>()
            })
        })
    }

    /// A reflection (below [`Self::WAYS`]), if both ends lie before its face and that reaches far enough. One over the floor meets the floor before
    /// the face or behind it: the image is the same.
    pub fn reflection(&self, way: usize, source: [f64; 3], receiver: [f64; 3]) -> Option<FaceReflection> {
        let over_floor = way >= Self::OVER_FLOOR;
        let face = if over_floor { way - Self::OVER_FLOOR } else { way };
        let (axis, sign) = (face / 2, if face.is_multiple_of(2) { 1.0 } else { -1.0 });
        let normal = self.axes[axis].map(|c| sign * c);
        let before = |place: [f64; 3]| dot(normal, minus(place, self.middle_m)) - self.half_m[axis];
        let (from, to) = (before(source), before(receiver));
        if from <= 0.0 || to <= 0.0 {
            return None;
        }
        let floor_m = self.middle_m[2] - self.half_m[2];
        let in_floor = |[x, y, z]: [f64; 3]| [x, y, if over_floor { 2.0 * floor_m - z } else { z }];
        let image_of = |place: [f64; 3], far: f64| -> [f64; 3] {
            let below = in_floor(place);
            std::array::from_fn(|k| below[k] - 2.0 * far * normal[k])
        };
        let image = image_of(source, from);
        let share = to / (to + from);
        let place: [f64; 3] = std::array::from_fn(|k| receiver[k] + share * (image[k] - receiver[k]));
        let off = minus(place, self.middle_m);
        let is_within = |a: usize| {
            let far = dot(self.axes[a], off);
            // Over the floor the face goes on below as its image.
            let lowest = if over_floor && a == 2 { -3.0 * self.half_m[a] } else { -self.half_m[a] };
            a == axis || (lowest..=self.half_m[a]).contains(&far)
        };
        if !(0..3).all(is_within) {
            return None;
        }
        let way = minus(image, receiver);
        Some(FaceReflection {
            length_m: dot(way, way).sqrt(),
            departure: unit(minus(image_of(receiver, to), source)),
            arrival: unit(way),
        })
    }

    /// Whether it stands in a way, given the points from which to which that goes straight on.
    pub fn blocks(&self, stops: &[[f64; 3]]) -> bool {
        stops.windows(2).any(|leg| self.blocks_leg(leg[0], leg[1]))
    }

    fn blocks_leg(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let (start, way) = (minus(from, self.middle_m), minus(to, from));
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for (axis, half_m) in self.axes.iter().zip(self.half_m) {
            let (at, along, half_m) = (dot(*axis, start), dot(*axis, way), (half_m - GRAZING_M).max(0.0));
            if along.abs() < 1e-12 {
                if at.abs() >= half_m {
                    return false;
                }
                continue;
            }
            let ends = [(-half_m - at) / along, (half_m - at) / along];
            enters = enters.max(ends[0].min(ends[1]));
            leaves = leaves.min(ends[0].max(ends[1]));
        }
        enters < leaves
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::survey::planes::cross;
    use sabine_acoustics::{Bands, Material};
    use sabine_paths::RayScene;
    use sabine_propagate::MeshScene;
    use sabine_scene::NamedMaterial;

    fn desk() -> BoxObject {
        BoxObject::new([2.0, 1.5, 0.3], [1.6, 0.7, 0.75], 25.0, "wood")
    }

    /// The object on a floor.
    fn mesh(object: &BoxObject) -> (Scene, MeshScene) {
        let z = object.foot_m[2];
        let vertices = vec![[-90.0, -90.0, z], [90.0, -90.0, z], [0.0, 90.0, z]];
        let material = Material::uniform(Bands::octaves(125.0, 8000.0).unwrap(), 0.1, 0.0).unwrap();
        let floor = Triangle { vertices: [0, 1, 2], material: 0 };
        let wood = NamedMaterial { name: "wood".into(), material };
        let scene = Scene::new(vertices, vec![floor], vec![wood]).unwrap();
        let with = object.added_to(&scene).unwrap();
        let traced = MeshScene::new(&with).unwrap();
        (with, traced)
    }

    fn places() -> Vec<[f64; 3]> {
        let at = |i: usize| {
            let t = i as f64;
            [2.0 + 2.5 * (1.3 * t).sin(), 1.5 + 2.5 * (2.1 * t).cos(), 0.4 + 1.4 * (0.7 * t).sin().abs()]
        };
        let outside = |p: &[f64; 3]| !desk().shape().blocks(&[*p, [p[0], p[1], p[2] + 1e-3]]);
        (0..40).map(at).filter(outside).collect()
    }

    #[test]
    fn its_mesh_is_closed_and_turned_outwards() {
        let (scene, _) = mesh(&desk());
        let of = |t: &Triangle| t.vertices.map(|v| scene.vertices()[v as usize]);
        // Divergence theorem: the volume is a third of the flux of the place through the surface.
        let volume: f64 = scene.triangles()[1..]
            .iter()
            .map(of)
            .map(|[a, b, c]| dot(a, cross(minus(b, a), minus(c, a))) / 6.0)
            .sum();
        assert!((volume - 1.6 * 0.7 * 0.75).abs() < 1e-9, "{volume}");
        assert!(matches!(
            BoxObject { material: "felt".into(), ..desk() }.added_to(&scene),
            Err(Cause::UnknownId { id }) if id == "felt"
        ));
    }

    /// Against the rays of the tracer, which know triangles alone.
    #[test]
    fn it_blocks_what_its_mesh_does() {
        let (_, traced) = mesh(&desk());
        let shape = desk().shape();
        let mut blocked = 0;
        for from in places() {
            for to in places().into_iter().filter(|to| *to != from) {
                let far = dot(minus(to, from), minus(to, from)).sqrt();
                let hit = traced.closest_hit(from, unit(minus(to, from)), far);
                let is_blocked = shape.blocks(&[from, to]);
                blocked += usize::from(is_blocked);
                // What passes an edge by less than a centimetre is not blocked.
                let deeper = BoxObject { size_m: desk().size_m.map(|s| s - 0.06), ..desk() };
                let surely = deeper.shape().blocks(&[from, to]);
                assert!(!is_blocked || hit.is_some(), "{from:?} {to:?}");
                assert!(is_blocked || !surely, "{from:?} {to:?}");
            }
        }
        assert!(blocked > 50, "{blocked}");
    }

    /// The same: a ray that leaves as a reflection does is back at the receiver after as many reflections and as long a way.
    #[test]
    fn it_reflects_as_its_mesh_does() {
        let (scene, traced) = mesh(&desk());
        let shape = desk().shape();
        let mut of_ways = [0; BoxShape::WAYS];
        for from in places() {
            for to in places().into_iter().filter(|to| *to != from) {
                for (way, count) in of_ways.iter_mut().enumerate() {
                    let Some(found) = shape.reflection(way, from, to) else { continue };
                    *count += 1;
                    let (mut place, mut direction, mut left_m) = (from, found.departure, found.length_m);
                    for _ in 0..if way < BoxShape::OVER_FLOOR { 1 } else { 2 } {
                        let hit = traced.closest_hit(place, direction, left_m).unwrap();
                        place = std::array::from_fn(|k| place[k] + (hit.distance - 1e-9) * direction[k]);
                        left_m -= hit.distance;
                        let corners = scene.triangles()[hit.triangle as usize].vertices;
                        let [a, b, c] = corners.map(|v| scene.vertices()[v as usize]);
                        let normal = unit(cross(minus(b, a), minus(c, a)));
                        let onto = dot(normal, direction);
                        direction = std::array::from_fn(|k| direction[k] - 2.0 * onto * normal[k]);
                    }
                    let end: [f64; 3] = std::array::from_fn(|k| place[k] + left_m * direction[k]);
                    assert!(dot(minus(end, to), minus(end, to)).sqrt() < 1e-6, "{way}: {end:?} {to:?}");
                    assert!(dot(direction, found.arrival) < -1.0 + 1e-9);
                }
            }
        }
        assert!(of_ways.iter().all(|count| *count > 3), "{of_ways:?}");
    }
}
