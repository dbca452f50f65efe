//! The room as plain arrays: what any tracer can take.

use sabine_acoustics::{Error, Material, OutOfRange};
use std::fmt::Write;

/// A triangle: three indices into the vertices, and one into the materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Corners, as indices into [`Scene::vertices`].
    pub vertices: [u32; 3],
    /// Surface, as an index into [`Scene::materials`].
    pub material: u32,
}

/// A surface of the scene: the name that the model gives it, and what it does to sound.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedMaterial {
    /// Name, as in the model's `usemtl`.
    pub name: String,
    /// Absorption and scattering.
    pub material: Material,
}

/// A room: vertices in metres (right-handed, z up), triangles, and a material for each triangle.
///
/// Indices are checked, coordinates are finite and all materials share their bands. Whether the mesh is closed is for the
/// tracer to say.
/// ```
/// use sabine_acoustics::{Bands, Material};
/// use sabine_scene::Scene;
/// let wall = Material::uniform(Bands::SIMULATION, 0.1, 0.2)?;
/// let room = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| wall.clone()))?;
/// assert!((room.volume_m3() - 60.0).abs() < 1e-9 && (room.surface_m2() - 94.0).abs() < 1e-9);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<Triangle>,
    materials: Vec<NamedMaterial>,
}

/// The origin is far away from a room if it is more than so many times its size away.
const FAR: f64 = 10.0;

impl Scene {
    /// Checks and takes the arrays.
    ///
    /// # Errors
    /// [`Error::Empty`] without vertices, triangles or materials, [`Error::Index`] for an index past the end,
    /// [`Error::OutOfRange`] for a coordinate that is not finite or beyond 100 km,
    /// [`Error::BandMismatch`] for materials on different bands.
    pub fn new(
        vertices: Vec<[f64; 3]>,
        triangles: Vec<Triangle>,
        materials: Vec<NamedMaterial>,
    ) -> Result<Self, Error> {
        for (what, empty) in [
            ("list of vertices", vertices.is_empty()),
            ("list of triangles", triangles.is_empty()),
            ("list of materials", materials.is_empty()),
        ] {
            if empty {
                return Err(Error::Empty { what });
            }
        }
        for &coordinate in vertices.iter().flatten() {
            check_coordinate("vertex coordinate (m)", coordinate)?;
        }
        for triangle in &triangles {
            for index in triangle.vertices {
                check_index("vertex", index, vertices.len())?;
            }
            check_index("material", triangle.material, materials.len())?;
        }
        let bands = materials[0].material.bands();
        for named in &materials {
            if named.material.bands() != bands {
                return Err(Error::BandMismatch { left: bands, right: named.material.bands() });
            }
        }
        Ok(Self { vertices, triangles, materials })
    }

    /// An axis-parallel box with one corner at the origin, its faces turned inward; materials in the order
    /// x = 0, x = length, y = 0, y = width, z = 0 (floor), z = height (ceiling).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a side that is not positive; else as [`Scene::new`].
    pub fn shoebox(size_m: [f64; 3], materials: [Material; 6]) -> Result<Self, Error> {
        for side in size_m {
            OutOfRange::check("side of the box (m)", side, 1e-3, 1e5, "positive")?;
        }
        let [x, y, z] = size_m;
        let vertices = vec![
            [0., 0., 0.],
            [x, 0., 0.],
            [x, y, 0.],
            [0., y, 0.],
            [0., 0., z],
            [x, 0., z],
            [x, y, z],
            [0., y, z],
        ];
        let faces: [[u32; 4]; 6] =
            [[0, 3, 7, 4], [1, 5, 6, 2], [0, 4, 5, 1], [3, 2, 6, 7], [0, 1, 2, 3], [4, 7, 6, 5]];
        let triangles = faces
            .iter()
            .enumerate()
            .flat_map(|(material, &[a, b, c, d])| {
                let material = material as u32;
                [Triangle { vertices: [a, b, c], material }, Triangle { vertices: [a, c, d], material }]
            })
            .collect();
        let names = ["x0", "x1", "y0", "y1", "floor", "ceiling"];
        let materials = names
            .into_iter()
            .zip(materials)
            .map(|(name, material)| NamedMaterial { name: name.to_owned(), material })
            .collect();
        Self::new(vertices, triangles, materials)
    }

