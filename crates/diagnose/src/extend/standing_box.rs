//! A box that stands in the room, and that the mesh does not have.

use crate::survey::surfaces::minus;
use sabine_acoustics::{Error as Cause, Material};
use sabine_scene::{NamedMaterial, Scene, Triangle};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A box in a mesh stands so far above the floor, in metres: faces in one plane would hide each other.
const ABOVE_FLOOR_M: f64 = 2e-3;

/// A box-shaped obstacle with upright sides, of one material: a cupboard, a sofa, a sideboard.
///
/// ```
/// use sabine_diagnose::StandingBox;
/// let cupboard = StandingBox::new([2.0, 1.0, 0.0], [2.0, 0.8, 1.0], 90.0, 0.1);
/// // Turned by a right angle, it is long along y.
/// assert!(cupboard.holds([2.0, 1.9, 0.5]) && !cupboard.holds([2.9, 1.0, 0.5]));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct StandingBox {
    /// Middle of its lower face, in metres.
    pub base_m: [f64; 3],
    /// Length, width and height in metres, 0.05 to 20.
    pub sides_m: [f64; 3],
    /// Angle of its length to the x axis in degrees, counter-clockwise from above.
    pub yaw_deg: f64,
    /// Absorption, the same in all octaves, 0 to 1; it does not scatter.
    pub absorption: f64,
}

impl StandingBox {
    /// Least and greatest side in metres.
    pub(crate) const SIDES_M: (f64, f64) = (0.05, 20.0);

    /// A box whose lower face has its middle at `base_m`.
    pub fn new(base_m: [f64; 3], sides_m: [f64; 3], yaw_deg: f64, absorption: f64) -> Self {
        Self { base_m, sides_m, yaw_deg, absorption }
    }

    /// Whether a place in metres lies in it.
    pub fn holds(&self, place_m: [f64; 3]) -> bool {
        Solid::of(self).holds(place_m, 0.0)
    }

    /// Its eight corners in metres: the lower face counter-clockwise from above, then the upper one.
    pub fn corners_m(&self) -> [[f64; 3]; 8] {
        let solid = Solid::of(self);
        let at = |[u, v]: [f64; 2], z: f64| solid.place([u * solid.half[0], v * solid.half[1], z]);
        let [a, b, c, d] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let h = solid.height;
        [at(a, 0.0), at(b, 0.0), at(c, 0.0), at(d, 0.0), at(a, h), at(b, h), at(c, h), at(d, h)]
    }

    /// A scene with it, two millimetres above where it stands, its twelve faces behind all others and of the material of an index.
    pub(crate) fn added_to(&self, scene: &Scene, material: u32) -> Result<Scene, Cause> {
        let (mut vertices, mut triangles) = (scene.vertices().to_vec(), scene.triangles().to_vec());
        let first = vertices.len() as u32;
        let lifted = self.corners_m().map(|[x, y, z]| [x, y, z + ABOVE_FLOOR_M]);
        vertices.extend(lifted);
        for [a, b, c, d] in
            [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
        {
            for corners in [[a, b, c], [a, c, d]] {
                triangles.push(Triangle { vertices: corners.map(|v| first + v), material });
            }
        }
        Scene::new(vertices, triangles, scene.materials().to_vec())
    }

    /// The same, of a material of its own with a name.
    pub(crate) fn added_as(&self, scene: &Scene, name: String) -> Result<Scene, Cause> {
        let bands = scene.materials()[0].material.bands();
        let mut materials = scene.materials().to_vec();
        materials.push(NamedMaterial { name, material: Material::uniform(bands, self.absorption, 0.0)? });
        let own = (materials.len() - 1) as u32;
        let with = Scene::new(scene.vertices().to_vec(), scene.triangles().to_vec(), materials)?;
        self.added_to(&with, own)
    }
}

/// For people with a tape measure.
impl fmt::Display for StandingBox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([x, y, _], [length, width, height]) = (self.base_m, self.sides_m);
        write!(
            f,
            "Something about {length:.1} x {width:.1} x {height:.1} m (length, width, height) stands with its middle at ({x:.1}, {y:.1}) m, \
             its length turned by {:.0} degrees from the x axis.",
            self.yaw_deg
        )
    }
}

/// A box ready for many tests: coordinates of its own are counted from the middle of its lower face along length, width and upwards.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solid {
    base: [f64; 3],
    pub half: [f64; 2],
    pub height: f64,
    cos: f64,
    sin: f64,
}

impl Solid {
    pub fn of(one: &StandingBox) -> Self {
        let (sin, cos) = one.yaw_deg.to_radians().sin_cos();
        let [length, width, height] = one.sides_m;
        Self { base: one.base_m, half: [0.5 * length, 0.5 * width], height, cos, sin }
    }