    /// Vertices in metres.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// Triangles.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Materials, each with its name.
    pub fn materials(&self) -> &[NamedMaterial] {
        &self.materials
    }

    /// Corners of a triangle, in metres.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn corners_m(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].vertices.map(|v| self.vertices[v as usize])
    }

    /// The same room with other materials, in the same order.
    ///
    /// # Errors
    /// [`Error::MaterialCount`] if their number differs; else as [`Scene::new`].
    pub fn with_materials(&self, materials: Vec<Material>) -> Result<Self, Error> {
        if materials.len() != self.materials.len() {
            return Err(Error::MaterialCount { expected: self.materials.len(), found: materials.len() });
        }
        let named = self
            .materials
            .iter()
            .zip(materials)
            .map(|(old, material)| NamedMaterial { name: old.name.clone(), material })
            .collect();
        Self::new(self.vertices.clone(), self.triangles.clone(), named)
    }

    /// The lowest and the highest coordinates of the corners of its triangles, in metres.
    pub fn bounds_m(&self) -> [[f64; 3]; 2] {
        let used = self.triangles.iter().flat_map(|t| t.vertices.map(|v| self.vertices[v as usize]));
        used.fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], p| {
            [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
        })
    }

    /// The mesh in the form of Wavefront OBJ, in metres and z up, each triangle under the name of its material.
    ///
    /// ```
    /// use sabine_acoustics::{Bands, Material};
    /// use sabine_scene::Scene;
    /// let wall = Material::uniform(Bands::T60, 0.1, 0.1)?;
    /// let room = Scene::shoebox([6.0, 5.0, 3.0], std::array::from_fn(|_| wall.clone()))?;
    /// assert_eq!(room.to_obj().lines().filter(|line| line.starts_with("f ")).count(), 12);
    /// # Ok::<(), sabine_acoustics::Error>(())
    /// ```
    pub fn to_obj(&self) -> String {
        let mut text = String::from("# metres, z up\n");
        for [x, y, z] in &self.vertices {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for (index, named) in self.materials.iter().enumerate() {
            let _ = writeln!(text, "usemtl {}", named.name);
            for triangle in self.triangles.iter().filter(|t| t.material as usize == index) {
                let [a, b, c] = triangle.vertices.map(|v| v + 1);
                let _ = writeln!(text, "f {a} {b} {c}");
            }
        }
        text
    }

    /// Total surface in square metres, each triangle counted once.
    pub fn surface_m2(&self) -> f64 {
        self.material_areas_m2().iter().sum()
    }

    /// Surface of each material in square metres.
    pub fn material_areas_m2(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.materials.len()];
        for (i, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = self.corners_m(i);
            let n = cross(sub(b, a), sub(c, a));
            areas[triangle.material as usize] += 0.5 * dot(n, n).sqrt();
        }
        areas
    }

    /// Enclosed volume in cubic metres (divergence theorem); meaningful for a closed mesh whose faces are wound alike.
    pub fn volume_m3(&self) -> f64 {
        // Seen from its middle where the origin is far away: differences of large products would be rounding.
        let [low, high] = self.bounds_m();
        let middle = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        let from = if norm(middle) > FAR * norm(sub(high, low)) { middle } else { [0.0; 3] };
        let signed: f64 = (0..self.triangles.len())
            .map(|i| {
                let [a, b, c] = self.corners_m(i).map(|corner| sub(corner, from));
                dot(a, cross(b, c)) / 6.0
            })
            .sum();
        signed.abs()
    }
}

/// Where sound comes from: a point, with an acoustic axis if it is directional.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Identifier in the room file.
    pub id: String,
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit vector along the acoustic axis, if known.
    pub axis: Option<[f64; 3]>,
}