    /// A place in its own coordinates.
    pub fn local(&self, place: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = minus(place, self.base);
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x, z]
    }

    /// A place from its own coordinates.
    pub fn place(&self, [u, v, z]: [f64; 3]) -> [f64; 3] {
        [
            self.base[0] + self.cos * u - self.sin * v,
            self.base[1] + self.sin * u + self.cos * v,
            self.base[2] + z,
        ]
    }

    /// Height of its upper face in the room, in metres.
    pub fn top_m(&self) -> f64 {
        self.base[2] + self.height
    }

    /// Whether a place lies in it, or no farther from it than a margin along each of its axes.
    pub fn holds(&self, place: [f64; 3], margin_m: f64) -> bool {
        let [u, v, z] = self.local(place);
        u.abs() < self.half[0] + margin_m
            && v.abs() < self.half[1] + margin_m
            && (-margin_m..self.height + margin_m).contains(&z)
    }

    /// The part of the way between two places that lies in it, as shares of the way; none where the way goes past it (A. Kay and J. Kajiya,
    /// *Ray tracing complex scenes*, SIGGRAPH 1986: slabs).
    pub fn crossed(&self, from: [f64; 3], to: [f64; 3]) -> Option<[f64; 2]> {
        if from[2].min(to[2]) >= self.top_m() {
            return None;
        }
        let (a, b) = (self.local(from), self.local(to));
        let (mut enters, mut leaves) = (0.0f64, 1.0f64);
        let slabs =
            [[-self.half[0], self.half[0]], [-self.half[1], self.half[1]], [0.0, self.height]].into_iter();
        for (k, [low, high]) in slabs.enumerate() {
            let way = b[k] - a[k];
            if way.abs() < 1e-12 {
                if a[k] <= low || a[k] >= high {
                    return None;
                }
                continue;
            }
            let ends = [(low - a[k]) / way, (high - a[k]) / way];
            enters = enters.max(ends[0].min(ends[1]));
            leaves = leaves.min(ends[0].max(ends[1]));
            if enters >= leaves {
                return None;
            }
        }
        Some([enters, leaves])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use crate::survey::planes::dot;
    use crate::survey::surfaces::normal_of;
    use sabine_acoustics::Bands;
    use sabine_paths::RayScene;
    use sabine_propagate::MeshScene;

    fn cupboard() -> StandingBox {
        StandingBox::new([2.2, 1.7, 0.0], [1.9, 0.8, 1.1], 25.0, 0.2)
    }

    /// Ways between places all around, against the triangles of the mesh.
    #[test]
    fn a_way_crosses_the_box_where_a_ray_meets_its_faces() {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let room = Scene::shoebox([5.0, 4.0, 2.5], std::array::from_fn(|_| hard.clone())).unwrap();
        let alone = {
            let with = cupboard().added_to(&room, 0).unwrap();
            Scene::new(with.vertices().to_vec(), with.triangles()[12..].to_vec(), with.materials().to_vec())
        };
        let mesh = MeshScene::new(&alone.unwrap()).unwrap();
        let solid = Solid::of(&StandingBox { base_m: [2.2, 1.7, ABOVE_FLOOR_M], ..cupboard() });
        let place = |i: usize, k: usize, side: f64| side * ((i as f64 * [0.618, 0.755, 0.569][k]) % 1.0);
        let mut crossed = 0;
        for i in 0..4000 {
            let from = [place(i, 0, 5.0), place(i, 1, 4.0), place(i, 2, 2.5)];
            let to = [place(7 * i + 3, 1, 5.0), place(5 * i + 1, 2, 4.0), place(3 * i + 2, 0, 2.5)];
            if solid.holds(from, 1e-6) || solid.holds(to, 1e-6) {
                continue;
            }
            let way = minus(to, from);
            let length = dot(way, way).sqrt();
            let hit = mesh.closest_hit(from, way.map(|c| c / length), length);
            let found = solid.crossed(from, to);
            assert_eq!(found.is_some(), hit.is_some(), "{from:?} {to:?}");
            if let (Some([enters, _]), Some(hit)) = (found, hit) {
                assert!((enters * length - hit.distance).abs() < 1e-6);
                crossed += 1;
            }
        }
        assert!(crossed > 300, "{crossed}");
    }

    #[test]
    fn its_faces_look_outwards_and_close_it() {
        let hard = Material::uniform(Bands::T60, 0.1, 0.0).unwrap();
        let room = Scene::shoebox([5.0, 4.0, 2.5], std::array::from_fn(|_| hard.clone())).unwrap();
        let one = cupboard();
        let with = one.added_as(&room, "object_1".to_owned()).unwrap();
        assert_eq!(with.triangles().len(), 24);
        let middle = Solid::of(&one).place([0.0, 0.0, 0.55]);
        let mut volume = 0.0;
        for triangle in 12..24 {
            let corners = with.corners_m(triangle);
            let out = normal_of(corners);
            assert!(dot(out, minus(corners[0], middle)) > 0.0, "{triangle}");
            volume += dot(out, minus(corners[0], middle)) / 6.0;
            assert_eq!(with.materials()[with.triangles()[triangle].material as usize].name, "object_1");
        }
        // The divergence theorem: pyramids over the faces fill it.
        assert!((volume - 1.9 * 0.8 * 1.1).abs() < 1e-9, "{volume}");
        let absorbed = with.materials().last().unwrap().material.absorption().values();
        assert!(absorbed.iter().all(|a| (a - 0.2).abs() < 1e-12));
    }
}