/// Where sound is heard: a point, with a look direction if it matters.
#[derive(Clone, Debug, PartialEq)]
pub struct Receiver {
    /// Identifier in the room file.
    pub id: String,
    /// Position in metres.
    pub position_m: [f64; 3],
    /// Unit vector along the look direction, if known.
    pub axis: Option<[f64; 3]>,
}

impl Source {
    /// An omnidirectional point source.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a coordinate that is not finite.
    pub fn omni(id: impl Into<String>, position_m: [f64; 3]) -> Result<Self, Error> {
        check_position(position_m)?;
        Ok(Self { id: id.into(), position_m, axis: None })
    }
}

impl Receiver {
    /// An omnidirectional point receiver.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a coordinate that is not finite.
    pub fn omni(id: impl Into<String>, position_m: [f64; 3]) -> Result<Self, Error> {
        check_position(position_m)?;
        Ok(Self { id: id.into(), position_m, axis: None })
    }
}

fn check_position(position_m: [f64; 3]) -> Result<(), Error> {
    position_m.into_iter().try_for_each(|coordinate| check_coordinate("position (m)", coordinate))
}

fn check_coordinate(field: &'static str, value: f64) -> Result<(), Error> {
    Ok(OutOfRange::check(field, value, -1e5, 1e5, "finite and within 100 km")?)
}

fn check_index(what: &'static str, index: u32, count: usize) -> Result<(), Error> {
    let index = index as usize;
    if index < count { Ok(()) } else { Err(Error::Index { what, index, count }) }
}

pub(crate) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::Bands;

    #[test]
    fn the_box_knows_its_size() {
        let m = Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap();
        let scene = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| m.clone())).unwrap();
        assert!((scene.volume_m3() - 210.0).abs() < 1e-9);
        assert!((scene.surface_m2() - 242.0).abs() < 1e-9);
        for (area, expected) in scene.material_areas_m2().iter().zip([21., 21., 30., 30., 70., 70.]) {
            assert!((area - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn a_box_far_from_the_origin_keeps_its_volume() {
        let m = Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap();
        let scene = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| m.clone())).unwrap();
        let far = scene.vertices().iter().map(|v| v.map(|c| c + 50_000.0)).collect();
        let far = Scene::new(far, scene.triangles().to_vec(), scene.materials().to_vec()).unwrap();
        assert!((far.volume_m3() - 210.0).abs() < 1e-6, "{}", far.volume_m3());
        assert_eq!(far.bounds_m(), [[50_000.0; 3], [50_010.0, 50_007.0, 50_003.0]]);
    }

    #[test]
    fn faces_of_the_box_look_inward() {
        let m = Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap();
        let scene = Scene::shoebox([4.0, 3.0, 2.0], std::array::from_fn(|_| m.clone())).unwrap();
        for i in 0..12 {
            let [a, b, c] = scene.corners_m(i);
            assert!(dot(cross(sub(b, a), sub(c, a)), sub([2.0, 1.5, 1.0], a)) > 0.0, "triangle {i}");
        }
    }

    #[test]
    fn wild_indices_and_coordinates_are_refused() {
        let m = Material::uniform(Bands::SIMULATION, 0.1, 0.1).unwrap();
        let named = || vec![NamedMaterial { name: "wall".into(), material: m.clone() }];
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let bad_vertex = vec![Triangle { vertices: [0, 1, 3], material: 0 }];
        assert!(matches!(
            Scene::new(vertices.clone(), bad_vertex, named()),
            Err(Error::Index { index: 3, .. })
        ));
        let bad_material = vec![Triangle { vertices: [0, 1, 2], material: 1 }];
        assert!(matches!(Scene::new(vertices, bad_material, named()), Err(Error::Index { .. })));
        let fine = vec![Triangle { vertices: [0, 1, 2], material: 0 }];
        let not_a_number = vec![[f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!(matches!(Scene::new(not_a_number, fine, named()), Err(Error::OutOfRange(_))));
    }
}
